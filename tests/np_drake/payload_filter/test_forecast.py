"""Laws of the payload filter's forecast along a plan, against the pendulum of the effects."""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.effects.pendulum import hook_velocity, swing_many
from np_drake.payload_filter.forecast import Carrier, Timing, along_plan, beside_plan, drives
from np_drake.payload_filter.kernel import (
    DAMPING,
    DRAG,
    LOG_LENGTH,
    MASS,
    POINT,
    PUSH,
    THRUST_ERROR,
)

N, STEP, STRIDE, GRAVITY, VEHICLE_MASS = 8, 0.05, 5, 9.81, 2.0
HOOK = np.array([0.04, -0.03, -0.1])
MEAN_DECAY, DECAY = 0.6, 0.3
STEADY, RATE_TORQUE = np.array([0.01, -0.02, 0.005]), np.array([-0.01, -0.02, 0.03])
SPEED_TORQUE = np.array([0.02, 0.05])
CARRIER = Carrier(HOOK, VEHICLE_MASS, GRAVITY, STEADY, RATE_TORQUE, SPEED_TORQUE)


def members(seed: int, count: int) -> np.ndarray:
    """Return points (count, POINT): tethers that lean, swing, and differ in every parameter."""
    rng = np.random.default_rng(seed)
    points = np.zeros((count, POINT))
    for p in points:
        r = np.array([*rng.uniform(-0.4, 0.4, 2), -1.0])
        r /= np.linalg.norm(r)
        across = np.cross(r, rng.standard_normal(3))
        p[0:3], p[3:6], p[6:8] = r, across / np.linalg.norm(across), rng.uniform(-1, 1, 2)
        p[MASS] = rng.uniform(0.05, 0.2)
        p[LOG_LENGTH] = np.log(rng.uniform(0.5, 1.2))
        p[DAMPING], p[DRAG] = rng.uniform(0, 0.5), 0.15
        p[PUSH : PUSH + 3], p[THRUST_ERROR] = rng.uniform(-0.2, 0.2, 3), rng.uniform(-0.1, 0.1)
    return points


def plan(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(100 + seed)
    x = np.cumsum(0.1 * rng.standard_normal((N + 1, 13)), axis=0)
    x[:, 3:7] = attitude.from_rotation_vector(
        np.cumsum(0.1 * rng.standard_normal((N + 1, 3)), axis=0)
    )
    return x, np.array([20.0, 0, 0, 0]) + rng.standard_normal((N, 4)) * [2.0, 0.1, 0.1, 0.05]


def forecast_of(points, weight, x, u, acting) -> np.ndarray:
    timing = Timing(STEP, STRIDE, MEAN_DECAY, DECAY)
    return along_plan(points, weight, x, u, acting, CARRIER, timing)


def pulls_of(points, weight, x) -> np.ndarray:
    """Return the mean pull (N, 3) over each step [N] of pendulums that the plan's hook drives."""
    v = hook_velocity(HOOK, x)
    share = (np.arange(STRIDE) + 0.5)[:, None] / STRIDE
    fine = np.concatenate([v[i] + share * (v[i + 1] - v[i]) for i in range(N)])
    a = np.repeat(np.diff(v, axis=0) / STEP, STRIDE, axis=0)
    length = np.exp(points[:, LOG_LENGTH])
    r, across = points[:, 0:3], points[:, 3:6]
    rate = points[:, 6:7] * across + points[:, 7:8] * np.cross(r, across)
    start, options = length[:, None], {"damping": points[:, DAMPING], "v_hook": fine}
    pull = swing_many(length, start * r, start * rate, a, STEP / STRIDE, GRAVITY, **options)
    pull = np.einsum("nmk,m->nk", pull, weight * points[:, MASS] * VEHICLE_MASS)
    return pull.reshape(N, STRIDE, 3).mean(axis=1)


@pytest.mark.parametrize("seed", range(2))
def test_along_a_plan_it_is_tether_thrust_error_push_drag_and_torques(seed):
    points, weight = members(seed, 3), np.array([0.5, 0.3, 0.2])
    (x, u), acting = plan(seed), np.array([17.0, 0.1, -0.2, 0.05])
    mean = weight @ points
    q = x[1:, 3:7] + x[:-1, 3:7]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    lag, behind = np.zeros((N, 4)), acting
    for i in range(N):
        lag[i], behind = MEAN_DECAY * (behind - u[i]), u[i] + DECAY * (behind - u[i])
    pull = pulls_of(points, weight, x)
    force = pull + VEHICLE_MASS * (
        mean[PUSH : PUSH + 3] - mean[DRAG] * 0.5 * (x[1:, 7:10] + x[:-1, 7:10])
    )
    error = mean[THRUST_ERROR]
    force += ((1 + error) * lag[:, :1] + error * u[:, :1]) * attitude.body_z(q)
    v = attitude.rotate_back(x[:, 3:7], x[:, 7:10])
    ends = RATE_TORQUE * x[:, 10:13]
    ends[:, 0] += SPEED_TORQUE[0] * v[:, 1]
    ends[:, 1] += SPEED_TORQUE[1] * v[:, 0]
    torque = (
        np.cross(HOOK, attitude.rotate_back(q, pull))
        + lag[:, 1:]
        + STEADY
        + 0.5 * (ends[1:] + ends[:-1])
    )
    dut = forecast_of(points, weight, x, u, acting)
    np.testing.assert_allclose(dut, np.concatenate([force, torque], axis=1), atol=1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_beside_a_plan_the_lifted_system_along_it_gives_the_same_wrench(seed):
    points, weight = members(seed, 2), np.array([0.4, 0.6])
    x, u = plan(seed)
    along = forecast_of(points, weight, x, u, u[0])
    mean = weight @ points
    A, B, C, steady = beside_plan(mean, x, CARRIER, STEP, along)
    z, again = np.zeros(4), np.zeros((N, 6))
    for i in range(N):
        again[i] = steady[i] + C @ z
        z = A @ z + B @ np.concatenate([x[i, 7:10], x[i, 10:13]])
    np.testing.assert_allclose(again, along, atol=1e-12)
    pull = VEHICLE_MASS * mean[MASS] * GRAVITY / np.exp(mean[LOG_LENGTH])
    np.testing.assert_allclose(C[:3], [[pull, 0, 0, 0], [0, pull, 0, 0], [0, 0, 0, 0]])
    lateral = attitude.rotate_back(x[0, 3:7], np.eye(3)[:2])
    np.testing.assert_allclose(C[3:, :2].T, pull * np.cross(HOOK, lateral), atol=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_what_drives_a_pendulum_is_thrust_and_the_motion_of_its_hook(seed):
    x, _ = plan(seed)
    before, now = x[0], x[1]
    drive, end = drives(before, now, HOOK, 9.0, 10.0, STEP)
    z, v = attitude.body_z(x[:2, 3:7]), hook_velocity(HOOK, x[:2])
    turning = v - x[:2, 7:10]
    np.testing.assert_allclose(
        drive, [*(9.0 * z.mean(axis=0)), *v.mean(axis=0), *(np.diff(turning, axis=0)[0] / STEP)]
    )
    np.testing.assert_allclose(end, [*(10.0 * z[1]), *v[1], *(np.diff(turning, axis=0)[0] / STEP)])
