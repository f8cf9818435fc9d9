"""Writers of made files, one a format, and what tests of several formats share."""

import importlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from np_drake.logs.formats.format import Stream

Write = Callable[[Path, dict[str, Stream]], None]


def load_writer(name: str) -> ModuleType:
    """Return the module `<name>_writer.py` beside this file."""
    return importlib.import_module(f"tests.np_drake.logs.formats.{name}_writer")


@pytest.fixture(scope="session")
def write_table() -> Write:
    """Return the function that writes a table."""
    write: Write = load_writer("table").write
    return write


@pytest.fixture(scope="session")
def write_neural_fly() -> Write:
    """Return the function that writes a file of the Neural-Fly data set."""
    write: Write = load_writer("neural_fly").write
    return write


@pytest.fixture(scope="session")
def dataflash_writer() -> ModuleType:
    """Return the module that writes ArduPilot logs."""
    return load_writer("dataflash")


@pytest.fixture(scope="session")
def ros_writer() -> ModuleType:
    """Return the module that writes ROS bags."""
    return load_writer("ros")


@pytest.fixture(scope="session")
def crazyflie_writer() -> ModuleType:
    """Return the module that writes Crazyflie micro-SD logs."""
    return load_writer("crazyflie")


@pytest.fixture(scope="session")
def blackbox_writer() -> ModuleType:
    """Return the module that writes blackbox logs."""
    return load_writer("blackbox")


@pytest.fixture(scope="session")
def ulog_writer() -> ModuleType:
    """Return the module that writes ULog files."""
    return load_writer("ulog")
