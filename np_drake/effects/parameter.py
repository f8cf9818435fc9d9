"""Parameter of an effect: its range, and its usual size for a vehicle."""

import dataclasses as dc

from np_drake.effects.random_sizes import arm
from np_drake.vehicle import Vehicle

PAPER = Vehicle()  # of whose size the library's typical values are


@dc.dataclass(frozen=True)
class Parameter:
    """Range and scale of one parameter of an effect.

    neutral: value at which the effect vanishes, if `vanishes`.   lower, upper: bounds of a fit.
    typical: usual distance from neutral: the deviation of the prior, and the scale of finite
        differences.
    choices: the only values, where it is not continuous.
    departure: how a vehicle or sensor differs that has another value than neutral, as "rotor
        {rotor}: thrust {signed}";
        where the sign decides the words, "{size} ahead|{size} behind", of more and of less.
    """

    name: str
    unit: str
    neutral: float
    lower: float
    upper: float
    typical: float
    choices: tuple[float, ...] = ()
    vanishes: bool = True
    departure: str = ""


def usual_size(parameter: Parameter, vehicle: Vehicle) -> float:
    """Return the usual size of a parameter; the library's is for the paper's vehicle."""
    mass = vehicle.mass / PAPER.mass
    span = arm(vehicle) / arm(PAPER)
    scale = {
        "kg": mass,
        "N": mass,
        "N·s/m": mass,
        "N·s²/m²": mass,
        "N·m·s/m": mass * span,
        "kg·m²": mass * span**2,
    }
    longer = {"m": span} if parameter.name != "length" else {}
    return parameter.typical * (scale | longer).get(parameter.unit, 1.0)
