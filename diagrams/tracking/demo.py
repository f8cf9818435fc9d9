"""Demo: a training flight, training, and evaluation flights on both tracks."""

import dataclasses as dc
from collections.abc import Callable
from functools import partial
from pathlib import Path

from diagrams.batch.processes import in_order
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.prediction.learning import train_predictor
from diagrams.tracking.tracking import TRACKS, Row, configure, training_flight
from np_drake.lifting.training.train import TrainingResult

ROWS = (Row("nominal", "nominal"), Row("hold", "hold"), Row("np", "np"))


@dc.dataclass
class Demo:
    """Results of the demo.

    training: the training flight.   result: the training.   model: its file.   flights: by track and controller.
    """

    training: FlightResult
    result: TrainingResult
    model: Path
    flights: list[FlightResult]

    def reduction(self) -> dict[str, dict[str, float]]:
        """Return the relative reduction of the nominal MPC's error by NP-MPC, by track [1]."""
        cuts = {}
        for track in TRACKS:
            m = {f.config.controller.kind: f.metrics() for f in self.flights if f.config.name == track}
            cuts[track] = {key: 1.0 - m["np"][key] / m["nominal"][key] for key in ("E_xy", "E_z")}
        return cuts


def run_demo(
    folder: Path,
    *,
    seed: int,
    solver: str = "sqp",
    jobs: int = 2,
    on_progress: Callable[[float, str], None] = lambda fraction, text: None,
) -> Demo:
    """Fly the training circle with the nominal MPC, train, then fly both tracks with all three controllers.

    The evaluation flights draw other noise (seed + 1) than the training flight. Writes the model into `folder`.
    """
    on_progress(0.0, "training flight")
    training = training_flight(
        "training_circle",
        seed=seed,
        solver=solver,
        monitor=lambda t: on_progress(0.2 * t / 65, "training flight"),
    )
    on_progress(0.2, "training")
    model = folder / "predictor.safetensors"
    result = train_predictor(training, model, seed=seed)
    tasks = [(track, row) for track in TRACKS for row in ROWS]
    flown = in_order(
        partial(_signals, model=str(model), seed=seed + 1, solver=solver),
        tasks,
        jobs=jobs,
        on_progress=lambda done, total: on_progress(0.25 + 0.75 * done / total, f"{done} of {total} flights"),
    )
    flights = [
        FlightResult(configure(*task, solver=solver, model=str(model)), seed + 1, signals)
        for task, signals in zip(tasks, flown, strict=True)
    ]
    return Demo(training, result, model, flights)


def _signals(task: tuple[str, Row], *, model: str, seed: int, solver: str) -> dict:
    """Return the arrays of a flight, since only these travel between processes."""
    return fly(configure(*task, solver=solver, model=model), seed=seed).signals
