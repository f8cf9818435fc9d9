"""A case of a challenge set, drawn from a seed: vehicle, plans, sensors and, apart from them,
effects; and which cases a set holds.
"""

import dataclasses as dc
import hashlib
import math
from itertools import combinations
from pathlib import Path

import numpy as np

from diagrams.evidence.challenge.flight import SIMULATORS
from diagrams.evidence.challenge.out_of_library import DEVELOPMENT, DRAWS, HOLDOUT
from diagrams.evidence.challenge.plans import Plan, draw_plans
from diagrams.evidence.challenge.sensors import QUALITIES, REAL, SensorQuality, draw_sensor_quality
from np_drake.effects.base import Effect, drag_coefficients
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.files.yaml_file import number, read_yaml, word
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle

# kinds of cases
CLEAN = "clean"
OUT_OF_LIBRARY = "foreign"
FILES = ("train_1.csv", "train_2.csv", "heldout_1.csv")
# Streams of random numbers that do not touch each other: the effect decides about nothing else.
_VEHICLE, _PLANS, _SENSORS, _EFFECT, _ONSET, NOISE = range(6)
# the rest: single effects
SHARES = {"pair": 0.15, "triple": 0.08, "onset": 0.12, OUT_OF_LIBRARY: 0.15}
# Physically the same, or nearly so: never in one case together.
EQUIVALENT = (
    {
        "mass_error",
        "thrust_scale",
        "thrust_drift",
        "translational_lift",
        "rotor_inflow",
        "ground_effect",
    },
    {"motor_lag", "command_delay", "clock_offset"},
    {"linear_drag", "quadratic_drag", "rotor_inflow", "constant_wind", "gusty_wind"},
    {"center_of_mass_offset", "weak_rotor", "suspended_payload"},
    {"mass_error", "suspended_payload"},
)
_OTHERS = read_yaml(Path(__file__).with_name("vehicles.yaml"))
VEHICLES = (Vehicle(), *(Vehicle(**fields) for fields in _OTHERS))


def draw_effect(
    name: str, rng: np.random.Generator, vehicle: Vehicle, seconds: float
) -> list[Effect]:
    """Return the effect `name` at a random size for flights of that length [s], and the drag that
    it acts through where it needs one.
    """
    if name in DRAWS:
        return [DRAWS[name](rng, vehicle)]
    effect = LIBRARY[name].of(LIBRARY[name].draw(rng, vehicle, seconds))
    if not effect.needs:
        return [effect]
    return [effect, LinearDrag(*drag_coefficients(rng, vehicle, 0.05, 0.3))]


@dc.dataclass(frozen=True)
class SetRequest:
    """A challenge set; equal requests give equal sets."""

    simulator: str = word("drake", *SIMULATORS)
    quality: str = word("clean", *QUALITIES)  # of the sensors: clean (ideal) | real
    cases: int = number(44, "1", 0)  # with effects
    clean: int = number(20, "1", 0)  # without
    seconds: float = number(20.0, "s", 5, 300)  # length of every flight
    seed: int = 0
    # all `cases` have an out-of-library effect that is held out from the other sets
    unseen: bool = False

    def draws(self) -> "list[CaseDraw]":
        """Draw the cases with an effect and those without, in shuffled order; single effects cycle
        through the library.
        """
        rng = np.random.default_rng([self.seed, 7])
        shares = {OUT_OF_LIBRARY: 1.0} if self.unseen else SHARES
        counts = {kind: round(share * self.cases) for kind, share in shares.items()}
        counts = {"single": self.cases - sum(counts.values()), **counts, CLEAN: self.clean}
        laws = HOLDOUT if self.unseen else DEVELOPMENT
        names = {
            "single": _cycle(rng, [(name,) for name in LIBRARY]),
            "onset": _cycle(rng, [(name,) for name, effect in LIBRARY.items() if effect.begins]),
            OUT_OF_LIBRARY: _cycle(rng, [(name,) for name in laws]),
            "pair": _cycle(rng, [c for c in combinations(LIBRARY, 2) if compatible(c)]),
            "triple": _cycle(rng, [c for c in combinations(LIBRARY, 3) if compatible(c)]),
            CLEAN: _cycle(rng, [()]),
        }
        drawn = [(kind, next(names[kind])) for kind, n in counts.items() for _ in range(n)]
        return [CaseDraw(index, *drawn[i]) for index, i in enumerate(rng.permutation(len(drawn)))]


