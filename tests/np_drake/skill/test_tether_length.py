import numpy as np
import pytest

from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.training.excitation import motion_near
from np_drake.skill.tether_length import pendulum_length, pendulum_mode
from np_drake.training_data.segments import Segment

STEP, G, LOAD = 0.02, 9.81, 0.26


def hanging(length: float, rates, *, seed: int = 0, n: int = 2000) -> Segment:
    """Force of a payload (small swings, lightly damped) on a hook that moves along x and y at
    `rates` [rad/s].
    """
    generator = np.random.default_rng(seed)
    t, rates = STEP * np.arange(n), np.asarray(rates, float)
    zeta, chi = 0.003 * generator.standard_normal((n, 6)), 0.02 * generator.standard_normal((n, 6))
    chi[:, 2] -= LOAD * G
    for axis in (0, 1):
        phase = rates[:, None] * t + generator.uniform(0, 2 * np.pi, (len(rates), 1))
        zeta[:, axis] += 0.3 * np.sin(phase).sum(axis=0)
        acceleration, swing, speed = 0.3 * (rates[:, None] * np.cos(phase)).sum(axis=0), 0.0, 0.0
        for k in range(n):
            speed += STEP * (-G / length * swing - 0.1 * speed - acceleration[k])
            swing += STEP * speed
            chi[k, axis] += LOAD * G / length * swing
    return Segment(chi, zeta, STEP)


BUSY = 2 * np.pi * np.array([0.17, 0.29, 0.41, 0.53, 0.67, 0.83, 1.1])


def oscillator(frequency: float, damping: float, column: int = 0) -> LiftedLinearSystem:
    """One pair of poles from zeta[column] to f_x, and a slow mode beside it."""
    s = 2 * np.pi * frequency * (-damping / np.sqrt(1 - damping**2) + 1j)
    r, phi = np.exp(STEP * s.real), STEP * s.imag
    A = np.diag([0.0, 0.0, 0.99])
    A[:2, :2] = r * np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])
    B, C = np.zeros((3, 6)), np.zeros((6, 3))
    B[:, column], C[0] = [1.0, 0.0, 3.0], [1.0, 0.0, 1.0]
    return LiftedLinearSystem(A, B, C, STEP)


def test_the_mode_is_the_pair_that_answers_the_velocity():
    mode = pendulum_mode(oscillator(0.56, 0.05))
    assert mode is not None
    assert mode.frequency == pytest.approx(0.56)
    assert mode.damping == pytest.approx(0.05)


def test_a_system_without_oscillation_has_no_pendulum():
    assert (
        pendulum_mode(LiftedLinearSystem(0.9 * np.eye(2), np.zeros((2, 6)), np.zeros((6, 2)), STEP))
        is None
    )


def test_a_system_driven_by_body_rates_is_not_read():
    with pytest.raises(ValueError, match="driven by velocity alone"):
        pendulum_mode(oscillator(0.56, 0.05, column=4))


@pytest.mark.parametrize("length", [0.4, 1.3])
def test_a_payload_on_a_moving_hook_swings_at_its_own_length(length):
    found = pendulum_length([hanging(length, BUSY)])
    assert found.shown
    assert found.length == pytest.approx(length, rel=0.05)
    assert "tether of" in found.text


def test_a_single_circle_does_not_show_it():
    found = pendulum_length([hanging(0.8, [1.5])])
    assert not found.shown
    assert "cannot show the pendulum" in found.text or "no oscillating mode" in found.text


def test_white_noise_moves_as_much_as_noise():
    noise = [np.random.default_rng(0).standard_normal((20_000, 2))]
    assert motion_near(noise, 5.0, step=STEP) == pytest.approx(1.0, rel=0.1)


def test_one_line_alone_is_no_motion_beside_it():
    t = STEP * np.arange(4000)
    noise = 0.01 * np.random.default_rng(0).standard_normal((4000, 2))
    line = np.sin(2 * np.pi * 0.5 * t)[:, None] + noise
    assert motion_near([line], 0.5, step=STEP) < 3.0
    second = line + 0.3 * np.sin(2 * np.pi * 0.57 * t)[:, None]
    assert motion_near([second], 0.5, step=STEP) > 30.0


def test_the_weaker_channel_counts():
    t = STEP * np.arange(4000)[:, None]
    both = 0.01 * np.random.default_rng(0).standard_normal((4000, 2))
    both += np.sin(2 * np.pi * 0.2 * t) + np.sin(2 * np.pi * 0.55 * t) * [1.0, 0.0]
    assert motion_near([both], 0.5, step=STEP) < 3.0
