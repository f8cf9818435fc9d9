"""A case of a challenge set, drawn from a seed: vehicle, plans, sensors and, apart from them,
effects.
"""

import dataclasses as dc
import hashlib
import math
from collections.abc import Sequence

import numpy as np

from diagrams.challenge.generate.logged_input import LoggedInput, draw_logged_input
from diagrams.challenge.generate.magnitudes import draw_effect
from diagrams.challenge.generate.sensor_quality import WILD, SensorQuality, draw_sensor_quality
from diagrams.challenge.generate.trajectories import draw_plans
from diagrams.challenge.generate.vehicles import draw_vehicle
from diagrams.challenge.out_of_library.draw import draw_out_of_library
from diagrams.challenge.simulators.flight_plan import Plan
from np_drake.effects.base import Effect
from np_drake.vehicle import Vehicle

CLEAN, OUT_OF_LIBRARY = "clean", "foreign"  # kinds of cases
FILES = ("train_1.csv", "train_2.csv", "heldout_1.csv")
# Streams of random numbers that do not touch each other: the effect decides about nothing else.
_VEHICLE, _PLANS, _SENSORS, _EFFECT, _ONSET, NOISE, _INPUT = range(7)


@dc.dataclass(frozen=True)
class CaseDraw:
    """The settings of a case before anything is drawn: index in the set, kind, and names of its
    effects.

    kind: single | pair | triple | onset | clean | foreign.   attempt: how many draws failed before.
    """

    index: int
    kind: str
    names: tuple[str, ...] = ()
    attempt: int = 0

    @property
    def out_of_library(self) -> bool:
        """Return whether its effects are not in the library."""
        return self.kind == OUT_OF_LIBRARY

    def stream(self, seed: int, which: int, flight: int = 0) -> np.random.Generator:
        """Return the random numbers of one purpose.

        Args:
            which: the purpose, one of the streams of this module.
            flight: number of the flight, where it is drawn for each.
        """
        return np.random.default_rng([seed, self.index, self.attempt, which, flight])


@dc.dataclass(frozen=True)
class Case:
    """A case as drawn; `effects` and `onset` hold the truth; onset by file [s], None: from the
    start.
    """

    name: str
    draw: CaseDraw
    seed: int
    seconds: float
    vehicle: Vehicle
    quality: SensorQuality
    plans: dict[str, Plan]
    effects: tuple[Effect, ...]
    onset: dict[str, float | None]
    input: LoggedInput = dc.field(default_factory=LoggedInput)

    def instants(self, file: str) -> np.ndarray:
        """Return the times (n,) of the rows of a flight, before any is dropped [s]."""
        rng = self.draw.stream(self.seed, _SENSORS, FILES.index(file) + 1)
        return self.quality.instants(rng, self.seconds)

    def effects_of(self, file: str) -> list[Effect]:
        """Return the effects as they act in one flight: what is random (a gust) differs from flight
        to flight.
        """
        seed = int(self.draw.stream(self.seed, _EFFECT, FILES.index(file) + 1).integers(2**31))
        return [dc.replace(e, seed=seed) if hasattr(e, "seed") else e for e in self.effects]  # type: ignore


def draw_case(draw: CaseDraw, *, quality: str, seed: int, seconds: float) -> Case:
    """Return the case that `draw` names; equal arguments give equal cases.

    Args:
        seconds: length of every flight [s].
    """
    known = SensorQuality(quality)
    vehicle = draw_vehicle(draw.stream(seed, _VEHICLE), known.stated_noise())
    vehicle = dc.replace(vehicle, **known.stated_uncertainty())  # type: ignore[arg-type]
    logged = (
        draw_logged_input(draw.stream(seed, _INPUT), draw.names)
        if quality == WILD
        else LoggedInput()
    )
    if not logged.held:
        vehicle = dc.replace(vehicle, command_timing="unknown")
    spin = math.sqrt(vehicle.mass * vehicle.gravity / 4 / vehicle.thrust_coefficient)
    plans = draw_plans(draw.stream(seed, _PLANS), vehicle, seconds, len(FILES))
    drawn = draw_sensor_quality(quality, draw.stream(seed, _SENSORS), spin)
    if logged.kind == "rotor_speed":
        drawn = dc.replace(drawn, rotor=abs(drawn.rotor))
    return Case(
        name=case_name(seed, draw.index),
        draw=draw,
        seed=seed,
        seconds=seconds,
        vehicle=vehicle,
        quality=drawn,
        plans=dict(zip(FILES, plans, strict=True)),
        effects=tuple(_draw_effects(draw, draw.stream(seed, _EFFECT), vehicle, seconds)),
        onset=_draw_onset(draw, draw.stream(seed, _ONSET), seconds),
        input=logged,
    )


def case_name(seed: int, index: int) -> str:
    """Return a folder's name that tells nothing, not even the order in which cases were drawn."""
    return hashlib.sha256(f"challenge {seed} {index}".encode()).hexdigest()[:10]


def _draw_effects(
    draw: CaseDraw, rng: np.random.Generator, vehicle: Vehicle, seconds: float
) -> Sequence[Effect]:
    """Return the effects of a case, each name once (a wind's drag may be there already)."""
    if draw.out_of_library:
        return [draw_out_of_library(name, rng, vehicle) for name in draw.names]
    effects: dict[str, Effect] = {}
    for name in draw.names:
        for effect in draw_effect(name, rng, vehicle, seconds):
            effects.setdefault(effect.identifier, effect)
    return list(effects.values())


def _draw_onset(
    draw: CaseDraw, rng: np.random.Generator, seconds: float
) -> dict[str, float | None]:
    """Draw onsets by file [s]: mid-flight in the first flight, mid-flight or from the start in the
    others.
    """
    onset: dict[str, float | None] = dict.fromkeys(FILES)
    if draw.kind == "onset":
        first, second, held_out = FILES
        times = np.round(rng.uniform(0.25, 0.75, 3) * seconds, 2)
        onset[first] = float(times[0])
        onset[second] = float(times[1]) if rng.random() < 0.5 else None
        onset[held_out] = float(times[2]) if rng.random() < 0.3 else None
    return onset
