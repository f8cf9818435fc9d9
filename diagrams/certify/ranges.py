"""Flights drawn from ranges of a scenario's fields, from the intervals of its vehicle file and from
the posterior of its causes.
"""

import dataclasses as dc
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from diagrams.batch.run import require
from diagrams.loop.experiments import with_field, with_payload
from diagrams.loop.flight import FlightConfig
from np_drake.effects.effect_entry import Posterior
from np_drake.files.yaml_file import filled
from np_drake.vehicle import Vehicle
from np_drake.vehicle.published import published_priors
from np_drake.vehicle.sources import PART, part, value_of, values

WORDS = {
    "payload": "reality.payload.mass",
    "tether": "reality.payload.length",
    "speed": "reference.speed",
    "wind": "reality.wind",
}
ATTEMPTS = 1000  # draws of a vehicle until one is physical
# Of a vehicle file, numbers that the simulated vehicle has by itself; thrust is a scale of it.
DRAWN = (
    "mass",
    "inertia",
    "rotor_time_constant",
    "rate_loop.lag",
    "rate_loop.gain",
    "calibration.center_of_mass",
    "calibration.rotor_gains",
    "calibration.rotor_time_constant_down",
    "calibration.command_delay",
    "calibration.rotor_inertia",
    "calibration.imu_position",
    "calibration.imu_tilt",
)
THRUST = "thrust_scale"  # name of a drawn thrust, real over that of the file [1]


@dc.dataclass(frozen=True)
class Range:
    """Range of a number of a scenario, from which flights are drawn evenly.

    name: `payload`, the mass of the payload [kg]; `tether` [m]; `speed` [m/s]; `wind`, horizontal
        and from any side [m/s]; or a field, as `reality.gust`.
    low, high: its ends, in the field's unit.
    """

    name: str
    low: float
    high: float

    @classmethod
    def parse(cls, text: str) -> "Range":
        """Return the range that NAME=LOW:HIGH says; ValueError where it says none."""
        name, sign, ends = text.partition("=")
        low, colon, high = ends.partition(":")
        try:
            made = cls(name.strip(), float(low), float(high))
        except ValueError:
            colon = ""
        require(
            bool(sign and colon and name.strip()),
            f"--over: must be NAME=LOW:HIGH, as speed=0.5:3; got {text!r}.",
        )
        return made.check()

    def check(self) -> "Range":
        """Return self after checking the ends; ValueError where they are no range."""
        require(
            -math.inf < self.low < self.high < math.inf,
            f"--over {self.name}: must go from a finite number to a larger one; got {self.low:g} "
            f"to {self.high:g}.",
        )
        return self

    def at(self, share: float | np.ndarray) -> Any:
        """Return the value at a share of the range [1]."""
        return self.low + share * (self.high - self.low)


def with_value(config: FlightConfig, name: str, value: float, side: float = 0.0) -> FlightConfig:
    """Return the scenario with a value of a range; `side` is the direction of a wind [rad].

    Raises: ValueError: where the scenario has no such field, or it cannot have the value.
    """
    if name == "payload":
        return with_payload(config, value)
    if name == "wind":
        wind = [value * math.cos(side), value * math.sin(side), 0.0]
        return dc.replace(config, reality=dc.replace(config.reality, wind=wind))
    return with_field(config, WORDS.get(name, name), value)


def spread_of(vehicle: Vehicle) -> dict[str, float]:
    """Return the standard deviations of the numbers that are drawn, by `part` of their field and as
    `THRUST`; none of a vehicle whose file states no interval.
    """
    deviations: dict[str, float] = {}
    named = {_field(name) for name in vehicle.intervals}
    nominal = values(vehicle)
    for field in (field for field in DRAWN if field in named):
        for index in np.ndindex(np.shape(nominal[field])):
            deviation = vehicle.known_within(field, *index)
            if deviation and (field != "inertia" or index[0] <= index[1]):
                deviations[part(field, *index)] = deviation
    mass = vehicle.uncertainty("mass")
    if mass:
        deviations.setdefault("mass", mass * vehicle.mass)
    thrust = vehicle.uncertainty("thrust")
    if thrust is None and "throttle.full_thrust" in named and vehicle.throttle is not None:
        full = vehicle.known_within("throttle.full_thrust")
        thrust = None if full is None else full / vehicle.throttle.full_thrust
    return deviations | ({THRUST: thrust} if thrust else {})