@dc.dataclass(frozen=True)
class CaseDraw:
    """The settings of a case before anything is drawn.

    kind: single | pair | triple | onset | clean | foreign.   names: of its effects.
    attempt: how many draws failed before.
    """

    index: int
    kind: str
    names: tuple[str, ...] = ()
    attempt: int = 0

    def stream(self, seed: int, which: int, flight: int = 0) -> np.random.Generator:
        """Return the random numbers of one purpose, a stream of this module; `flight` where it is
        drawn for each.
        """
        return np.random.default_rng([seed, self.index, self.attempt, which, flight])


@dc.dataclass(frozen=True)
class Case:
    """A case as drawn; `effects` and `onset` hold the truth; onset by file [s], None: from the
    start.
    """

    draw: CaseDraw
    request: SetRequest
    vehicle: Vehicle
    quality: SensorQuality
    plans: dict[str, Plan]
    effects: tuple[Effect, ...]
    onset: dict[str, float | None]

    def stream(self, which: int, flight: int) -> np.random.Generator:
        """Return the random numbers of one purpose, a stream of this module, in one flight."""
        return self.draw.stream(self.request.seed, which, flight)

    def instants(self, file: str) -> np.ndarray:
        """Return the times (n,) of the rows of a flight, before any is dropped [s]."""
        return self.quality.instants(
            self.stream(_SENSORS, FILES.index(file) + 1), self.request.seconds
        )

    def effects_of(self, file: str) -> list[Effect]:
        """Return the effects as they act in one flight: what is random (a gust) differs from flight
        to flight.
        """
        seed = int(self.stream(_EFFECT, FILES.index(file) + 1).integers(2**31))
        return [dc.replace(e, seed=seed) if hasattr(e, "seed") else e for e in self.effects]  # type: ignore


def draw_case(draw: CaseDraw, request: SetRequest) -> Case:
    """Return the case of a set that `draw` names; equal arguments give equal cases."""
    streams = [draw.stream(request.seed, which) for which in range(NOISE)]
    vehicle = VEHICLES[streams[_VEHICLE].integers(len(VEHICLES))]
    noise = MeasurementNoise(attitude=0.005 if request.quality == REAL else 0.0)
    vehicle = dc.replace(vehicle, measurement_noise=noise, command_timing="held").check()
    spin = math.sqrt(vehicle.mass * vehicle.gravity / 4 / vehicle.thrust_coefficient)
    effects: dict[str, Effect] = {}
    for name in draw.names:  # each once: a wind's drag may be there already
        for effect in draw_effect(name, streams[_EFFECT], vehicle, request.seconds):
            effects.setdefault(effect.identifier, effect)
    onset: dict[str, float | None] = dict.fromkeys(FILES)
    if draw.kind == "onset":
        rng = streams[_ONSET]
        times = np.round(rng.uniform(0.25, 0.75, 3) * request.seconds, 2).tolist()
        # In mid-flight in the first; in mid-flight or from the start in the others.
        begins = (True, rng.random() < 0.5, rng.random() < 0.3)
        onset = {f: t if b else None for f, t, b in zip(FILES, times, begins, strict=True)}
    plans = draw_plans(streams[_PLANS], vehicle, request.seconds, len(FILES))
    return Case(
        draw=draw,
        request=request,
        vehicle=vehicle,
        quality=draw_sensor_quality(request.quality, streams[_SENSORS], spin),
        plans=dict(zip(FILES, plans, strict=True)),
        effects=tuple(effects.values()),
        onset=onset,
    )


def case_name(seed: int, index: int) -> str:
    """Return a folder's name that tells nothing, not even the order in which cases were drawn."""
    return hashlib.sha256(f"challenge {seed} {index}".encode()).hexdigest()[:10]


def compatible(names: tuple[str, ...]) -> bool:
    """Return whether effects can be told apart in principle, and act at different places."""
    if any(len(group & set(names)) > 1 for group in EQUIVALENT):
        return False
    return len({LIBRARY[name].place for name in names}) == len(names)


def _cycle(rng: np.random.Generator, items: list):
    """Yield every item once in random order, then again in another."""
    while True:
        for i in rng.permutation(len(items)):
            yield items[i]
