"""Cascaded flight controller from position to attitude to torque; a call takes a few
microseconds.
"""

import dataclasses as dc
import math

import numpy as np

from np_drake import attitude
from np_drake.references.flatness import targets
from np_drake.vehicle import Vehicle

TARGET_SIZE = 16  # p, v, a, w, dw/dt and heading [1]
# Where each part of a target lies: p, v, a in W; angular rate and acceleration in B; heading.
P = slice(0, 3)
V = slice(3, 6)
A = slice(6, 9)
W = slice(9, 12)
AL = slice(12, 15)
YAW = 15


@dc.dataclass(frozen=True)
class CascadeGains:
    """Gains of the controller, per axis.

    Own choice: slow enough for 80 ms of rotor lag or 40 ms of dead time; feed-forward does the
    rest.
    """

    position: tuple[float, float, float] = (2.5, 2.5, 9.0)  # [1/s²]
    velocity: tuple[float, float, float] = (2.7, 2.7, 5.5)  # [1/s]
    integral: tuple[float, float, float] = (0.6, 0.6, 5.0)  # of the position error [1/s³]
    attitude: tuple[float, float, float] = (40.0, 40.0, 9.0)  # [1/s²]
    rate: tuple[float, float, float] = (11.0, 11.0, 5.0)  # [1/s]
    turn_integral: tuple[float, float, float] = (40.0, 40.0, 6.0)  # of the attitude error [1/s³]
    reach: float = 1.5  # position error that counts at most [m]
    least_lift: float = 0.3  # vertical specific force that is always asked for, over gravity [1]
    most_tilt: float = 1.0  # [rad]


def cascade(
    vehicle: Vehicle,
    gains: CascadeGains,
    *,
    x: np.ndarray,
    target: np.ndarray,
    integral: np.ndarray,
    step: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the input of one step of the controller and the new integral of its errors.

    Feedback on position and velocity gives a specific force; its direction and the target's heading
    give the attitude; feedback on attitude and body rate gives an angular acceleration; eq. (1)
    turns both into u.

    Args:
        x: (13,) state.
        target: (16,) p, v, a in W, w, dw/dt in B, heading.
        integral: (6,) of the errors of position and attitude [m·s, rad·s].
        step: since the last call [s].
    Source: the usual cascade on differential flatness; gains are an own choice.

    Returns:
        u (4,) [N, N·m] after saturation, and the new integral.
    """
    error = np.clip(target[P] - x[0:3], -gains.reach, gains.reach)
    moved = np.clip(integral[:3] + step * error, -1.5, 1.5)
    force = (
        target[A]
        + np.multiply(gains.position, error)
        + np.multiply(gains.velocity, target[V] - x[7:10])
        + np.multiply(gains.integral, moved)
    )
    z_B_W = _thrust_direction(vehicle.gravity, gains, force)
    q = x[3:7]
    f = vehicle.mass * float(force @ attitude.body_z(q))
    error = _attitude_error(q, z_B_W, float(target[YAW]))
    turned = np.clip(integral[3:] + step * error, -0.6, 0.6)
    al = target[AL] + np.multiply(gains.attitude, error) + np.multiply(gains.turn_integral, turned)
    al += np.multiply(gains.rate, target[W] - x[10:13])
    J_w = vehicle.J @ x[10:13]
    w = x[10:13].tolist()
    gyro = [
        w[1] * J_w[2] - w[2] * J_w[1],
        w[2] * J_w[0] - w[0] * J_w[2],
        w[0] * J_w[1] - w[1] * J_w[0],
    ]
    return vehicle.saturate(np.concatenate([[max(f, 0.0)], vehicle.J @ al + gyro])), np.concatenate(
        [moved, turned]
    )


def _thrust_direction(gravity: float, gains: CascadeGains, force: np.ndarray) -> np.ndarray:
    """Return the unit vector (3,) along the specific force.

    Adds gravity to `force` in place and keeps the tilt in bounds.
    """
    force[2] = max(force[2] + gravity, gains.least_lift * gravity)
    lateral = math.hypot(force[0], force[1])
    most = force[2] * math.tan(gains.most_tilt)
    if lateral > most:
        force[:2] *= most / lateral
    return force / math.sqrt(float(force @ force))


def _attitude_error(q: np.ndarray, z_B_W: np.ndarray, yaw: float) -> np.ndarray:
    """Return the small rotation (3,) in B from `q` to the wanted thrust direction and heading
    [rad].
    """
    wanted = attitude.quaternion_from_axes(z_B_W, yaw)
    turn = attitude.multiply(q * [1.0, -1.0, -1.0, -1.0], wanted)
    return (2.0 if turn[0] >= 0 else -2.0) * turn[1:]


def cascade_target(vehicle: Vehicle, flat: np.ndarray) -> np.ndarray:
    """Return the targets (n, 16) of `cascade` that follow `flat` without any wrench.

    Angular acceleration is eq. (1) inverted: dw/dt = J⁻¹ (tau - w x J w).

    Args:
        flat: (5, n, 3) p, v, a, jerk, snap in W.
    """
    x, u = targets(vehicle, flat, np.zeros((flat.shape[1], 6)))
    w = x[:, 10:13]
    target = np.zeros((flat.shape[1], TARGET_SIZE))
    target[:, :9] = flat[:3].swapaxes(0, 1).reshape(-1, 9)
    target[:, 9:12] = w
    target[:, 12:15] = np.linalg.solve(vehicle.J, (u[:, 1:] - np.cross(w, w @ vehicle.J.T)).T).T
    return target
