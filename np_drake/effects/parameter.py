"""Parameter of an effect: its range, its usual size for a vehicle, and random sizes."""

import dataclasses as dc
from collections.abc import Mapping

import numpy as np

from np_drake.files.number_text import departure_unit, measure
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


def departure(
    p: Parameter, value: float, others: Mapping[str, float], *, shares: bool
) -> tuple[str, str]:
    """Return the unit of a parameter, and in words how far it departs from neutral by `value`.

    others: values of the other parameters of its effect; shares: whether its factors are shares.
    """
    unit = "share" if p.unit == "1" and shares else p.unit
    more, _, less = p.departure.partition("|")
    factor, shown = departure_unit(unit)
    size = measure(factor * abs(value), shown)
    words = less if less and value < 0 else more
    sign = "−" if value < 0 else "+"
    return unit, words.format(
        size=size, signed=f"{sign}{size}", **{n: f"{v:g}" for n, v in others.items()}
    )


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


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number, every decade as likely."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def signed(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a log-uniform number of either sign."""
    return float(rng.choice([-1.0, 1.0])) * log_uniform(rng, low, high)


def arm(vehicle: Vehicle) -> float:
    """Return the mean distance of a rotor from Bo in the plane of the rotors [m]."""
    return float(np.mean(np.linalg.norm(np.array(vehicle.rotor_positions)[:, :2], axis=1)))


def direction(rng: np.random.Generator, rise: float | None = None) -> np.ndarray:
    """Draw a unit vector (3,).

    Args:
        rise: deviation of its slope, where it is about level [1]; None: in all directions.
    """
    n = rng.normal(size=3)
    if rise is not None:
        n[2] = rise * n[2] * np.hypot(n[0], n[1])
    return n / np.linalg.norm(n)


def drag_coefficients(
    rng: np.random.Generator, vehicle: Vehicle, low: float, high: float
) -> np.ndarray:
    """Draw drag coefficients (3,) in body axes: a heavy vehicle has more drag, and the level axes
    about the same.
    """
    lateral = log_uniform(rng, low, high) * vehicle.mass
    return lateral * rng.uniform([0.8, 0.8, 0.3], [1.2, 1.2, 1.2])
