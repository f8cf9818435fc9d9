"""Leave-one-manoeuvre-out study of forecasts on payload flights."""

import dataclasses as dc
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from diagrams.batch.arrays import packed, unpacked
from diagrams.batch.campaign import Case
from diagrams.batch.workers import Workers, every_result
from diagrams.challenge.real.forecast.folds import PayloadFlight, drag_beside, told
from diagrams.challenge.real.forecast.rows import HISTORY, ROWS, TOLD_ROWS
from diagrams.challenge.real.forecast.scores import Score, diverged, pooled, score
from np_drake.payload_filter.filter_bank import Estimate, PayloadEstimate, payload_estimate
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_model import ResidualModel
from np_drake.skill.skill import MOTIONS, walk

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
    """Scores of every row on every flight, and by row the training time [s] of every fold.

    payloads: of rows that estimate the payload in flight, the estimate at the end of every flight.
    """

    step: float
    horizons: list[int]
    scores: list[Score] = dc.field(default_factory=list)
    walls: dict[str, list[float]] = dc.field(default_factory=dict)
    payloads: list[FlownPayload] = dc.field(default_factory=list)

    def lines(self) -> list[dict[str, Any]]:
        """Return ratio and RMSE by row, coming motion, kind and horizon, see `pooled`."""
        return pooled(self.scores, self.horizons, self.step)

    def models(self) -> list[dict[str, Any]]:
        """Return by row its number of flights, those on which it diverges by coming motion, and its
        training times.
        """
        flown = len({s.flight for s in self.scores})
        return [
            {
                "row": name,
                "flights": flown,
                "diverged": {motion: diverged(self.scores, name, motion) for motion in MOTIONS},
                "training": training,
            }
            for name, training in self.walls.items()
        ]


def steps_of(horizons: Sequence[float], step: float) -> list[int]:
    """Return the horizons in whole steps, ascending, at least one.

    Args:
        horizons: [s].
        step: [s].
    """
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

    Args:
        step: between samples [s].
        folder: name of the flights' folder, that campaigns of different flights differ.
        workers: where the folds run; None: one process.
    Raises: FailedRun: where a row has no result.
    """
    manoeuvres = dict.fromkeys(flight.manoeuvre for flight in flights)
    cases = [{"manoeuvre": manoeuvre, "row": name} for manoeuvre in manoeuvres for name in names]
    config = {"folder": folder, "step": step}
    records = (workers or Workers()).run(
        HoldingOut(tuple(flights), step), cases, config=config, on_progress=on_progress
    )
    study = Study(step, steps_of(HORIZONS, step))
    for case, result in zip(cases, every_result(records), strict=True):
        _add(study, case, result)
    return study


@dc.dataclass(frozen=True)
class HoldingOut:
    """Work of a case {"manoeuvre", "row"} -> what the row, trained on the other manoeuvres, shows
    on that one.

    A result holds "wall", the time of the training [s], and of every flight its scores by coming
    motion and the estimate of the payload, where there is any.
    """

    flights: tuple[PayloadFlight, ...]
    step: float

    def __call__(self, case: Case) -> dict[str, Any]:
        """Train and score the row."""
        name, started = case["row"], time.perf_counter()
        learned = [flight for flight in self.flights if flight.manoeuvre != case["manoeuvre"]]
        held_out = [flight for flight in self.flights if flight.manoeuvre == case["manoeuvre"]]
        models = self._models(name, learned, held_out)
        wall = time.perf_counter() - started
        shown = [
            self._shown(name, flight, model) for flight, model in zip(held_out, models, strict=True)
        ]
        return {"wall": wall, "flights": shown}

    def _models(
        self, name: str, learned: Sequence[PayloadFlight], held_out: Sequence[PayloadFlight]
    ) -> list[ResidualModel]:
        """Return the model of every held-out flight, trained on the others or told what hangs
        below.
        """
        if name in TOLD_ROWS:
            rest = drag_beside(learned, self.step) if TOLD_ROWS[name] else None
            return [told(flight, self.step, rest) for flight in held_out]
        return [ROWS[name]([flight.opened for flight in learned], self.step)] * len(held_out)

    def _shown(self, name: str, flight: PayloadFlight, model: ResidualModel) -> dict[str, Any]:
        """Return what a model shows on a flight."""
        horizons, first = steps_of(HORIZONS, self.step), round(HISTORY / self.step)
        scores = score(name, model, flight.opened, horizons, first=first)
        return {
            "flight": flight.log.name,
            "scores": {
                s.motion: packed({part: getattr(s, part) for part in SCORED}) for s in scores
            },
            "estimate": estimate_at_end(model, flight)
            if isinstance(model, PayloadFilter)
            else None,
        }


def estimate_at_end(model: PayloadFilter, flight: PayloadFlight) -> PayloadEstimate:
    """Return what the filters believe of the payload at the end of a flight."""
    ((_, memory),) = deque(walk(model, flight.sampled(model.step, model.label)), maxlen=1)
    return payload_estimate(memory)


def _add(study: Study, case: Case, result: dict[str, Any]) -> None:
    """Add the result of a case to the study."""
    name = case["row"]
    study.walls.setdefault(name, []).append(result["wall"])
    for shown in result["flights"]:
        flight = shown["flight"]
        study.scores += [
            Score(name, flight, m, **unpacked(arrays)) for m, arrays in shown["scores"].items()
        ]
        if shown["estimate"]:
            estimate = PayloadEstimate(*(Estimate(*values) for values in shown["estimate"]))
            study.payloads.append(FlownPayload(name, flight, case["manoeuvre"], estimate))
