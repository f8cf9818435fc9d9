"""Designed flight flown in the simulator under each explanation: limits that it keeps, and what its log tells."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, LostVehicle, fly
from np_drake import attitude
from np_drake.diagnosis.numerics import Readings
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.effects.effect_entry import EffectEntry
from np_drake.effects.explanation import Explanation
from np_drake.effects.posterior import Posterior
from np_drake.flight_design.design import Candidate, FlightDesigner
from np_drake.flight_design.expected_residual import seen_in
from np_drake.flight_design.limits import Limits
from np_drake.references.track_file import write_trajectory

ROOM = 0.95  # of what a limit leaves that a shrunk motion takes [1]; own choice
TRIES = 4  # of shrinking
RATE = 100.0  # of the trajectory file [Hz]
FILE = "next_flight.csv"


@dc.dataclass(frozen=True)
class Flown:
    """Flight of a design under one explanation.

    usage: share of each limit that was used [1]; empty where the vehicle was lost.
    posterior: (n,) probability of each explanation that the log alone gives the diagnosis [1].
    lost: why the vehicle was lost; empty where it was not.
    """

    explanation: Explanation
    usage: dict[str, float]
    posterior: np.ndarray
    lost: str = ""
    flight: FlightResult | None = None

    @property
    def worst(self) -> float:
        """Largest share of a limit that was used; infinite where the vehicle was lost [1]."""
        return max(self.usage.values(), default=np.inf)


def scenario_of(config: FlightConfig, explanation: Explanation, track: Path, seconds: float) -> FlightConfig:
    """Return the scenario of a corrected simulator with another explanation, along the track of a file."""
    effects = [EffectEntry.of(effect) for effect in explanation.effects]
    reality = dc.replace(config.reality, effects=effects, posterior=Posterior())
    reference = dc.replace(config.reference, track=str(track), dither=[0.0, 0.0, 0.0])
    changed = dc.replace(config, duration=seconds, reality=reality, reference=reference)
    return changed.check_and_step()


def fly_under(
    config: FlightConfig, explanation: Explanation, designer: FlightDesigner, track: Path, seed: int
) -> Flown:
    """Fly the track of a file under an explanation, and return limits and what the log tells.

    Args:
        config: corrected simulator, with the controller that will fly.
        explanation: that acts.
        designer: whose explanations and limits count.
        track: trajectory file.
        seed: of the noise.
    """
    nothing = np.full(len(designer.explanations), np.nan)
    try:
        flight = fly(scenario_of(config, explanation, track, designer.seconds), seed=seed)
    except LostVehicle as error:
        return Flown(explanation, {}, nothing, lost=str(error))
    posterior = told_by(flight, designer.explanations, designer.readings)
    return Flown(explanation, flown_usage(flight, designer.limits), posterior, flight=flight)


def told_by(flight: FlightResult, explanations: Sequence[Explanation], readings: Readings) -> np.ndarray:
    """Return the probability (n,) of each explanation given the log of a flight."""
    residuals = make_flight_residuals(flight.log(), flight.config.vehicle, readings.noise.step)
    information, seen = seen_in(residuals, explanations, readings)
    return np.exp(information.log_posterior(seen))


def flown_usage(flight: FlightResult, limits: Limits) -> dict[str, float]:
    """Return the share of each limit that a flight used, by name [1]."""
    s = flight.signals
    x = s["x_true"]
    found = usage_of(x, flight.config.vehicle.saturate(s["u"]), limits)
    payload = flight.payload_position
    if payload is not None:
        hook = x[:, :3] + attitude.rotate(x[:, 3:7], np.tile(flight.config.reality.hung.hook, (len(x), 1)))
        tether = payload - hook
        angle = np.arctan2(np.linalg.norm(tether[:, :2], axis=1), -tether[:, 2])
        found["swing"] = float(angle.max()) / limits.swing
    return found


def usage_of(x: np.ndarray, u: np.ndarray, limits: Limits) -> dict[str, float]:
    """Return the share of each limit that true states x (n, 13) and commands u (n, 4) use, by name [1]."""
    up = attitude.rotate(x[:, 3:7], np.tile([0.0, 0.0, 1.0], (len(x), 1)))
    return {
        "room": limits.room(x[:, :3]),
        "speed": float(np.linalg.norm(x[:, 7:10], axis=1).max()) / limits.speed,
        "tilt": float(np.arccos(np.clip(up[:, 2], -1.0, 1.0)).max()) / limits.tilt,
        "thrust": limits.thrust(u @ limits.vehicle.unmixer.T),
    }


@dc.dataclass(frozen=True)
class InSimulator:
    """Flights of a candidate in the corrected simulator, along the trajectory `FILE` that it writes.

    config: corrected simulator, with the controller that will fly.   designer: whose explanations and limits count.
    folder: of the trajectory file.   seed: of the noise.
    """

    config: FlightConfig
    designer: FlightDesigner
    folder: Path
    seed: int = 0

    def __call__(self, candidate: Candidate, explanation: Explanation) -> Flown:
        """Return the flight of a candidate under an explanation."""
        designer, track = self.designer, self.folder / FILE
        write_trajectory(
            candidate.reference, track, RATE, duration=designer.seconds, vehicle=designer.limits.vehicle
        )
        return fly_under(self.config, explanation, designer, track, self.seed)


def keep_limits(
    candidate: Candidate,
    designer: FlightDesigner,
    fly_one: Callable[[Candidate, Explanation], Flown],
    *,
    controller: str,
    tell: Callable[[float], None] | None = None,
) -> tuple[Candidate, list[Flown]]:
    """Fly a candidate under every explanation, shrunk until every flight keeps the limits.

    Args:
        candidate: the design.
        designer: whose explanations and limits count.
        fly_one: flies a candidate under an explanation.
        controller: kind that flies, for the message.
        tell: called with the share done [1].
    Raises: ValueError: if even the smallest motion tried breaks a limit; one line with the remedy.
    """
    order = list(range(len(designer.explanations)))
    for attempt in range(TRIES):
        flown: dict[int, Flown] = {}
        for k in order:
            flown[k] = fly_one(candidate, designer.explanations[k])
            if tell is not None:
                tell(len(flown) / len(order))
            if flown[k].worst > 1.0:
                break
        else:
            return candidate, [flown[k] for k in sorted(flown)]
        worst = flown[k]
        order = [k, *(i for i in order if i != k)]  # the next try begins where this one failed
        if attempt + 1 < TRIES:
            candidate = designer.shrunk(candidate, max(0.5, ROOM / worst.worst))
    why = worst.lost or f"{max(worst.usage, key=lambda n: worst.usage[n])} is {worst.worst:.2f} of its limit"
    raise ValueError(
        f"limits: no motion keeps them with controller {controller}: {why} under "
        f"{worst.explanation.label}. Name another controller, or wider limits."
    )
