"""Parameter of an effect: its range, and its usual size for a vehicle."""

import dataclasses as dc

import numpy as np

from np_drake.vehicle import Vehicle

PAPER = Vehicle()  # of whose size the library's typical values are


@dc.dataclass(frozen=True)
class Parameter:
    """Range and scale of one parameter of an effect.

    neutral: value at which the effect vanishes, if `vanishes`.   lower, upper: bounds of a fit.
    typical: usual distance from neutral: the deviation of the prior, and the scale of finite differences.
    choices: the only values, where it is not continuous.
    """

    name: str
    unit: str
    neutral: float
    lower: float
    upper: float
    typical: float
    choices: tuple[float, ...] = ()
    vanishes: bool = True


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


def _arm(vehicle: Vehicle) -> float:
    return float(np.linalg.norm(np.array(vehicle.rotor_positions)[:, :2], axis=1).mean())
