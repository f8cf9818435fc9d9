"""Laws of the hook's place as it is estimated in flight."""

import numpy as np

from np_drake.residual_models.hook_shift import initial_shift, next_shift

STEP, NOISE = 0.02, 0.004  # [s], of the torque [N·m]
SHIFT, LEVEL = np.array([0.01, -0.02, 0.015]), np.array([0.02, -0.01, 0.03])  # [m], [N·m]


def run(pull, level, *, shift=SHIFT, seed=0):
    """The memory after the torque of pull (n, 3) about a shift, with a level and noise."""
    noise = NOISE * np.random.default_rng(seed).standard_normal(pull.shape)
    memory = initial_shift(STEP)
    for force, torque in zip(pull, np.cross(shift, pull) + level + noise, strict=True):
        memory = next_shift(memory, torque, force, STEP)
    return memory


def swinging(seconds=20.0):
    """Pull of a payload that swings in both directions (n, 3) [N]."""
    t = STEP * np.arange(round(seconds / STEP))
    return np.column_stack([0.8 * np.sin(3.5 * t), 0.6 * np.cos(3.1 * t), -2.5 + 0.2 * np.sin(7.0 * t)])


def test_a_pull_that_swings_shows_the_shift_and_the_level_beside_it():
    memory = run(swinging(), LEVEL)
    np.testing.assert_allclose(memory["shift"], SHIFT, atol=0.002)  # 500 samples of noise over 0.6 N [m]
    np.testing.assert_allclose(memory["steady"], LEVEL, atol=0.006)  # what the shift's error leaves at 2.5 N


def test_a_pull_that_does_not_move_shows_no_shift():
    memory = run(np.tile([0.3, 0.2, -2.5], (1000, 1)), LEVEL)
    assert np.abs(memory["shift"]).max() < 0.001  # [m]
    np.testing.assert_allclose(memory["steady"], np.cross(SHIFT, [0.3, 0.2, -2.5]) + LEVEL, atol=0.002)


def test_a_torque_that_wanders_is_not_taken_for_the_hooks():
    walk = np.cumsum(0.004 * np.random.default_rng(1).standard_normal((1000, 3)), axis=0)
    assert np.abs(run(swinging(), walk, shift=np.zeros(3))["shift"]).max() < 0.01  # half the prior [m]


def test_where_the_hook_is_that_of_training_the_shift_stays_small():
    assert np.abs(run(swinging(), LEVEL, shift=np.zeros(3))["shift"]).max() < 0.002  # [m]
