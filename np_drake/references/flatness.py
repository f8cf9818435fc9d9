"""Feed-forward: the state and input at which eq. (1) follows a reference motion under a known
wrench.
"""

import math

import numpy as np

from np_drake.compiled import compiled, times
from np_drake.vehicle import Vehicle

_DELTA = 1e-4  # step of the central difference that turns body rate into angular acceleration [s]


def targets(vehicle: Vehicle, flat: np.ndarray, chi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return x* and u* that track `flat` exactly under the wrench `chi` (the target shift).

    Thrust direction and size follow from m (a + g z) - f_e; body rate and torque from jerk and
    snap, the wrench taken as constant in its own derivative. The heading is zero. Source:
    differential flatness of eq. (1); own choice: shortest tilt.

    Args:
        flat: (5, n, 3) p, v, a, jerk, snap in W.
        chi: (n, 6) wrench [N, N·m].
    Returns:
        x_ref (n, 13), u_ref (n, 4) [N, N·m].
    """
    flat = np.ascontiguousarray(flat, float)
    chi = np.ascontiguousarray(chi, float)
    J = np.ascontiguousarray(vehicle.J, float)
    return _follow(flat, chi, float(vehicle.mass), float(vehicle.gravity), J)


@compiled
def _attitude_and_rate(f_x, f_y, f_z, r_x, r_y, r_z):
    """Return quaternion and body rate [rad/s] of a thrust f in W and its rate r, component by
    component.

    The attitude is the shortest tilt to the thrust, so that q_z = 0.
    """
    size = max(math.sqrt(f_x * f_x + f_y * f_y + f_z * f_z), 1e-6)
    x = f_x / size
    y = f_y / size
    z = f_z / size
    along = x * r_x + y * r_y + z * r_z
    x_1 = (r_x - x * along) / size
    y_1 = (r_y - y * along) / size
    z_1 = (r_z - z * along) / size
    w = math.sqrt(max(0.5 * (1 + z), 1e-12))
    i = -y / (2 * w)
    j = x / (2 * w)
    w_1 = z_1 / (4 * w)
    i_1 = -y_1 / (2 * w) + y * w_1 / (2 * w * w)
    j_1 = x_1 / (2 * w) - x * w_1 / (2 * w * w)
    # Body rate from w = 2 q^* dq/dt
    return w, i, j, 0.0, 2 * (w * i_1 - i * w_1), 2 * (w * j_1 - j * w_1), 2 * (j * i_1 - i * j_1)


@compiled
def _follow(flat, chi, mass, gravity, J):
    """Return the states x (n, 13) and inputs u (n, 4) that follow flat (5, n, 3) under chi (n, 6),
    see `targets`.

    Args:
        flat: (5, n, 3) motion and its derivatives by time.
        chi: (n, 6) wrench [N, N·m].
        mass: [kg].
        gravity: [m/s²].
        J: (3, 3) inertia [kg·m²].
    """
    x = np.empty((flat.shape[1], 13))
    u = np.empty((flat.shape[1], 4))
    for i in range(flat.shape[1]):
        # Thrust m (a + g z) - f_e and its rate; the angular acceleration is a central difference of
        # the body rate
        f_x = mass * flat[2, i, 0] - chi[i, 0]
        f_y = mass * flat[2, i, 1] - chi[i, 1]
        f_z = mass * (flat[2, i, 2] + gravity) - chi[i, 2]
        j_x = mass * flat[3, i, 0]
        j_y = mass * flat[3, i, 1]
        j_z = mass * flat[3, i, 2]
        d_x = _DELTA * j_x
        d_y = _DELTA * j_y
        d_z = _DELTA * j_z
        push = _DELTA * mass
        s_x = push * flat[4, i, 0]
        s_y = push * flat[4, i, 1]
        s_z = push * flat[4, i, 2]
        w, q_x, q_y, q_z, a, b, c = _attitude_and_rate(f_x, f_y, f_z, j_x, j_y, j_z)
        later = _attitude_and_rate(f_x + d_x, f_y + d_y, f_z + d_z, j_x + s_x, j_y + s_y, j_z + s_z)
        sooner = _attitude_and_rate(
            f_x - d_x, f_y - d_y, f_z - d_z, j_x - s_x, j_y - s_y, j_z - s_z
        )
        for axis in range(3):
            x[i, axis] = flat[0, i, axis]
            x[i, 7 + axis] = flat[1, i, axis]
        x[i, 3] = w
        x[i, 4] = q_x
        x[i, 5] = q_y
        x[i, 6] = q_z
        x[i, 10] = a
        x[i, 11] = b
        x[i, 12] = c
        u[i, 0] = math.sqrt(f_x * f_x + f_y * f_y + f_z * f_z)
        h_x, h_y, h_z = times(J, a, b, c)
        u[i, 1] = b * h_z - c * h_y
        u[i, 2] = c * h_x - a * h_z
        u[i, 3] = a * h_y - b * h_x
        for row in range(3):
            turn = 0.0
            for axis in range(3):
                turn += J[row, axis] * (later[4 + axis] - sooner[4 + axis])
            u[i, 1 + row] += turn / (2 * _DELTA) - chi[i, 3 + row]
    return x, u
