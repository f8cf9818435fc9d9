"""Usual size of an effect's parameters for a vehicle, and the prior of all of them together."""

import numpy as np

from np_drake.effects.base import Effect, Parameter
from np_drake.vehicle import Vehicle

PAPER = Vehicle()  # of whose size the library's typical values are


def usual_size(parameter: Parameter, vehicle: Vehicle) -> float:
    """Return the usual size of a parameter for a vehicle of this mass and arm; the library's is for the paper's."""
    mass = vehicle.mass / PAPER.mass
    arm = _arm(vehicle) / _arm(PAPER)
    scale = {
        "kg": mass,
        "N": mass,
        "N·s/m": mass,
        "N·s²/m²": mass,
        "N·m·s/m": mass * arm,
        "kg·m²": mass * arm**2,
    }
    longer = {"m": arm} if parameter.name != "length" else {}
    return parameter.typical * (scale | longer).get(parameter.unit, 1.0)


def prior_root(effect: type[Effect], vehicle: Vehicle) -> np.ndarray:
    """Return the lower root (k, k) of the prior covariance of an effect's k continuous parameters, in their units."""
    free = [p for p in effect.parameters if not p.choices]
    sizes = np.array([usual_size(p, vehicle) for p in free])
    return sizes[:, None] * correlation_root(effect)


def correlation_root(effect: type[Effect]) -> np.ndarray:
    """Return the lower root (k, k) of the prior correlation of an effect's k continuous parameters [1]."""
    size = sum(not p.choices for p in effect.parameters)
    return (
        np.linalg.cholesky(np.array(effect.prior_correlation)) if effect.prior_correlation else np.eye(size)
    )


def _arm(vehicle: Vehicle) -> float:
    return float(np.linalg.norm(np.array(vehicle.rotor_positions)[:, :2], axis=1).mean())
