"""Fixtures: the writers of made logs, one a format."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest


def _writer(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def dataflash_writer() -> ModuleType:
    """Return the module that writes ArduPilot logs."""
    return _writer("dataflash_writer")


@pytest.fixture(scope="session")
def ros_writer() -> ModuleType:
    """Return the module that writes ROS bags."""
    return _writer("ros_writer")
