"""Feed-forward: the state and input at which eq. (1) follows a reference motion under a known wrench."""

import numpy as np

from np_drake import attitude
from np_drake.vehicle import Vehicle

_DELTA = 1e-4  # step of the central difference that turns body rate into angular acceleration [s]


def targets(
    vehicle: Vehicle, flat: np.ndarray, chi: np.ndarray, yaw: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return x* and u* that track `flat` exactly under the wrench `chi` (the target shift).

    Thrust direction and size follow from m (a + g z) - f_e; body rate and torque from jerk and snap, the wrench
    taken as constant in its own derivative. Source: differential flatness of eq. (1); own choice: shortest tilt.

    Args:
        flat: (5, n, 3) p, v, a, jerk, snap in W.   chi: (n, 6) wrench [N, N·m].   yaw: heading [rad].
    Returns:
        x_ref (n, 13), u_ref (n, 4) [N, N·m].
    """
    p, v, a, jerk, snap = flat
    m, J = vehicle.mass, vehicle.J
    thrust = m * (a + [0.0, 0.0, vehicle.gravity]) - chi[:, :3]
    thrust_1, thrust_2 = m * jerk, m * snap
    q, w = _attitude_and_rate(thrust, thrust_1, yaw)
    later = _attitude_and_rate(thrust + _DELTA * thrust_1, thrust_1 + _DELTA * thrust_2, yaw)[1]
    sooner = _attitude_and_rate(thrust - _DELTA * thrust_1, thrust_1 - _DELTA * thrust_2, yaw)[1]
    al = (later - sooner) / (2 * _DELTA)
    tau = al @ J.T + np.cross(w, w @ J.T) - chi[:, 3:6]
    u = np.concatenate([np.linalg.norm(thrust, axis=1, keepdims=True), tau], axis=1)
    return np.concatenate([p, q, v, w], axis=1), u


def body_rates(vehicle: Vehicle, flat: np.ndarray, yaw: float = 0.0) -> np.ndarray:
    """Return w_WB_B (n, 3) of the reference motion `flat` (5, n, 3) without any wrench [rad/s].

    Args: yaw: heading [rad].
    """
    thrust = vehicle.mass * (flat[2] + [0.0, 0.0, vehicle.gravity])
    return _attitude_and_rate(thrust, vehicle.mass * flat[3], yaw)[1]


def _attitude_and_rate(thrust: np.ndarray, thrust_rate: np.ndarray, yaw: float):
    """Return quaternion (n, 4) and body rate (n, 3) of a thrust vector in W and its rate, (n, 3) each."""
    size = np.maximum(np.linalg.norm(thrust, axis=1, keepdims=True), 1e-6)
    z = thrust / size
    z_rate = (thrust_rate - z * np.sum(z * thrust_rate, axis=1, keepdims=True)) / size
    q = attitude.quaternion_from_axes(z, yaw)
    w = np.sqrt(np.maximum(0.5 * (1 + z[:, 2]), 1e-12))
    w_rate = z_rate[:, 2] / (4 * w)
    tilt_rate = np.stack(
        [
            w_rate,
            -z_rate[:, 1] / (2 * w) + z[:, 1] * w_rate / (2 * w**2),
            z_rate[:, 0] / (2 * w) - z[:, 0] * w_rate / (2 * w**2),
            np.zeros_like(w),
        ],
        axis=1,
    )
    turn = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
    q_rate = attitude.multiply(tilt_rate, np.broadcast_to(turn, tilt_rate.shape))
    conjugate = q * [1.0, -1.0, -1.0, -1.0]
    return q, 2 * attitude.multiply(conjugate, q_rate)[:, 1:]
