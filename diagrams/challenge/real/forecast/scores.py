"""Squared errors of forecasts on each flight, and their ratio to persistence pooled over
flights.
"""

import dataclasses as dc
from collections.abc import Sequence
from typing import Any

import numpy as np

from diagrams.challenge.real.forecast.rows import PERSISTENCE
from np_drake.flight_log import FlightLog
from np_drake.labels import ReadsLabels
from np_drake.residual_model import ResidualModel
from np_drake.skill.flight_skill import DIVERGED
from np_drake.skill.skill import MOTIONS, flight_forecasts
from np_drake.training_data.training_segments import sampled_flight
from np_drake.vehicle import Vehicle

KINDS = {
    "lateral force": slice(0, 2),
    "force": slice(0, 3),
    "torque": slice(3, 6),
}  # channels of chi
DRAWS = 2000  # of the flights, for the interval [1]


@dc.dataclass(frozen=True)
class Score:
    """Errors of one row on one flight with one coming motion.

    square: (kinds, H) sum over origins of the squared error [N², N²m²].   count: (H,) origins.
    peak: (2,) longest forecast of force and torque over the longest label [1]; inf where one is no
        number.
    """

    row: str
    flight: str
    motion: str
    square: np.ndarray
    count: np.ndarray
    peak: np.ndarray

    @property
    def diverged(self) -> bool:
        """Whether a forecast is longer than `DIVERGED` times the longest label."""
        return bool(np.any(self.peak > DIVERGED))


def score(
    row: str,
    model: ResidualModel,
    opened: tuple[FlightLog, Vehicle],
    horizons: list[int],
    *,
    first: int,
) -> list[Score]:
    """Return the scores of a model on a flight, one for each coming motion.

    Every origin from `first` on counts whose target, the label averaged over a step, is there. A
    model that reads labels of its own low-pass gets these; the targets stay.

    Args:
        horizons: ascending [steps].
        first: sample [1].
    Raises: ValueError: if the flight holds no origin.
    """
    flight = sampled_flight(*opened, step=model.step)
    if len(flight) <= first + horizons[0]:
        raise ValueError(
            f"score: {opened[0].name} must last more than "
            f"{(first + horizons[0]) * model.step:.3g} s; it ends before."
        )
    seen = flight
    if isinstance(model, ReadsLabels):
        seen = sampled_flight(*opened, step=model.step, label=model.label)
    goal = np.full((len(flight) - first, len(horizons), 6), np.nan)
    for i, h in enumerate(horizons):
        goal[: max(len(flight) - first - h, 0), i] = flight.chi[first + h :]
    there = np.isfinite(goal).all(axis=-1)
    longest = _lengths(flight.chi[np.isfinite(flight.chi).all(axis=1)]).max(axis=0)
    found = []
    for motion in MOTIONS:
        with np.errstate(over="ignore", invalid="ignore"):
            chi_hat = flight_forecasts(model, seen, horizons, first=first, motion=motion)
            error = np.where(there[..., None], (chi_hat - goal) ** 2, 0.0)
            square = np.array([error[..., part].sum(axis=(0, 2)) for part in KINDS.values()])
            peak = _lengths(chi_hat[there]).max(axis=0) / longest
        peak = np.where(np.isfinite(peak), peak, np.inf)
        found.append(Score(row, opened[0].name, motion, square, there.sum(axis=0), peak))
    return found


def _lengths(chi: np.ndarray) -> np.ndarray:
    """Return the length of force [N] and torque [N·m], (n, 2), of chi (n, 6)."""
    return np.stack(
        [np.linalg.norm(chi[:, :3], axis=1), np.linalg.norm(chi[:, 3:], axis=1)], axis=1
    )


def pooled(scores: Sequence[Score], horizons: list[int], step: float) -> list[dict[str, Any]]:
    """Return a line for every row, coming motion, kind and horizon: RMSE, its ratio to persistence
    and its interval.

    Pooled: root of all flights' squared errors over those of persistence. Interval: 95 %, from
    flights drawn with replacement (bootstrap).

    Args:
        horizons: as of the scores [steps].
        step: [s].
    """
    names = list(dict.fromkeys(s.row for s in scores))
    flights = list(dict.fromkeys(s.flight for s in scores))
    found = {(s.row, s.motion, s.flight): s for s in scores}
    drawn = np.random.default_rng(0).multinomial(
        len(flights), [1 / len(flights)] * len(flights), DRAWS
    )
    lines = []
    for motion in MOTIONS:
        count = np.array([found[PERSISTENCE, motion, flight].count for flight in flights])
        base = np.array([found[PERSISTENCE, motion, flight].square for flight in flights])
        for name in names:
            square = np.array([found[name, motion, flight].square for flight in flights])
            with np.errstate(invalid="ignore", over="ignore"):
                over, under = (np.tensordot(drawn, s, axes=1) for s in (square, base))
                low, high = np.percentile(np.sqrt(over / under), [2.5, 97.5], axis=0)
                ratio = np.sqrt(square.sum(axis=0) / base.sum(axis=0))
                rmse = np.sqrt(square.sum(axis=0) / count.sum(axis=0))
            for k, kind in enumerate(KINDS):
                for i, h in enumerate(horizons):
                    lines.append(
                        {
                            "row": name,
                            "motion": motion,
                            "kind": kind,
                            "horizon": h * step,
                            "rmse": float(rmse[k, i]),
                            "ratio": float(ratio[k, i]),
                            "interval": [float(low[k, i]), float(high[k, i])],
                        }
                    )
    return lines


def diverged(scores: Sequence[Score], row: str, motion: str) -> list[str]:
    """Return the flights on which a row diverges.

    Args:
        motion: coming motion, one of `MOTIONS`.
    """
    return [s.flight for s in scores if s.row == row and s.motion == motion and s.diverged]
