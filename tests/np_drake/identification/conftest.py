"""Fixtures: flights in closed form (`analytic.py`), and what is identified from them."""

import pytest

from np_drake.identification.identify import identify
from tests.np_drake.identification import analytic


@pytest.fixture(scope="session")
def flights():
    """Three flights with rotor speed."""
    return [analytic.flight(seed=seed, seconds=10.0) for seed in range(3)]


@pytest.fixture(scope="session")
def found(flights):
    """What is identified from flights with rotor speed."""
    return identify(flights, analytic.KNOWN, mass=analytic.TRUE.mass)


@pytest.fixture(scope="session")
def by_collective():
    """What is identified from two flights whose thrust begins at a command of 0.06."""
    logs = [analytic.collective_flight(seed=seed, seconds=10.0) for seed in range(2)]
    return identify(logs, analytic.KNOWN, mass=analytic.TRUE.mass)


@pytest.fixture(scope="session")
def by_throttle():
    """What is identified from two flights with throttle."""
    logs = [analytic.flight(seed=seed, seconds=10.0, drive="throttle") for seed in range(2)]
    return identify(logs, analytic.KNOWN, mass=analytic.TRUE.mass)
