"""Compiled forecast of a bank of pendulums along a planned motion, and what drives a pendulum
between two samples.
"""

import math
from typing import NamedTuple

import numpy as np

from np_drake.compiled import compiled, turned
from np_drake.effects.pendulum import leapfrog
from np_drake.payload_filter.kernel import (
    DAMPING,
    DRAG,
    LOG_LENGTH,
    MASS,
    PUSH,
    THRUST_ERROR,
    tether_rate,
)


@compiled
def drives(before, x, hook, over_step, now, step):
    """Return what moves a pendulum over a step (9,) and at its end (9,), as of
    `kernel.filter_bank`.

    Args:
        before: (13,) state at the step's start.
        x: (13,) at its end.
        hook: (3,) p_BoTo_B [m].
        over_step: mean collective thrust of the step, per mass [m/s²].
        now: that at its end [m/s²].
        step: [s].
    """
    drive = np.empty(9)
    end = np.empty(9)
    first = np.zeros(3)
    last = np.zeros(3)
    z = np.zeros(3)
    z_last = np.zeros(3)
    _turning(before, hook, first)
    _turning(x, hook, last)
    _body_z(before[3], before[4], before[5], before[6], z)
    _body_z(x[3], x[4], x[5], x[6], z_last)
    for k in range(3):
        drive[k] = over_step * 0.5 * (z[k] + z_last[k])
        end[k] = now * z_last[k]
        v = before[7 + k] + first[k]
        v_last = x[7 + k] + last[k]
        drive[3 + k] = 0.5 * (v + v_last)
        end[3 + k] = v_last
        drive[6 + k] = end[6 + k] = (last[k] - first[k]) / step
    return drive, end


class Carrier(NamedTuple):
    """What a forecast takes from the vehicle under which the payload hangs."""

    hook: np.ndarray  # (3,) p_BoTo_B [m]
    mass: float  # [kg]
    gravity: float  # [m/s²]
    steady: np.ndarray  # (3,) torque [N·m]
    rate_torque: np.ndarray  # (3,) torque over body rates [N·m·s]
    speed_torque: np.ndarray  # (2,) over velocity [N·s]


class Timing(NamedTuple):
    """Steps of a plan, and what the rotors' lag makes of them."""

    step: float  # of the plan [s]
    stride: int  # of the pendulum's steps in it [1]
    mean_decay: float  # share of a difference that the lag leaves over a step [1]
    decay: float  # at its end [1]


@compiled
def along_plan(points, weight, x, u, acting, carrier, timing):
    """Return the wrench (N, 6) along a plan, the mean of all members over each of its steps [N,
    N·m].

    Args:
        points: (k, POINT) of the members.
        weight: (k,) of each [1].
        x: (N+1, 13) of the plan.
        u: (N, 4) of the plan [N, N·m].
        acting: (4,) wrench of the rotors now [N, N·m].
        carrier: `Carrier`.
        timing: `Timing`.
    """
    n = len(u)
    wrench = np.empty((n, 6))
    mean = np.zeros(points.shape[1])
    for i in range(len(points)):
        mean += weight[i] * points[i]
    pull = _pulls(points, weight, x, carrier, timing)
    z = np.zeros(3)
    behind = acting.copy()
    error = mean[THRUST_ERROR]
    for i in range(n):
        q = x[i, 3:7] + x[i + 1, 3:7]
        q /= math.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
        missing = behind - u[i]
        lag = timing.mean_decay * missing
        behind = u[i] + timing.decay * missing
        _body_z(q[0], q[1], q[2], q[3], z)
        thrust = (1.0 + error) * lag[0] + error * u[i, 0]
        drag = 0.5 * mean[DRAG] * (x[i, 7:10] + x[i + 1, 7:10])
        wrench[i, :3] = carrier.mass * (pull[i] + mean[PUSH : PUSH + 3] - drag) + thrust * z
        _hook_torque(q, carrier.hook, carrier.mass * pull[i], wrench[i])
        start = motion_torque(x[i], carrier.rate_torque, carrier.speed_torque)
        end = motion_torque(x[i + 1], carrier.rate_torque, carrier.speed_torque)
        wrench[i, 3:] += lag[1:] + carrier.steady + 0.5 * (start + end)
    return wrench


@compiled
def motion_torque(state, rate_torque, speed_torque):
    """Return the torque of body rates and velocity, (3,) in B [N·m].

    Args:
        state: (13,).
        rate_torque: (3,) [N·m·s].
        speed_torque: (2,) [N·s].
    """
    v = turned(state[3], -state[4], -state[5], -state[6], state[7], state[8], state[9])
    out = rate_torque * state[10:13]
    out[0] += speed_torque[0] * v[1]
    out[1] += speed_torque[1] * v[0]
    return out


