import dataclasses as dc

import numpy as np
import pytest

from np_drake.control.tracking_task import TrackingTask, command_span, observe, task_for
from np_drake.references.harmonic import circle
from np_drake.vehicle import Vehicle, load_vehicle, preset_names

TASK, REST = TrackingTask(), np.zeros(4)
TRACK = circle(radius=1.0, height=1.6, speed=1.5, ramp=2.0)


def flat_at(t: float) -> np.ndarray:
    return TRACK.sample(t + np.array([0.0, *TASK.ahead]))


def state(p, v, q=(1.0, 0.0, 0.0, 0.0)) -> np.ndarray:
    return np.concatenate([p, q, v, np.zeros(3)])


def test_the_reward_is_largest_on_the_reference():
    rng = np.random.default_rng(0)
    best = TASK.reward(np.zeros(3), REST)
    assert best == 1.0
    for scale in (1e-3, 0.1, 3.0):  # [m]
        assert TASK.reward(scale * rng.standard_normal(3), REST) < best
    assert TASK.reward(np.zeros(3), np.full(4, 0.1)) < best


def test_an_error_of_the_reach_halves_the_reward():
    assert TASK.reward(np.array([0.0, TASK.reach, 0.0]), REST) == pytest.approx(0.5)


def test_the_reward_falls_with_the_error():
    rewards = [TASK.reward(np.array([d, 0.0, 0.0]), REST) for d in np.linspace(0, 2, 50)]
    assert np.all(np.diff(rewards) < 0)


def test_a_full_action_costs_the_effort():
    assert TASK.reward(np.zeros(3), np.array([1.0, -1.0, 1.0, -1.0])) == pytest.approx(1 - TASK.effort)


def test_on_the_reference_both_errors_vanish():
    flat = flat_at(3.0)
    seen = observe(state(flat[0, 0], flat[1, 0]), flat)
    np.testing.assert_allclose(seen[:6], 0.0, atol=1e-12)  # rounding [m, m/s]
    np.testing.assert_allclose(seen[18:].reshape(-1, 3), flat[0, 1:] - flat[0, 0])


def test_the_heading_of_world_axes_does_not_matter():
    half = 0.35  # of the turn about z [rad]
    turn = np.array(
        [[np.cos(2 * half), -np.sin(2 * half), 0.0], [np.sin(2 * half), np.cos(2 * half), 0.0], [0.0, 0.0, 1.0]]
    )
    flat, p, v = flat_at(3.0), np.array([0.5, 0.2, 1.5]), np.array([0.3, -1.0, 0.1])
    turned = observe(state(turn @ p, turn @ v, (np.cos(half), 0, 0, np.sin(half))), flat @ turn.T)
    own = [*range(9), *range(15, TASK.observation_size)]  # all but the attitude
    np.testing.assert_allclose(turned[own], observe(state(p, v), flat)[own], atol=1e-12)  # rounding


def test_the_attitude_is_two_columns_of_the_rotation():
    seen = observe(state(np.zeros(3), np.zeros(3), (np.sqrt(0.5), 0, 0, np.sqrt(0.5))), flat_at(0.0))
    np.testing.assert_allclose(seen[9:15], [0, 1, 0, -1, 0, 0], atol=1e-12)  # a quarter turn about z


@pytest.mark.parametrize("name", preset_names())
def test_an_action_along_one_axis_is_never_saturated_and_a_larger_one_is(name):
    vehicle = load_vehicle(name)
    span = command_span(vehicle)
    for u in np.concatenate([np.diag(span), -np.diag(span)]):
        command = vehicle.hover_input + u
        np.testing.assert_allclose(vehicle.saturate(command), command, atol=1e-9)  # rounding [N, N·m]
    for i in range(4):
        more = [vehicle.hover_input + sign * 1.01 * span[i] * np.eye(4)[i] for sign in (-1, 1)]
        assert any(np.abs(vehicle.saturate(u) - u).max() > 1e-6 for u in more)


def test_the_task_scales_with_the_vehicle():
    assert task_for(Vehicle()) == TASK
    small = task_for(load_vehicle("crazyflie"))
    assert small.reach < 0.5 * TASK.reach
    assert max(small.ahead) < max(TASK.ahead)


@pytest.mark.parametrize(
    "field, value", [("reach", 0.0), ("tolerance", np.inf), ("effort", -1.0), ("ahead", (0.1, -0.1))]
)
def test_an_impossible_task_is_refused(field, value):
    with pytest.raises(ValueError, match=field):
        dc.replace(TASK, **{field: value}).check()