def _field(name: str) -> str:
    """Return the field of a `part` of it."""
    return PART.match(name)[1]  # type: ignore[index]


def drawn_vehicle(
    vehicle: Vehicle, spread: dict[str, float], rng: np.random.Generator
) -> tuple[Vehicle, dict[str, float]]:
    """Return a vehicle whose numbers are normal about those of the file, and what was drawn.

    Draws that no vehicle can have are left out.
    Raises: ValueError: where no draw is a vehicle.
    """
    nominal = values(vehicle)
    why = ""
    for _ in range(ATTEMPTS if spread else 0):
        drawn = {name: deviation * rng.standard_normal() for name, deviation in spread.items()}
        drawn = {n: d + (1.0 if n == THRUST else value_of(n, nominal)) for n, d in drawn.items()}
        content = _content({n: v for n, v in drawn.items() if n != THRUST}, nominal)
        try:
            return filled(vehicle, content).check() if content else vehicle, drawn
        except ValueError as error:
            why = str(error)
    require(not spread, f"{vehicle.name}: its intervals hold no vehicle that can be: {why}")
    return vehicle, {}


def _content(drawn: dict[str, float], nominal: dict[str, Any]) -> dict[str, Any]:
    """Return what a vehicle file of drawn numbers holds, the others of their fields as in
    `nominal`.
    """
    arrays = {field: np.array(nominal[field], float) for field in map(_field, drawn)}
    for name, value in drawn.items():
        field, places = PART.match(name).groups()  # type: ignore[union-attr]
        index = tuple(int(place) for place in places.strip("[]").split("][") if place)
        arrays[field][index] = arrays[field][index[::-1]] = value
    gains = arrays.get("calibration.rotor_gains")
    if gains is not None:
        gains /= gains.mean()
    content: dict[str, Any] = {}
    for field, array in arrays.items():
        section, _, name = field.rpartition(".")
        (content.setdefault(section, {}) if section else content)[name] = array.tolist()
    return content


def drawn_flight(
    config: FlightConfig, over: Sequence[Range], shares: Sequence[float], *, seed: Sequence[int]
) -> tuple[FlightConfig, dict[str, float]]:
    """Return a flight drawn from what is known of a vehicle, and the values that were drawn.

    The controller assumes the vehicle file; the vehicle that flies is drawn within its intervals,
    the causes from their posterior, with disturbance and gusts of their own. Rotors whose lag a
    measured file does not state have that of a published vehicle.

    Args:
        config: scenario.
        over: ranges of its fields.
        shares: place of the flight in each of them [1].
        seed: of the draw.
    Raises: ValueError: where what was drawn cannot be flown.
    """
    rng = np.random.default_rng(seed)
    reality = config.reality
    spread = spread_of(config.vehicle)
    lag = published_priors().time_constant
    vehicle, drawn = drawn_vehicle(config.vehicle, spread, rng)
    effects = reality.posterior.draw(reality.effects, rng)
    drawn |= {
        f"{entry.effect}.{name}": value
        for entry in effects
        for name, value in entry.made.values.items()
        if f"{entry.effect}.{name}" in reality.posterior.parameters
    }
    if (
        spread
        and config.autopilot.kind != "rate_loop"
        and not any((*reality.lags, vehicle.rotor_time_constant))
    ):
        drawn["motor_lag"] = float(rng.lognormal(lag.mean, lag.deviation))
    reality = dc.replace(
        reality,
        motor_lag=drawn.get("motor_lag", reality.motor_lag),
        effects=effects,
        posterior=Posterior(),
        disturbance=dc.replace(reality.disturbance, seed=int(rng.integers(2**31))),
        gust_seed=int(rng.integers(2**31)),
        thrust_scale=reality.thrust_scale * drawn.get(THRUST, 1.0),
    )
    flight = dc.replace(
        config,
        vehicle=vehicle,
        reality=reality,
        controller=dc.replace(
            config.controller, vehicle=config.controller.vehicle or config.vehicle
        ),
    )
    side = 2 * math.pi * rng.random()
    for one, share in zip(over, shares, strict=True):
        drawn[one.name] = one.at(share)
        flight = with_value(flight, one.name, drawn[one.name], side)
    return flight.check_and_step().check_start(), drawn
