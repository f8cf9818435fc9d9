"""Leave-one-manoeuvre-out study of forecasts on payload flights."""

import dataclasses as dc
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from diagrams.batch.arrays import packed, unpacked
from diagrams.batch.campaign import Case
from diagrams.batch.workers import Workers, every_result
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
from np_drake.payload_filter.payload_estimate import Estimate, PayloadEstimate
from np_drake.residual_model import ResidualModel
from np_drake.skill.flight_walk import MOTIONS

HORIZONS = (0.02, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)  # [s]
SCORED = ("square", "count", "peak")  # arrays of a `Score`


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
    """

    step: float
    horizons: list[int]
    scores: list[Score] = dc.field(default_factory=list)
    swings: dict[str, list[Swing]] = dc.field(default_factory=dict)
    walls: dict[str, list[float]] = dc.field(default_factory=dict)
    payloads: list[FlownPayload] = dc.field(default_factory=list)

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
    folder: str = "",
    workers: Workers | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> Study:
    """Train each row on all manoeuvres but one and score it on that one, in turn.

    Args: names: rows, persistence among them.   step: [s].   folder: name of the flights' folder, that campaigns of
    different flights differ.
    Raises: FailedRun: where a row has no result.
    """
    manoeuvres = list(dict.fromkeys(flight.manoeuvre for flight in flights))
    workers, work = workers or Workers(), HoldingOut(tuple(flights), step)
    config = {"folder": folder, "step": step}
    cases = [{"manoeuvre": manoeuvre, "row": name} for manoeuvre in manoeuvres for name in names]
    found = every_result(workers.run(work, cases, config=config, on_progress=on_progress))
    if any(result["swing"] and case["row"] in ROWS for case, result in zip(cases, found, strict=True)):
        beside = [{"manoeuvre": manoeuvre, "row": VELOCITY_ALONE} for manoeuvre in manoeuvres]
        found += every_result(workers.run(work, beside, config=config))
        cases += beside
    study = Study(step, steps_of(HORIZONS, step))
    for case, result in zip(cases, found, strict=True):
        _add(study, case, result)
    return study


@dc.dataclass(frozen=True)
class HoldingOut:
    """Work of a case {"manoeuvre", "row"} -> what the row, trained on the other manoeuvres, shows on that one.

    A result holds "swing" of the model, "wall" of its training [s], and of every flight its scores by coming motion
    and estimate of the payload, where there is any.
    """

    flights: tuple[PayloadFlight, ...]
    step: float

    def __call__(self, case: Case) -> dict[str, Any]:
        """Train and score the row."""
        name, started = case["row"], time.perf_counter()
        learned = [flight for flight in self.flights if flight.manoeuvre != case["manoeuvre"]]
        if name == VELOCITY_ALONE:
            return {"swing": swing_of_flights(segments_of(_opened(learned), self.step)), "flights": []}
        held_out = [flight for flight in self.flights if flight.manoeuvre == case["manoeuvre"]]
        models = self._models(name, learned, held_out)
        swing = None if name in TOLD_ROWS else swing_of(models[0])
        wall = time.perf_counter() - started
        shown = [self._shown(name, f, model) for f, model in zip(held_out, models, strict=True)]
        return {"swing": swing, "wall": wall, "flights": shown}

    def _models(
        self, name: str, learned: Sequence[PayloadFlight], held_out: Sequence[PayloadFlight]
    ) -> list[ResidualModel]:
        """Return the model of every held-out flight, trained on the others or told what hangs below."""
        if name in TOLD_ROWS:
            rest = drag_beside(learned, self.step) if TOLD_ROWS[name] else None
            return [told(flight, self.step, rest) for flight in held_out]
        return [ROWS[name](_opened(learned), self.step)] * len(held_out)

    def _shown(self, name: str, flight: PayloadFlight, model: ResidualModel) -> dict[str, Any]:
        """Return what a model shows on a flight."""
        opened, first = (flight.log, flight.vehicle), round(HISTORY / self.step)
        horizons = steps_of(HORIZONS, self.step)
        scores = score(name, model, opened, horizons, first=first)
        return {
            "flight": flight.log.name,
            "scores": {s.motion: packed({part: getattr(s, part) for part in SCORED}) for s in scores},
            "estimate": payload_on(model, opened),
        }


def _add(study: Study, case: Case, result: dict[str, Any]) -> None:
    """Add the result of a case to the study."""
    name = case["row"]
    if result["swing"]:
        study.swings.setdefault(name, []).append(Swing(*result["swing"]))
    if "wall" in result:
        study.walls.setdefault(name, []).append(result["wall"])
    for shown in result["flights"]:
        flight = shown["flight"]
        study.scores += [Score(name, flight, m, **unpacked(arrays)) for m, arrays in shown["scores"].items()]
        if shown["estimate"]:
            estimate = PayloadEstimate(*(Estimate(*values) for values in shown["estimate"]))
            study.payloads.append(FlownPayload(name, flight, case["manoeuvre"], estimate))


def _opened(flights: Sequence[PayloadFlight]) -> list:
    return [(flight.log, flight.vehicle) for flight in flights]


def persistence_rmse(lines: Sequence[dict[str, Any]]) -> dict[str, list[float]]:
    """Return the RMSE of persistence by kind, over the horizons [N, N·m]."""
    own = [line for line in lines if line["row"] == PERSISTENCE and line["motion"] == MOTIONS[0]]
    kinds = dict.fromkeys(line["kind"] for line in own)
    return {kind: [float(np.float64(x["rmse"])) for x in own if x["kind"] == kind] for kind in kinds}
