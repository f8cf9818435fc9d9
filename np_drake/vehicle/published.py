"""Published quadrotors, and what they tell before a flight does: dimensionless numbers with their
spread.

`presets/published.csv` holds what its sources measured, identified or drew. A value that a source
copies from another vehicle, computes from a simple body or tunes for a simulation is left out. A
source with one time constant has it for both directions.
"""

import csv
import dataclasses as dc
import math
from functools import cache

import numpy as np

from np_drake.vehicle.physics import AIR
from np_drake.vehicle.vehicle import PRESETS

FILE = PRESETS / "published.csv"
GRAVITY = 9.81  # [m/s²]


@dc.dataclass(frozen=True)
class PublishedVehicle:
    """What is published of one quadrotor; None where a figure is not."""

    name: str
    mass: float | None  # [kg]
    arm: float | None  # mean distance of the rotors from the middle [m]
    inertia_xx: float | None  # about the centre of mass, body axes [kg·m²]
    inertia_yy: float | None  # [kg·m²]
    inertia_zz: float | None  # [kg·m²]
    thrust_coefficient: float | None  # [N/(rad/s)²]
    torque_over_thrust: float | None  # [m]
    rotor_radius: float | None  # [m]
    max_rotor_thrust: float | None  # of one rotor [N]
    time_constant_up: float | None  # of a rotor that speeds up [s]
    time_constant_down: float | None  # of one that slows down [s]
    rotor_inertia: float | None  # of one rotor about its axis [kg·m²]
    source: str


@dc.dataclass(frozen=True)
class LogNormal:
    """Spread of a positive number over published vehicles: its logarithm is normal."""

    mean: float  # of the logarithm
    deviation: float  # of the logarithm
    count: int  # vehicles that tell it

    @property
    def median(self) -> float:
        """Median of the number."""
        return math.exp(self.mean)

    def within(self, deviations: float = 1.96) -> tuple[float, float]:
        """Return the ends of the interval of so many standard deviations, 95 % by default."""
        return math.exp(self.mean - deviations * self.deviation), math.exp(
            self.mean + deviations * self.deviation
        )


@dc.dataclass(frozen=True)
class DimensionlessPriors:
    """Spread of dimensionless numbers over the published vehicles, m mass, l arm, R rotor radius.

    Time constants are in seconds, for the published ones do not go with the size of the rotor.
    """

    thrust_to_weight: LogNormal  # 4 max_rotor_thrust / (m g)
    inertia: LogNormal  # J_xx / (m l²)
    inertia_pitch: LogNormal  # J_yy / J_xx
    inertia_yaw: LogNormal  # J_zz / (J_xx + J_yy)
    torque_lever: LogNormal  # torque over thrust and R
    thrust_number: LogNormal  # C_T = T / (rho n² (2 R)⁴), n in revolutions a second
    time_constant: LogNormal  # of a rotor that speeds up [s]
    time_constant_down: LogNormal  # over that of one that speeds up
    rotor_inertia: LogNormal  # of one rotor over m l²


@cache
def published_vehicles() -> tuple[PublishedVehicle, ...]:
    """Return the published vehicles, in the order of the file."""
    with FILE.open(encoding="utf-8", newline="") as file:
        return tuple(_vehicle(row) for row in csv.DictReader(file))


@cache
def published_priors() -> DimensionlessPriors:
    """Return mean and standard deviation of the logarithms over all vehicles that tell a number."""
    told = [dimensionless(vehicle) for vehicle in published_vehicles()]
    spreads = {}
    for field in dc.fields(DimensionlessPriors):
        logs = np.log([numbers[field.name] for numbers in told if field.name in numbers])
        spreads[field.name] = LogNormal(float(logs.mean()), float(logs.std(ddof=1)), len(logs))
    return DimensionlessPriors(**spreads)


def dimensionless(vehicle: PublishedVehicle) -> dict[str, float]:
    """Return the numbers of `DimensionlessPriors` that are published of a vehicle."""
    v = vehicle
    ratios = {
        "thrust_to_weight": (4, v.max_rotor_thrust, 1 / GRAVITY, _inverse(v.mass)),
        "inertia": (v.inertia_xx, *_inverse_of_unit(v)),
        "inertia_pitch": (v.inertia_yy, _inverse(v.inertia_xx)),
        "inertia_yaw": (v.inertia_zz, _inverse(_sum(v.inertia_xx, v.inertia_yy))),
        "torque_lever": (v.torque_over_thrust, _inverse(v.rotor_radius)),
        "thrust_number": (
            v.thrust_coefficient,
            (2 * math.pi) ** 2 / AIR / 16,
            *[_inverse(v.rotor_radius)] * 4,
        ),
        "time_constant": (v.time_constant_up,),
        "time_constant_down": (v.time_constant_down, _inverse(v.time_constant_up)),
        "rotor_inertia": (v.rotor_inertia, *_inverse_of_unit(v)),
    }
    return {name: math.prod(factors) for name, factors in ratios.items() if None not in factors}  # type: ignore[arg-type]


def _inverse_of_unit(v: PublishedVehicle) -> tuple[float | None, ...]:
    """Return the factors of 1 / (m l²)."""
    return (_inverse(v.mass), _inverse(v.arm), _inverse(v.arm))


def _inverse(value: float | None) -> float | None:
    return None if value is None else 1 / value


def _sum(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a + b


def _vehicle(row: dict[str, str]) -> PublishedVehicle:
    figures = {
        key: float(text) if text else None
        for key, text in row.items()
        if key not in ("name", "source")
    }
    return PublishedVehicle(name=row["name"], source=row["source"], **figures)
