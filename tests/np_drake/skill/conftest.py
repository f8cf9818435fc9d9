import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def flown():
    """The functions of `conical_flight.py`."""
    path = Path(__file__).with_name("conical_flight.py")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