@compiled
def _pulls(points, weight, x, carrier, timing):
    """Return the mean pull of the tethers over each step of a plan, (N, 3) [m/s²]."""
    n = len(x) - 1
    members = len(points)
    fine = timing.step / timing.stride
    kicks = np.zeros((n * timing.stride, 3, 1))
    drift = np.zeros((n * timing.stride, 3, 1))
    _hook_motion(x, carrier, timing, kicks, drift)
    limit = np.zeros(members)
    half = np.zeros(members)
    now = np.zeros((3, members))
    move = np.zeros((3, members))
    for i in range(members):
        limit[i] = math.exp(points[i, LOG_LENGTH]) ** 2
        half[i] = 0.5 * fine * max(points[i, DAMPING], 0.0)
        _begin(points[i], fine, now[:, i], move[:, i])
    pulls = np.empty((n * timing.stride, 3, members))
    # Leapfrog of all members, the tether's length kept by projection at every step
    leapfrog(limit, half, now, move, kicks, drift, pulls)
    mean_pull = np.zeros((n, 3))
    for i in range(members):
        share = weight[i] * points[i, MASS] / (fine**2 * timing.stride)
        for row in range(n * timing.stride):
            mean_pull[row // timing.stride] += share * pulls[row, :, i]
    return mean_pull


@compiled
def _hook_motion(x, carrier, timing, kicks, drift):
    """Write what the hook's acceleration and velocity do in each fine step of a plan, (n, 3, 1)
    each [m], as `leapfrog` takes them.
    """
    n = len(x) - 1
    fine = timing.step / timing.stride
    v = np.zeros((n + 1, 3))
    turn = np.zeros(3)
    fall = np.array([0.0, 0.0, carrier.gravity])
    for i in range(n + 1):
        _turning(x[i], carrier.hook, turn)
        v[i] = x[i, 7:10] + turn
    for i in range(n):
        change = v[i + 1] - v[i]
        for j in range(timing.stride):
            row = i * timing.stride + j
            kicks[row, :, 0] = -(fine**2) * (change / timing.step + fall)
            drift[row, :, 0] = fine * (v[i] + (j + 0.5) / timing.stride * change)


@compiled
def _begin(point, fine, now, move):
    """Write the position half a fine step later, within reach, and the displacement per step, (3,)
    each [m].
    """
    length = math.exp(point[LOG_LENGTH])
    rate = tether_rate(point)
    square = 0.0
    for k in range(3):
        move[k] = fine * length * rate[k]
        now[k] = length * point[k] + 0.5 * move[k]
        square += now[k] * now[k]
    reach = min(1.0, length / math.sqrt(square))
    for k in range(3):
        now[k] = reach * now[k]


@compiled
def _body_z(w, x, y, z, out):
    out[0] = 2 * (x * z + w * y)
    out[1] = 2 * (y * z - w * x)
    out[2] = w * w - x * x - y * y + z * z


@compiled
def _turning(state, hook, out):
    """Write the velocity of the hook about Bo, in W [m/s]."""
    p = state[10]
    q = state[11]
    r = state[12]
    a = q * hook[2] - r * hook[1]
    b = r * hook[0] - p * hook[2]
    c = p * hook[1] - q * hook[0]
    out[0], out[1], out[2] = turned(state[3], state[4], state[5], state[6], a, b, c)


@compiled
def _hook_torque(q, hook, force, out):
    """Write the torque of a force in W at the hook into out[3:6], in B."""
    f_x, f_y, f_z = turned(q[0], -q[1], -q[2], -q[3], force[0], force[1], force[2])
    out[3] = hook[1] * f_z - hook[2] * f_y
    out[4] = hook[2] * f_x - hook[0] * f_z
    out[5] = hook[0] * f_y - hook[1] * f_x


@compiled
def beside_plan(mean, x, carrier, step, along):
    """Return A (4, 4), B (4, 6) and C (6, 4) of the pendulum for what departs from the plan, and
    the wrench along it (N, 6) without what the pendulum makes of the planned velocity [N, N·m].

    Args:
        mean: (POINT,) of the members.
        x: (N+1, 13) of the plan.
        carrier: `Carrier`.
        step: of the plan [s].
        along: (N, 6) wrench along the plan [N, N·m].
    """
    stiffness = carrier.gravity / math.exp(mean[LOG_LENGTH])
    A, B, gain = linear_pendulum(stiffness, max(mean[DAMPING], 0.0), step)
    C = np.zeros((6, 4))
    out = along.copy()
    for k in range(2):
        C[k, k] = carrier.mass * max(mean[MASS], 0.0) * stiffness
        _hook_torque(x[0, 3:7], carrier.hook, C[:3, k], C[:, k])
    z = np.zeros(4)
    nxt = np.zeros(4)
    for i in range(1, len(out)):
        for j in range(4):
            nxt[j] = gain[j] * x[i - 1, 7 + j % 2]
            for k in range(4):
                nxt[j] += A[j, k] * z[k]
        z[:] = nxt
        for j in range(6):
            for k in range(4):
                out[i, j] -= C[j, k] * z[k]
    return A, B, C, out


@compiled
def linear_pendulum(stiffness, damping, step):
    """Return A (4, 4), B (4, 6) and its gain (4,) of v, of z = [r_x, r_y, s_x, s_y] under a
    velocity held over `step`.

    r' = s - v, s' = -stiffness r - damping s.   Closed form of the matrix exponential.

    Args:
        stiffness: g / L [1/s²].
        damping: [1/s]; no more than the critical one counts.
        step: [s].
    """
    half = min(0.5 * damping, 0.99 * math.sqrt(stiffness))
    rate = math.sqrt(stiffness - half**2)
    near = math.exp(-half * step) * math.cos(rate * step)
    side = math.exp(-half * step) * math.sin(rate * step) / rate
    a = np.array([[near + half * side, side], [-stiffness * side, near - half * side]])
    # M^-1 [-1, 0] of M = [[0, 1], [-stiffness, -2 half]]
    settled = np.array([2 * half / stiffness, -1.0])
    gain = a @ settled - settled
    A = np.zeros((4, 4))
    B = np.zeros((4, 6))
    for k in range(2):
        A[k::2, k::2] = a
        B[k::2, k] = gain
    return A, B, np.repeat(gain, 2)
