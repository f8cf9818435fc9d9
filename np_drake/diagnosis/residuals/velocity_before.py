"""Velocity that the rows before an instant and the nominal thrust foretell, for regressors of force.

Where force comes from differences of velocity, a disturbance changes the velocity of its own interval. A drag on that
velocity would be fitted to the disturbance: the vehicle yields to a gust, and least squares finds less drag than there
is. The velocity that is known before the interval does not contain it.
"""

import numpy as np

from np_drake import attitude
from np_drake.vehicle import Vehicle


def velocity_before(
    t: np.ndarray,
    dt: np.ndarray,
    v: np.ndarray,
    q: np.ndarray,
    thrust: np.ndarray,
    vehicle: Vehicle,
    lead: float,
) -> np.ndarray:
    """Return the velocities (n, 3) in W that are foretold `lead` before the instants [m/s].

    What nominal thrust and gravity leave of the velocity, which the disturbances make, is extrapolated linearly.

    Args:
        t, dt: (n,) middles and lengths of the intervals between rows [s].
        v, q: (n, 3), (n, 4) velocity in W [m/s] and attitude there.
        thrust: (n,) mean nominal thrust in the intervals [N].
        vehicle: the nominal vehicle.
        lead: [s].
    Source: one-step predictor of prediction error methods; Ljung, System Identification, ch. 13 (closed loop).
    """
    up = np.zeros((len(t), 3))
    up[:, 2] = thrust / vehicle.mass
    gained = (attitude.rotate(q, up) - [0.0, 0.0, vehicle.gravity]) * dt[:, None]
    nominal = np.cumsum(gained, axis=0) - 0.5 * gained
    left = v - nominal

    def at(instants: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(instants, t, component) for component in left.T], axis=1)

    return nominal + 2 * at(t - lead) - at(t - 2 * lead)
