"""Laws of the pendulum: its length stays, its energy stays without damping, and it agrees with the library's."""

import numpy as np
import pytest

from diagrams.challenge.real.pendulum_path import DAMPING, hanging, path
from np_drake.effects.pendulum import swing_many

LENGTH, GRAVITY, STEP = 0.5, 9.81, 0.004
STILL = np.zeros((2000, 3))
SIDE = hanging(np.array([[0.2, 0.1]]), np.array([[0.3, -0.5]]), LENGTH)


def energy(r: np.ndarray) -> np.ndarray:
    v = (r[2:] - r[:-2]) / (2 * STEP)
    return 0.5 * np.sum(v**2, axis=-1) + GRAVITY * r[1:-1, ..., 2]


def test_a_taut_tether_keeps_its_length():
    r, _ = path(*SIDE, STILL, STEP, length=LENGTH, gravity=GRAVITY)
    assert np.abs(np.linalg.norm(r, axis=-1) - LENGTH).max() < 1e-9  # m, rounding


def test_energy_stays_without_damping_and_falls_with_it():
    r, _ = path(*SIDE, STILL, STEP, length=LENGTH, gravity=GRAVITY, damping=0.0)
    assert np.ptp(energy(r)) < 2e-3  # m²/s², of 0.7 above rest: second order in the step
    r, _ = path(*SIDE, STILL, STEP, length=LENGTH, gravity=GRAVITY)
    swing = energy(r) + GRAVITY * LENGTH
    assert swing[-200:].mean() / swing[:200].mean() == pytest.approx(np.exp(-DAMPING * 7.2), rel=0.1)


def test_the_pull_is_that_of_the_library():
    t = STEP * np.arange(len(STILL))
    a_hook = np.stack([2 * np.sin(3 * t + k) for k in range(3)], axis=1)
    _, pull = path(*SIDE, a_hook, STEP, length=LENGTH, gravity=GRAVITY, damping=0.0)
    theirs = swing_many(np.array([LENGTH]), *SIDE, a_hook, STEP, GRAVITY)
    assert np.abs(pull - theirs).max() < 5e-3  # m/s², of 20


def test_a_payload_hangs_still_and_pulls_by_its_weight():
    r, pull = path(
        *hanging(np.zeros((1, 2)), np.zeros((1, 2)), LENGTH), STILL, STEP, length=LENGTH, gravity=GRAVITY
    )
    assert np.allclose(r, [0.0, 0.0, -LENGTH])
    assert np.allclose(pull, [0.0, 0.0, -GRAVITY])


def test_under_a_falling_hook_the_tether_is_slack_and_does_not_push():
    r, pull = path(*SIDE, STILL[:50] - [0.0, 0.0, 3 * GRAVITY], STEP, length=LENGTH, gravity=GRAVITY)
    assert np.all(pull[..., 2] <= 0)
    assert np.linalg.norm(r, axis=-1).max() <= LENGTH + 1e-9


def test_many_lengths_at_once_are_each_its_own():
    lengths = np.array([0.3, 0.8])
    start = hanging(np.full((2, 2), 0.1), np.zeros((2, 2)), lengths)
    both, _ = path(*start, STILL[:300], STEP, length=lengths, gravity=GRAVITY)
    for i, length in enumerate(lengths):
        one, _ = path(
            start[0][i : i + 1], start[1][i : i + 1], STILL[:300], STEP, length=length, gravity=GRAVITY
        )
        assert np.allclose(both[:, i], one[:, 0])
