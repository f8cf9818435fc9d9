"""A conical pendulum under a vehicle that moves on a straight line: motion, force and payload in
closed form.
"""

import numpy as np

from np_drake.flight_log import FlightLog

STEP = 0.004  # s


def conical_flight(
    vehicle, payload, *, angle, velocity=(0.0, 0.0, 0.0), duration=3.0, drag=0.0, name="cone"
):
    """The log of the vehicle, and times and path of the payload, which turns at w² = g / (L cos
    angle).

    The payload's damping must be zero and its hook the origin. The thrust carries weight, tether
    and drag.
    """
    t = STEP * np.arange(round(duration / STEP) + 1)
    g, v = vehicle.gravity, np.asarray(velocity, float)
    turn = np.sqrt(g / (payload.length * np.cos(angle))) * t
    n = np.stack(
        [np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), -np.cos(angle) + 0 * t], axis=1
    )
    tether = payload.mass * g / np.cos(angle) * n
    log = carried(
        vehicle, t, v * t[:, None], np.tile(v, (len(t), 1)), 0 * n, tether - drag * v, name
    )
    return log, (t, log.p + payload.length * n)


def carried(vehicle, t, p, v, a, force, name):
    """The log of a vehicle without torque whose thrust leaves `force` (n, 3) of m (a + g)
    unexplained.
    """
    thrust = vehicle.mass * (a + [0.0, 0.0, vehicle.gravity]) - force
    size = np.linalg.norm(thrust, axis=1)
    z = thrust / size[:, None]
    half = np.stack(
        [1 + z[:, 2], -z[:, 1], z[:, 0], 0 * t], axis=1
    )  # least turn of z to the thrust
    q = half / np.linalg.norm(half, axis=1, keepdims=True)
    u = np.stack([size, 0 * t, 0 * t, 0 * t], axis=1)
    return FlightLog(t, p, q, v, 0 * p, u, a, 0 * p, name=name)
