"""Next flight in the simulator under each explanation that stands: limits that it keeps, and what
its log tells.
"""

import copy
import dataclasses as dc
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from diagrams.gap.next_flight import RATE, TRACK, DiagnosisReport
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, LostVehicle, fly
from np_drake import attitude
from np_drake.diagnosis.calibration import with_fixed_effects
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.effects.effect_entry import EffectEntry
from np_drake.effects.explanation import Explanation
from np_drake.effects.posterior import Posterior
from np_drake.files.number_text import number
from np_drake.flight_design.limits import Limits
from np_drake.flight_design.multisine import FadedMultisine
from np_drake.flight_design.prediction import predict
from np_drake.references.track_file import write_trajectory

ROOM = 0.95  # of what a limit leaves that a smaller motion takes [1]; own choice
TRIES = 4  # of making it smaller
PROBE = 3.5  # of the smallest motion, flown before all else [s]; own choice
STEP = 0.01  # of the simulator, which is fine enough for limits [s]; own choice


class CannotFly(ValueError):
    """No motion of a kind keeps the limits, in one line with the remedy."""


@dc.dataclass(frozen=True)
class Flown:
    """Flight under one explanation.

    usage: share of each limit that was used [1]; empty where the vehicle was lost.
    posterior: (n,) probability of each explanation that the log alone gives the diagnosis [1].
    lost: why the vehicle was lost; empty where it was not.
    """

    explanation: Explanation
    usage: dict[str, float]
    posterior: np.ndarray
    lost: str = ""

    @property
    def worst(self) -> float:
        """Largest share of a limit that was used; infinite where the vehicle was lost [1]."""
        return max(self.usage.values(), default=np.inf)


@dc.dataclass(frozen=True)
class InSimulator:
    """Flies a motion under an explanation, along the trajectory `TRACK` that it writes.

    config: corrected simulator, with the controller that will fly.
    report: whose explanations the log is to tell. folder: of the trajectory file.
    seed: of the noise.
    """

    config: FlightConfig
    report: DiagnosisReport
    limits: Limits
    folder: Path
    seed: int = 0

    def __call__(self, motion: FadedMultisine, explanation: Explanation) -> Flown:
        """Return the flight of a motion under an explanation."""
        track, report = self.folder / TRACK, self.report
        write_trajectory(motion, track, RATE, duration=motion.end, vehicle=self.limits.vehicle)
        try:
            flight = fly(scenario_of(self.config, explanation, track, motion.end), seed=self.seed)
        except LostVehicle as error:
            return Flown(
                explanation, {}, np.full(len(report.explanations), np.nan), lost=str(error)
            )
        residuals = make_flight_residuals(
            flight.log(), flight.config.vehicle, report.readings.noise.step
        )
        residuals = with_fixed_effects(residuals)
        told = predict(residuals, report.explanations, report.readings)
        posterior = np.exp(told.information.log_posterior(told.seen))
        return Flown(explanation, flown_usage(flight, self.limits), posterior)


def scenario_of(
    config: FlightConfig, explanation: Explanation, track: Path, seconds: float
) -> FlightConfig:
    """Return the scenario of a corrected simulator with another explanation, along the track of a
    file.

    Args:
        seconds: length of the flight [s].
    """
    effects = [EffectEntry.of(effect) for effect in explanation.effects]
    reality = dc.replace(config.reality, effects=effects, posterior=Posterior())
    reference = dc.replace(config.reference, track=str(track), dither=[0.0, 0.0, 0.0])
    changed = dc.replace(config, duration=seconds, reality=reality, reference=reference)
    changed.simulator = copy.copy(config.simulator)
    changed.simulator.max_step_size = STEP
    return changed.check_and_step()


