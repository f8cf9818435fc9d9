import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.horizon import TerminalWeight, hover_solution

HOVER = np.array([1.0, 0.0, 0.0, 0.0])


def terminal_weight(vehicle, config, q_ref):
    F = TerminalWeight(vehicle, config).factor(q_ref)
    return F.T @ F


def test_the_riccati_weight_is_the_cost_to_go_of_its_feedback(vehicle, config):
    P, gain = hover_solution(vehicle, config)
    x = np.zeros((1, 13))
    x[0, 3] = 1.0
    model = DiscreteDynamics(vehicle, config.step).linearise(
        x, vehicle.hover_input[None], np.zeros((1, 6))
    )
    A, B = model.Fx[0][:, :13], model.Fu[0]
    e = np.array([0.1, -0.2, 0.1, 0.0, 0.01, 0.02, 0.03, 0.2, 0.1, 0.0, 0.1, 0.2, 0.1])
    expected, total = e @ P @ e, 0.0
    for _ in range(2000):
        u = -gain @ e
        total += e**2 @ config.Q + u**2 @ config.R
        e = A @ e + B @ u
    assert total == pytest.approx(expected, rel=1e-6)


def test_the_weight_turns_with_the_heading_of_the_reference(vehicle, config):
    turn = attitude.quaternion_from_axes(np.array([0.0, 0.0, 1.0]), 2.0)
    e = np.array([0.3, -0.1, 0.2, 0.0, 0.05, -0.02, 0.01, 0.4, 0.3, -0.2, 0.1, 0.2, 0.3])
    turned = e.copy()
    turned[0:3], turned[7:10] = attitude.rotate(turn, e[0:3]), attitude.rotate(turn, e[7:10])
    turned[3:7] = attitude.multiply(turn, e[3:7])
    cost = turned @ terminal_weight(vehicle, config, turn) @ turned
    assert cost == pytest.approx(e @ terminal_weight(vehicle, config, HOVER) @ e, rel=1e-9)


def test_the_scaled_weight_is_a_multiple_of_q(vehicle, config):
    scaled = dc.replace(config, terminal="scaled", terminal_scale=3.0)
    P = terminal_weight(vehicle, scaled, HOVER)
    np.testing.assert_allclose(np.diag(P)[:3], 3.0 * config.Q[:3])
    np.testing.assert_allclose(np.diag(P)[3:7], config.Q[3:7])


def test_an_unknown_terminal_weight_is_refused(config):
    with pytest.raises(ValueError, match="riccati"):
        dc.replace(config, terminal="best").check()


def test_without_a_weight_on_heading_the_equation_still_has_a_solution(vehicle, config):
    lazy = dc.replace(config, weight_attitude=[0.0] * 4, weight_rate=[0.0] * 3).check()
    assert np.isfinite(terminal_weight(vehicle, lazy, HOVER)).all()
