"""Flights drawn at random over the envelope of a vehicle: payload, tether, track, speed, thrust,
wind, what no pendulum explains, and what happens in flight.

Sizes stand for the paper's vehicle and scale with another.
"""

import dataclasses as dc
import math
from collections.abc import Callable

import numpy as np

from diagrams.loop.controller_config import ControllerConfig
from diagrams.loop.flight import FlightConfig
from diagrams.loop.reality import RealityConfig
from diagrams.loop.scaled import scaled
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.effect_entry import EffectEntry
from np_drake.payload_filter.predictor import RAW
from np_drake.references.config import ReferenceConfig
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import ratios
from systems.payload_config import PayloadConfig, PayloadEvent, release

DURATION = 10.0  # of a flight after its ramp [s]
MASS = (0.03, 0.5)  # of the payload, up to a third of the paper's vehicle [kg]
BARE = 0.1  # share of flights without payload [1]
LENGTH = (0.37, 1.75)  # of the tether, evenly in its logarithm [m]
SPEED = (0.4, 2.75)  # along the track [m/s]
RADIUS = (0.8, 1.6)  # of a circle [m]
RAMP = (2.5, 5.0)  # to the track's speed [s]
DITHER = (0.0, 0.04, 0.08)  # RMS of the dither in x and y, half of it in z [m]
THRUST = (0.92, 1.02)  # real over nominal thrust [1]
WINDY = 1 / 3  # share of flights in wind [1]
WIND = 4.0  # standard deviation of the wind in x and y [m/s]
TURBULENCE = 0.3  # largest standard deviation of its gusts, over the wind [1]
HEIGHT = 2.5  # of the track, room for the longest tether [m]
ADDED = (0.03, 0.2)  # mass hung on in flight [kg]
HAPPENS = (0.4, 0.7)  # when something does, of the duration [1]
# Of the simulator, or less where a short cable with a light payload is stiffer [s].
CABLE_STEP = 0.0015
TRACKS = ("circle", "lemniscate", "hover")
HOW_OFTEN = (0.6, 0.3, 0.1)
EVENTS = ("attach", "release")
Draw = Callable[[np.random.Generator, RealityConfig], None]


def _rope(rng: np.random.Generator, reality: RealityConfig) -> None:
    payload = reality.payload
    payload.rope_mass = payload.mass * float(rng.uniform(0.1, 0.5))
    payload.segments = 3


def _two_payloads(rng: np.random.Generator, reality: RealityConfig) -> None:
    payload = reality.payload  # a single point mass of a rope hangs halfway
    payload.rope_mass = payload.mass * float(rng.uniform(0.3, 1.0))
    payload.segments = 1
    payload.mass *= 0.7


def _payload_drag(rng: np.random.Generator, reality: RealityConfig) -> None:
    reality.payload.air_damping = float(rng.uniform(0.3, 1.5))


def _spring(rng: np.random.Generator, reality: RealityConfig) -> None:
    reality.payload.stiffness = math.exp(rng.uniform(math.log(60.0), math.log(400.0)))
    reality.payload.damping = float(rng.uniform(1.0, 8.0))


def _gusts(rng: np.random.Generator, reality: RealityConfig) -> None:
    reality.wind = [*(3.0 * rng.standard_normal(2)).tolist(), 0.0]
    reality.gust = float(rng.uniform(0.5, 2.0))
    reality.gust_seed = int(rng.integers(2**31))


def _displaced_mass(rng: np.random.Generator, reality: RealityConfig) -> None:
    reality.effects = [EffectEntry.of(CenterOfMassOffset(*rng.normal(0.0, 0.012, 3).tolist()))]


PLAIN = "pendulum"
# What no pendulum explains, by name
BEYOND: dict[str, Draw] = {
    "rope": _rope,
    "two payloads": _two_payloads,
    "payload drag": _payload_drag,
    "spring": _spring,
    "gusts": _gusts,
    "displaced mass": _displaced_mass,
}
HANGING = ("rope", "two payloads", "payload drag", "spring")  # of these, what needs a payload


@dc.dataclass(frozen=True)
class Envelope:
    """What flights are drawn from.

    kinds: names of `BEYOND`, or `PLAIN`, all as likely.
    happening: share of flights in which something happens to the payload [1].
    """

    kinds: tuple[str, ...] = (PLAIN, PLAIN, *BEYOND)
    happening: float = 1 / 4


def drawn_flight(
    number: int, envelope: Envelope, *, seed: int, vehicle: Vehicle
) -> tuple[str, FlightConfig]:
    """Return kind and flight of a number.

    Raises: ValueError: where this vehicle cannot fly what was drawn.
    """
    rng = np.random.default_rng([seed, number])
    track = str(rng.choice(TRACKS, p=HOW_OFTEN))
    dither = 0.08 if track == "hover" else float(rng.choice(DITHER))
    reference = ReferenceConfig(track=track, height=HEIGHT, dither=[dither, dither, dither / 2])
    speed, radius, ramp = (float(rng.uniform(*span)) for span in (SPEED, RADIUS, RAMP))
    if track != "hover":
        reference = dc.replace(reference, speed=speed, ramp=ramp)
    if track == "circle":
        reference = dc.replace(reference, radius=radius)
    kind = str(rng.choice(envelope.kinds))
    happens = rng.random() < envelope.happening
    payload = PayloadConfig(
        mass=float(rng.uniform(*MASS)), length=math.exp(rng.uniform(*np.log(LENGTH)))
    )
    if kind not in HANGING and not happens and rng.random() < BARE:
        payload = PayloadConfig(tether="none")
    reality = RealityConfig(payload=payload, thrust_scale=float(rng.uniform(*THRUST)))
    if rng.random() < WINDY:
        wind = WIND * rng.standard_normal(2)
        reality.wind = [*wind.tolist(), 0.0]
        reality.gust = float(rng.uniform(0.0, TURBULENCE) * np.linalg.norm(wind))
        reality.gust_seed = number
    if kind in BEYOND:
        BEYOND[kind](rng, reality)
    config = FlightConfig(
        "drawn", DURATION, True, vehicle, reality, reference, ControllerConfig(solver="sqp")
    )
    config.controller.label = RAW
    if happens:
        at = reference.ramp + DURATION * float(rng.uniform(*HAPPENS))
        cut = str(rng.choice(EVENTS)) == "release"
        added = float(rng.uniform(*ADDED))
        config.events = [release(at) if cut else PayloadEvent("attach", at, mass=added)]
    config.simulator.max_step_size = CABLE_STEP
    config = scaled(config)
    for entry in config.reality.effects:
        size = ratios(vehicle).length
        entry.parameters = {name: size * value for name, value in entry.parameters.items()}
    config.simulator.max_step_size = min(config.simulator.max_step_size, config.largest_step)
    return kind, config.check()
