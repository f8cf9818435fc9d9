"""Laws of the cable's force, against the rate of its length along a motion of both bodies."""

import numpy as np
import pytest

from np_drake import attitude
from systems.cable import cable_force

LENGTH, STIFFNESS, DAMPING = 0.8, 2.0e4, 40.0
HOOK = np.array([0.05, -0.03, -0.1])


def a_state(seed: int, stretch: float) -> np.ndarray:
    """Return a state (26,) with a cable of length L + stretch, both bodies moving and turning."""
    rng = np.random.default_rng(seed)
    q = rng.standard_normal((2, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    p = rng.standard_normal(3)
    n = rng.standard_normal(3)
    n /= np.linalg.norm(n)
    end = p + attitude.rotate(q[0], HOOK) + (LENGTH + stretch) * n
    velocities = rng.standard_normal(12)
    return np.concatenate([q[0], p, q[1], end, velocities])


def span(state: np.ndarray, after: float) -> float:
    """Return the distance of the ends [m] `after` a time of constant velocities."""
    w, v = state[14:17], state[17:20]
    turn = attitude.from_rotation_vector(after * w[None])[0]
    hook = state[4:7] + after * v + attitude.rotate(attitude.multiply(turn, state[0:4]), HOOK)
    return float(np.linalg.norm(state[11:14] + after * state[23:26] - hook))


def force_of(state: np.ndarray, hook: np.ndarray = HOOK) -> np.ndarray:
    force = np.zeros(12)
    cable_force(state, hook, LENGTH, STIFFNESS, DAMPING, force)
    return force


@pytest.mark.parametrize("seed", range(3))
def test_its_power_is_what_spring_and_damper_take(seed):
    # Generalized force and velocity are conjugate: V . tau = -T dl/dt with T = k (l - L) + c dl/dt.
    state, stretch, h = a_state(seed, 0.02), 0.02, 1e-6
    rate = (span(state, h) - span(state, -h)) / (2 * h)
    tension = STIFFNESS * stretch + DAMPING * rate
    assert abs(rate) > 1e-2
    assert force_of(state) @ state[14:26] == pytest.approx(-tension * rate, rel=1e-6)


@pytest.mark.parametrize("seed", range(2))
def test_it_is_internal_to_the_pair_and_pulls_along_the_line(seed):
    state = a_state(seed, 0.01)
    moment, pull, turning, back = force_of(state).reshape(4, 3)
    arm = attitude.rotate(state[0:4], HOOK)
    line = state[11:14] - state[4:7] - arm
    np.testing.assert_allclose(back, -pull, atol=1e-9)
    np.testing.assert_allclose(turning, 0.0)
    np.testing.assert_allclose(moment, np.cross(arm, pull), atol=1e-9)
    np.testing.assert_allclose(np.cross(pull, line), 0.0, atol=1e-9)
    assert pull @ line > 0


def test_a_cable_that_shortens_faster_than_its_spring_pulls_is_slack():
    state = a_state(0, 1e-4)
    line = state[11:14] - state[4:7] - attitude.rotate(state[0:4], HOOK)
    state[14:26] = 0.0
    state[23:26] = -line  # the tension of the spring is 2 N, that of the damper -32 N
    np.testing.assert_array_equal(force_of(state), 0.0)
