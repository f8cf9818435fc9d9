"""Leave-one-manoeuvre-out study of forecasts on payload flights."""

import dataclasses as dc
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from diagrams.challenge.real.forecast.bound import BoundCheck, check_bound
from diagrams.challenge.real.forecast.folds import PayloadFlight, drag_beside, told
from diagrams.challenge.real.forecast.rows import HISTORY, PERSISTENCE, ROWS, TOLD_ROWS, segments_of
from diagrams.challenge.real.forecast.scores import Score, diverged, pooled, score
from diagrams.challenge.real.forecast.swing import (
    VELOCITY_ALONE,
    Swing,
    payload_on,
    swing_of,
    swing_of_flights,
)
from np_drake.residual_models.base import ResidualModel
from np_drake.residual_models.flight_walk import MOTIONS
from np_drake.residual_models.pendulum_payload import PayloadEstimate

HORIZONS = (0.02, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)  # [s]
OnFold = Callable[[int, int, str], None]


class FlownPayload(NamedTuple):
    """Payload that a row estimates at the end of a flight."""

    row: str
    flight: str
    manoeuvre: str
    estimate: PayloadEstimate


@dc.dataclass
class Study:
    """Results: scores of every row on every flight, and by row the swing and training time [s] of every fold.

    payloads: of rows that estimate the payload in flight, the estimate at the end of every flight.
    bounds: of rows whose matrices change from solve to solve, the check of their bound on every flight.
    """

    step: float
    horizons: list[int]
    scores: list[Score] = dc.field(default_factory=list)
    swings: dict[str, list[Swing]] = dc.field(default_factory=dict)
    walls: dict[str, list[float]] = dc.field(default_factory=dict)
    payloads: list[FlownPayload] = dc.field(default_factory=list)
    bounds: list[BoundCheck] = dc.field(default_factory=list)

    def lines(self) -> list[dict[str, Any]]:
        """Return ratio and RMSE by row, coming motion, kind and horizon, see `pooled`."""
        return pooled(self.scores, self.horizons, self.step)

    def models(self) -> list[dict[str, Any]]:
        """Return by row its divergent flights, and length and damping of its tether of every fold."""
        flown = len({s.flight for s in self.scores})
        scored = list(dict.fromkeys(s.row for s in self.scores))
        return [
            {
                "row": name,
                "flights": flown,
                "diverged": {m: diverged(self.scores, name, m) for m in MOTIONS} if name in scored else {},
                **self._tether(name),
                "training": self.walls.get(name, []),
            }
            for name in [*scored, *(n for n in self.swings if n not in scored)]
        ]

    def _tether(self, name: str) -> dict[str, list[float]]:
        """Return length and damping of every fold, or of every flight where the row estimates them in flight."""
        estimates = [flown.estimate for flown in self.payloads if flown.row == name]
        if estimates:
            return {
                "length": [estimate.length.mean for estimate in estimates],
                "damping": [estimate.damping.mean for estimate in estimates],
            }
        swings = self.swings.get(name, ())
        return {
            "length": [swing.length for swing in swings],
            "damping": [swing.damping for swing in swings],
        }


def steps_of(horizons: Sequence[float], step: float) -> list[int]:
    """Return the horizons [s] in whole steps, ascending, at least one."""
    return sorted({max(1, round(h / step)) for h in horizons})


def run_study(
    flights: Sequence[PayloadFlight],
    names: Sequence[str],
    *,
    step: float,
    on_fold: OnFold = lambda done, total, text: None,
) -> Study:
    """Train each row on all manoeuvres but one and score it on that one, in turn.

    Args: names: rows, persistence among them.   step: [s].   on_fold: called with (done, total, what comes).
    """
    study = Study(step, steps_of(HORIZONS, step))
    manoeuvres = list(dict.fromkeys(flight.manoeuvre for flight in flights))
    for i, manoeuvre in enumerate(manoeuvres):
        learned = [flight for flight in flights if flight.manoeuvre != manoeuvre]
        held_out = [flight for flight in flights if flight.manoeuvre == manoeuvre]
        for j, name in enumerate(names):
            on_fold(i * len(names) + j, len(manoeuvres) * len(names), f"{manoeuvre} held out: {name}")
            _run_row(study, name, learned, held_out)
        if any(name in study.swings for name in ROWS):
            _note(study, VELOCITY_ALONE, swing_of_flights(segments_of(_opened(learned), step)))
    on_fold(1, 1, "")
    return study


def _run_row(
    study: Study, name: str, learned: Sequence[PayloadFlight], held_out: Sequence[PayloadFlight]
) -> None:
    """Train and score one row of one fold."""
    step, started = study.step, time.perf_counter()
    models: list[ResidualModel]
    if name in TOLD_ROWS:
        rest = drag_beside(learned, step) if TOLD_ROWS[name] else None
        models = [told(flight, step, rest) for flight in held_out]
    else:
        models = [ROWS[name](_opened(learned), step)] * len(held_out)
        _note(study, name, swing_of(models[0]))
    study.walls.setdefault(name, []).append(time.perf_counter() - started)
    for flight, model in zip(held_out, models, strict=True):
        opened = (flight.log, flight.vehicle)
        study.scores += score(name, model, opened, study.horizons, first=round(HISTORY / step))
        checked = check_bound(model, opened, study.horizons, first=round(HISTORY / step))
        study.bounds += [checked] if checked is not None else []
        estimate = payload_on(model, opened)
        if estimate is not None:
            study.payloads.append(FlownPayload(name, flight.log.name, flight.manoeuvre, estimate))


def _opened(flights: Sequence[PayloadFlight]) -> list:
    return [(flight.log, flight.vehicle) for flight in flights]


def _note(study: Study, name: str, swing: Swing | None) -> None:
    if swing is not None:
        study.swings.setdefault(name, []).append(swing)


def persistence_rmse(lines: Sequence[dict[str, Any]]) -> dict[str, list[float]]:
    """Return the RMSE of persistence by kind, over the horizons [N, N·m]."""
    own = [line for line in lines if line["row"] == PERSISTENCE and line["motion"] == MOTIONS[0]]
    kinds = dict.fromkeys(line["kind"] for line in own)
    return {kind: [float(np.float64(x["rmse"])) for x in own if x["kind"] == kind] for kind in kinds}
