"""Laws of the hook's place as it is estimated in flight."""

import inspect

import numpy as np
import pytest

from np_drake import attitude
from np_drake.payload_filter import hook as hook_shift
from np_drake.payload_filter.hook import initial_shift, next_shift, torque_doubt

STEP, NOISE = 0.02, 0.004  # [s], of the torque [N·m]
SHIFT, LEVEL = np.array([0.01, -0.02, 0.015]), np.array([0.02, -0.01, 0.03])  # [m], [N·m]


def run(pull, level, *, shift=SHIFT, noise=NOISE, seed=0):
    """The memory after the torque of pull (n, 3) about a shift, with a level and noise."""
    error = noise * np.random.default_rng(seed).standard_normal(pull.shape)
    memory = initial_shift(STEP)
    for force, torque in zip(pull, np.cross(shift, pull) + level + error, strict=True):
        memory = next_shift(memory, torque, force, np.zeros(3), STEP)
    return memory


def swinging(seconds=20.0):
    """Pull of a payload that swings in both directions (n, 3) [N]."""
    t = STEP * np.arange(round(seconds / STEP))
    return np.column_stack(
        [0.8 * np.sin(3.5 * t), 0.6 * np.cos(3.1 * t), -2.5 + 0.2 * np.sin(7.0 * t)]
    )


def test_a_pull_that_swings_shows_the_shift_and_the_level_beside_it():
    memory = run(swinging(), LEVEL)
    np.testing.assert_allclose(
        memory["shift"], SHIFT, atol=0.002
    )  # 500 samples of noise over 0.6 N [m]
    np.testing.assert_allclose(
        memory["steady"], LEVEL, atol=0.006
    )  # what the shift's error leaves at 2.5 N


def test_a_pull_that_does_not_move_shows_no_shift():
    memory = run(np.tile([0.3, 0.2, -2.5], (1000, 1)), LEVEL)
    assert np.abs(memory["shift"]).max() < 0.001  # [m]
    np.testing.assert_allclose(
        memory["steady"], np.cross(SHIFT, [0.3, 0.2, -2.5]) + LEVEL, atol=0.002
    )


def test_a_torque_that_wanders_is_not_taken_for_the_hooks():
    walk = np.cumsum(0.004 * np.random.default_rng(1).standard_normal((1000, 3)), axis=0)
    assert (
        np.abs(run(swinging(), walk, shift=np.zeros(3))["shift"]).max() < 0.01
    )  # half the prior [m]


def test_where_the_hook_is_that_of_training_the_shift_stays_small():
    assert np.abs(run(swinging(), LEVEL, shift=np.zeros(3))["shift"]).max() < 0.002  # [m]


@pytest.mark.parametrize("noise", [1e-6, 1e-9, 1e-12, 1e-15])
@pytest.mark.parametrize("seed", range(3))
def test_a_constant_torque_almost_without_noise_shows_no_shift(noise, seed):
    t = STEP * np.arange(500)
    pull = np.column_stack(
        [0.8 * np.sin(3.5 * t), 0.0 * t, -2.5 + 0.2 * np.sin(7.0 * t)]
    )  # in a plane
    memory = run(pull, LEVEL, shift=np.zeros(3), noise=noise, seed=seed)
    np.testing.assert_allclose(
        memory["shift"], 0.0, atol=1e-6
    )  # what noise of 1 µN·m leaves at 0.8 N [m]


@pytest.mark.parametrize("noise", [1e-9, 1e-15])
def test_a_torque_almost_without_noise_shows_the_shift(noise):
    memory = run(swinging(), LEVEL, noise=noise)
    np.testing.assert_allclose(memory["shift"], SHIFT, atol=1e-4)  # while the level settled [m]


def test_the_least_noise_is_below_that_of_any_flight(monkeypatch):
    expected = run(swinging(), LEVEL, noise=1e-4)
    regress, named = hook_shift._regress, inspect.signature(hook_shift._regress.py_func).parameters
    at = list(named).index("finest")
    monkeypatch.setattr(hook_shift, "_regress", lambda *a: regress(*a[:at], 0.0, *a[at + 1 :]))
    np.testing.assert_array_equal(run(swinging(), LEVEL, noise=1e-4)["gram"], expected["gram"])


def test_the_doubt_is_the_variance_of_the_torque_about_an_uncertain_hook():
    generator = np.random.default_rng(3)
    root, hook = generator.standard_normal((3, 3)), np.array([0.01, -0.03, 0.02])
    error = generator.standard_normal((200000, 3)) @ root.T
    off = hook + hook_shift.DEVIATION * generator.standard_normal((200000, 3))
    found = torque_doubt(root @ root.T, attitude.skew(hook))
    np.testing.assert_allclose(found, np.cross(off, error).var(axis=0), rtol=0.02)


def test_a_pull_of_which_nothing_is_known_shows_no_shift():
    memory, level = initial_shift(STEP), LEVEL + np.zeros(3)
    for force in swinging():
        memory = next_shift(memory, np.cross(SHIFT, force) + level, force, np.full(3, 1e6), STEP)
    assert np.abs(memory["shift"]).max() < 1e-6  # [m]
