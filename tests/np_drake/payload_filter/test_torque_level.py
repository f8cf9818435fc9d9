"""Laws of the level of the torque that nothing else explains."""

import numpy as np
import pytest

from np_drake.payload_filter.hook import LONGEST_MEAN, gains_of, initial_shift, next_shift

STEP = 0.02  # [s]


def levels(torque):
    """The level after every row of torque (n, 3), under no pull."""
    memory, found = initial_shift(STEP), []
    for row in torque:
        memory = next_shift(memory, row, np.zeros(3), np.zeros(3), STEP)
        found.append(memory["steady"])
    return np.array(found)


def test_a_constant_torque_under_noise_is_averaged():
    noise = 0.002 * np.random.default_rng(0).standard_normal((500, 3))  # [N·m]
    error = levels(0.01 + noise)[250:] - 0.01
    assert (
        np.sqrt(np.mean(error**2)) < 0.2 * 0.002
    )  # the mean of 250 and more has 0.06 of the noise at most


def test_a_torque_that_wanders_without_noise_is_followed_at_once():
    walk = np.cumsum(np.random.default_rng(1).standard_normal((500, 3)), axis=0)
    error = levels(walk)[100:] - walk[100:]
    assert np.sqrt(np.mean(error**2)) < 0.1  # of the walk's step


def test_each_axis_has_a_level_of_its_own_kind():
    draw = np.random.default_rng(2).standard_normal((500, 3))
    torque = np.column_stack([np.cumsum(draw[:, 0]), draw[:, 1], np.zeros(500)])
    found = levels(torque)[250:]
    assert np.abs(found[:, 0] - torque[250:, 0]).max() < 0.5 * np.abs(draw[:, 0]).max()
    assert np.abs(found[:, 1]).max() < 0.4
    assert not found[:, 2].any()


def test_the_level_scales_with_the_torque():
    torque = np.cumsum(np.random.default_rng(3).standard_normal((200, 3)), axis=0)
    torque += np.random.default_rng(4).standard_normal((200, 3))
    np.testing.assert_allclose(levels(1e-6 * torque), 1e-6 * levels(torque), rtol=1e-9)


@pytest.mark.parametrize("step", [0.0025, 0.02, 20.0])
def test_the_gains_reach_from_persistence_to_the_longest_mean(step):
    gains = gains_of(step)[:, 0]
    assert gains[0] == pytest.approx(1.0)
    assert gains[-1] == pytest.approx(min(1.0, step / LONGEST_MEAN))
    assert np.all(gains[1:] >= 0.5 * gains[:-1] - 1e-12)
