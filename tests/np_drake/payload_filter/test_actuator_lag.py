"""Laws of the rotors' lag as it is told in flight."""

import numpy as np
import pytest

from np_drake.payload_filter.actuator_lag import decays_of, initial_lag, next_lag

STEP, TRAINED = 0.02, 0.03  # [s]
HOVER = np.array([20.0, 0.0, 0.0, 0.0])
WHITE = 0.2 * np.random.default_rng(0).standard_normal((100, 4)) + HOVER  # over 2 s


def behind(commands: np.ndarray, lag: float) -> np.ndarray:
    """What acts (n, 4) under commands that a first-order lag follows [N, N·m]."""
    acting, course = HOVER, []
    for u in commands:
        acting = u + np.exp(-STEP / lag) * (acting - u) if lag else u
        course.append(acting)
    return np.array(course)


def told(commands: np.ndarray, true: float, *, trained=TRAINED, noise=0.002, level=0.05):
    """The memory after torques whose labels take the trained lag for granted."""
    error = noise * np.random.default_rng(1).standard_normal((len(commands), 3)) + level
    torques = (behind(commands, true) - behind(commands, trained))[:, 1:] + error
    memory = initial_lag(trained, HOVER)
    for u, torque in zip(commands, torques, strict=True):
        lagged = u + decays_of(trained, STEP) * (memory["lagged"] - u)
        memory |= {"lagged": lagged, **next_lag(memory, trained, lagged, torque, STEP)}
    return memory


@pytest.mark.parametrize("true", [0.03, 0.05, 0.09, 0.14])
def test_two_seconds_of_commands_tell_the_true_lag(true):
    assert told(WHITE, true)["lag"][0] == pytest.approx(true, rel=0.2)


@pytest.mark.parametrize("noise", [0.002, 1e-6])
def test_a_command_that_does_not_turn_the_vehicle_tells_nothing(noise):
    assert initial_lag(TRAINED, HOVER)["lag"][0] == TRAINED
    found = told(np.tile(HOVER, (100, 1)), 0.09, noise=noise)["lag"][0]
    assert found == pytest.approx(TRAINED, rel=0.05)  # of the prior, which is not quite even


def test_rotors_without_a_lag_stay_so():
    assert told(WHITE, 0.0, trained=0.0)["lag"][0] == 0.0