def flown_usage(flight: FlightResult, limits: Limits) -> dict[str, float]:
    """Return the share of each limit that a flight used in truth, by name [1]."""
    x, u = flight.signals["x_true"], flight.config.vehicle.saturate(flight.signals["u"])
    up = attitude.rotate(x[:, 3:7], np.tile([0.0, 0.0, 1.0], (len(x), 1)))
    found = {
        "room": limits.room(x[:, :3]),
        "speed": float(np.linalg.norm(x[:, 7:10], axis=1).max()) / limits.speed,
        "tilt": float(np.arccos(np.clip(up[:, 2], -1.0, 1.0)).max()) / limits.tilt,
        "thrust": limits.thrust(u @ limits.vehicle.unmixer.T),
    }
    payload = flight.payload_position
    if payload is not None:
        hook = x[:, :3] + attitude.rotate(
            x[:, 3:7], np.tile(flight.config.reality.hung.hook, (len(x), 1))
        )
        tether = payload - hook
        angle = np.arctan2(np.linalg.norm(tether[:, :2], axis=1), -tether[:, 2])
        found["swing"] = float(angle.max()) / limits.swing
    return found


def keep_limits(
    motion: FadedMultisine,
    explanations: Sequence[Explanation],
    fly_one: Callable[[FadedMultisine, Explanation], Flown],
    *,
    controller: str,
    limits: Limits,
    tell: Callable[[float], None] | None = None,
) -> tuple[FadedMultisine, list[Flown]]:
    """Fly a motion under every explanation, made smaller until every flight keeps the limits.

    Args:
        tell: called with the share done [1].
    Raises: CannotFly: if even the smallest motion tried breaks a limit.
    """
    _require_flyable(motion, explanations, fly_one, controller, limits)
    order = list(range(len(explanations)))
    for attempt in range(TRIES):
        flown: dict[int, Flown] = {}
        for k in order:
            flown[k] = fly_one(motion, explanations[k])
            if tell is not None:
                tell(len(flown) / len(order))
            if flown[k].worst > 1.0:
                break
        else:
            return motion, [flown[k] for k in sorted(flown)]
        worst = flown[k]
        order = [k, *(i for i in order if i != k)]  # the next try begins where this one failed
        if attempt + 1 < TRIES:
            motion = motion.scaled(max(0.5, ROOM / worst.worst))
    raise _breaks(worst, controller, limits)


def _require_flyable(
    motion: FadedMultisine,
    explanations: Sequence[Explanation],
    fly_one: Callable[[FadedMultisine, Explanation], Flown],
    controller: str,
    limits: Limits,
) -> None:
    """Check by a few seconds of the smallest motion that would be tried that it keeps the limits.

    Raises: CannotFly: if it does not.
    """
    least = dc.replace(motion.scaled(0.5 ** (TRIES - 1)), end=min(motion.end, PROBE))
    for explanation in explanations:
        flown = fly_one(least, explanation)
        if flown.worst > 1.0:
            raise _breaks(flown, controller, limits)


def _breaks(flown: Flown, controller: str, limits: Limits) -> CannotFly:
    """Return the error of a flight that breaks a limit however small its motion is."""
    most = max(flown.usage, key=lambda name: flown.usage[name], default="")
    why = flown.lost.rstrip(".") or f"{most} is {number(flown.usage[most])} of its limit"
    remedy = "Name another --controller" + (
        ", give --no-fly" if flown.lost else _wider(most, limits)
    )
    return CannotFly(
        f"limits: no motion keeps them with controller {controller}: {why} under "
        f"{flown.explanation.brief}. {remedy}."
    )


def _wider(name: str, limits: Limits) -> str:
    """Return which option widens a limit, and its present value; empty where none does, as of the
    thrust.
    """
    now = {
        "room": f"--box (now {' '.join(number(side) for side in limits.box)} m)",
        "speed": f"--speed (now {number(limits.speed)} m/s)",
        "tilt": f"--tilt (now {number(limits.tilt)} rad)",
    }
    return f", or widen {now[name]}" if name in now else ""
