"""Laws of the hook's place and of the level of the torque, as they are estimated in flight."""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.payload_filter import hook
from np_drake.payload_filter.hook import initial_shift, next_shift, torque_doubt

STEP, NOISE = 0.02, 0.004  # [s], of the torque [N·m]
SHIFT, LEVEL = np.array([0.01, -0.02, 0.015]), np.array([0.02, -0.01, 0.03])  # [m], [N·m]
NONE, T = np.zeros(3), STEP * np.arange(1000)
# Pull of a payload that swings in both directions, in one, and that hangs still [N]
SWINGING = np.column_stack(
    [0.8 * np.sin(3.5 * T), 0.6 * np.cos(3.1 * T), -2.5 + 0.2 * np.sin(7.0 * T)]
)
PLANAR, STILL = SWINGING * [1.0, 0.0, 1.0], np.tile([0.3, 0.2, -2.5], (1000, 1))
WALK = np.cumsum(np.random.default_rng(1).standard_normal((1000, 3)), axis=0)


def run(pull=SWINGING, level=LEVEL, *, shift=SHIFT, noise=NOISE, seed=0, doubt=0.0):
    """The memory after the torque of pull (n, 3) about a shift, with a level and noise."""
    error = noise * np.random.default_rng(seed).standard_normal(pull.shape)
    memory = initial_shift(STEP)
    for force, torque in zip(pull, np.cross(shift, pull) + level + error, strict=True):
        memory = next_shift(memory, torque, force, np.full(3, doubt), STEP)
    return memory


def test_a_pull_that_swings_shows_the_shift_and_the_level_beside_it():
    memory = run()
    # 500 samples of noise over 0.6 N [m]; what the shift's error leaves at 2.5 N
    np.testing.assert_allclose(memory["shift"], SHIFT, atol=0.002)
    np.testing.assert_allclose(memory["steady"], LEVEL, atol=0.006)
    for noise in (1e-9, 1e-15):  # while the level settled [m]
        np.testing.assert_allclose(run(noise=noise)["shift"], SHIFT, atol=1e-4)


def test_a_pull_that_does_not_move_shows_no_shift():
    memory = run(STILL)
    assert np.abs(memory["shift"]).max() < 0.001  # [m]
    expected = np.cross(SHIFT, STILL[0]) + LEVEL
    np.testing.assert_allclose(memory["steady"], expected, atol=0.002)


NO_SHIFT = {  # [m]
    "a hook where it was in training": (0.002, {}),
    "a torque that wanders, of the prior's half": (0.01, {"level": 0.004 * WALK}),
    "a pull of which nothing is known": (1e-6, {"shift": SHIFT, "noise": 0.0, "doubt": 1e6}),
}


@pytest.mark.parametrize("what", NO_SHIFT)
def test_what_is_not_the_hooks_shows_no_shift(what):
    most, options = NO_SHIFT[what]
    assert np.abs(run(**{"shift": NONE} | options)["shift"]).max() < most


@pytest.mark.parametrize("noise", [1e-6, 1e-12, 1e-15])
@pytest.mark.parametrize("seed", range(2))
def test_a_constant_torque_almost_without_noise_shows_no_shift(noise, seed):
    memory = run(PLANAR[:500], shift=NONE, noise=noise, seed=seed)
    # What noise of 1 µN·m leaves at 0.8 N [m]
    np.testing.assert_allclose(memory["shift"], 0.0, atol=1e-6)


def test_the_doubt_is_the_variance_of_the_torque_about_an_uncertain_hook():
    generator = np.random.default_rng(3)
    root, place = generator.standard_normal((3, 3)), np.array([0.01, -0.03, 0.02])
    error = generator.standard_normal((40000, 3)) @ root.T
    off = place + hook.DEVIATION * generator.standard_normal((40000, 3))
    found = torque_doubt(root @ root.T, attitude.skew(place))
    np.testing.assert_allclose(found, np.cross(off, error).var(axis=0), rtol=0.05)


def levels(torque):
    """The level after every row of torque (n, 3), under no pull."""
    memory, found = initial_shift(STEP), []
    for row in torque:
        memory = next_shift(memory, row, NONE, NONE, STEP)
        found.append(memory["steady"])
    return np.array(found)


def test_each_axis_has_a_level_of_its_own_kind():
    """A walk without noise is followed at once, noise is averaged, and nothing is nothing."""
    noise = np.random.default_rng(2).standard_normal(500)
    torque = np.column_stack([WALK[:500, 0], 5.0 + noise, np.zeros(500)])
    error = (levels(torque) - torque)[100:]
    assert np.sqrt(np.mean(error[:, 0] ** 2)) < 0.1  # of the walk's step
    found = levels(torque)[250:]
    # The mean of 250 and more has 0.06 of the noise at most
    assert np.sqrt(np.mean((found[:, 1] - 5.0) ** 2)) < 0.2
    assert not found[:, 2].any()
    np.testing.assert_allclose(levels(1e-6 * torque), 1e-6 * levels(torque), rtol=1e-9)
