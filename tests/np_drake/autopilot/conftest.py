"""Betaflight's firmware, without which these tests skip."""

import numpy as np
import pytest

from np_drake.autopilot.firmware import AutopilotError, Sensed, find_firmware


@pytest.fixture(scope="session", autouse=True)
def installed():
    try:
        find_firmware()
    except AutopilotError as missing:
        pytest.skip(f"{missing} `make autopilot` runs these tests.")


@pytest.fixture
def at_rest() -> Sensed:
    return Sensed(
        np.zeros(3), np.array([0.0, 0.0, 9.81]), np.array([1.0, 0, 0, 0]), np.zeros(3), np.zeros(3)
    )
