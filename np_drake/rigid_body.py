"""Rigid-body dynamics of equation (1) of the paper, forward and inverse.

State x (13,) = [p_WB, q_WB (w, x, y, z), v_WB, w_WB_B]; input u (4,) = [f_u, tau_m] as commanded;
residual wrench chi (6,) = [f_e in W (N), tau_e in B (N·m)]. All functions are vectorised over
leading axes.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from np_drake import attitude
from np_drake.compiled import compiled, times
from np_drake.vehicle import Vehicle

# parts of the state
P = slice(0, 3)
Q = slice(3, 7)
V = slice(7, 10)
W = slice(10, 13)
# of x, u and chi [1]
STATE_SIZE = 13
INPUT_SIZE = 4
WRENCH_SIZE = 6


def zeta(x: np.ndarray) -> np.ndarray:
    """Return zeta = [v_WB, w_WB_B] (..., 6) of a state x (..., 13), linear in the state [m/s,
    rad/s].
    """
    return x[..., 7:13]


def state_derivative(vehicle: Vehicle, x: np.ndarray, u: np.ndarray, chi: np.ndarray) -> np.ndarray:
    """Return dx/dt (..., 13) of eq. (1).

    Args:
        x: (..., 13) state.
        u: (..., 4) [N, N·m].
        chi: (..., 6) residual wrench [N, N·m].
    Source: Jin et al. 2025, eq. (1).
    """
    q = x[..., Q]
    v = x[..., V]
    w = x[..., W]
    a = (u[..., :1] * attitude.body_z(q) + chi[..., :3]) / vehicle.mass
    a[..., 2] -= vehicle.gravity
    J = vehicle.J
    torque = u[..., 1:4] + chi[..., 3:6] - np.cross(w, w @ J.T)
    al = torque @ np.linalg.inv(J).T
    return np.concatenate([v, attitude.quaternion_rate(q, w), a, al], axis=-1)


def runge_kutta(rate: Callable[[Any], Any], x: Any, h: float) -> Any:
    """Return the state after a step of the classical Runge-Kutta, of any array.

    Args:
        rate: dx/dt of a state.
        x: (..., n) state.
        h: step [s].
    """
    one = rate(x)
    two = rate(x + 0.5 * h * one)
    three = rate(x + 0.5 * h * two)
    four = rate(x + h * three)
    return x + h / 6 * (one + 2 * two + 2 * three + four)


def residual_wrench(
    vehicle: Vehicle, *, q: np.ndarray, w: np.ndarray, a: np.ndarray, al: np.ndarray, u: np.ndarray
) -> np.ndarray:
    """Return the wrench that eq. (1) needs, besides the commanded input, to explain the motion.

    f_e = m (a + g z) - R f_u z;
    tau_e = J al + w x J w - tau_m.
    Source: Jin et al. 2025, eq. (1) inverted.

    Args:
        q: (..., 4) attitude, body to world.
        w: (..., 3) body rates [rad/s].
        a: (..., 3) dv/dt of the centre of mass in W, gravity not in it [m/s²].
        al: (..., 3) dw/dt in B [rad/s²].
        u: (..., 4) command acting at that instant [N, N·m].
    Returns:
        (..., 6) chi = [f_e in W, tau_e in B], [N, N·m].
    """
    if max(map(np.ndim, (q, w, a, al, u))) == 1:  # one instant of the simulator
        given = (np.asarray(value, float) for value in (q, w, a, al, u))
        return _residual_wrench(*given, float(vehicle.mass), float(vehicle.gravity), vehicle.J)
    f = vehicle.mass * np.asarray(a, float) - u[..., :1] * attitude.body_z(q)
    f[..., 2] += vehicle.mass * vehicle.gravity
    J = vehicle.J
    tau = al @ J.T + np.cross(w, w @ J.T) - u[..., 1:4]
    return np.concatenate([f, tau], axis=-1)


@compiled
def _residual_wrench(q, w, a, al, u, mass, gravity, J):
    """Return `residual_wrench` of one instant, (6,)."""
    z = (
        2 * (q[1] * q[3] + q[0] * q[2]),
        2 * (q[2] * q[3] - q[0] * q[1]),
        q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3],
    )
    h = times(J, w[0], w[1], w[2])
    change = times(J, al[0], al[1], al[2])
    out = np.empty(6)
    for row in range(3):
        out[row] = mass * a[row] - u[0] * z[row]
        out[3 + row] = change[row] - u[1 + row]
    out[2] += mass * gravity
    out[3] += w[1] * h[2] - w[2] * h[1]
    out[4] += w[2] * h[0] - w[0] * h[2]
    out[5] += w[0] * h[1] - w[1] * h[0]
    return out
