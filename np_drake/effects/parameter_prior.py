"""Prior of an effect's parameters for a vehicle, all of them together."""

import numpy as np

from np_drake.effects.base import Effect
from np_drake.effects.parameter import usual_size
from np_drake.vehicle import Vehicle


def prior_root(effect: type[Effect], vehicle: Vehicle) -> np.ndarray:
    """Return the lower root (k, k) of the prior covariance of an effect's k continuous parameters,
    in their units.
    """
    free = [p for p in effect.parameters if not p.choices]
    sizes = np.array([usual_size(p, vehicle) for p in free])
    # Covariance D P D with P = L L^T has the lower root D L.
    return sizes[:, None] * correlation_root(effect)


def correlation_root(effect: type[Effect]) -> np.ndarray:
    """Return the lower root (k, k) of the prior correlation of an effect's k continuous parameters
    [1].
    """
    size = sum(not p.choices for p in effect.parameters)
    return (
        np.linalg.cholesky(np.array(effect.prior_correlation))
        if effect.prior_correlation
        else np.eye(size)
    )
