"""The paper's estimation table: one step ahead on six real flights, our rows beside the published ones."""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np

from diagrams.prediction.array_flights import Flight
from np_drake.estimation.wrench_table import COLUMNS, PUBLISHED, column_rmse
from np_drake.lifting.metrics.skill import naive_predictions
from np_drake.lifting.model.lifted_model import DEFAULT, PAPER, LiftedModel
from np_drake.residual_models.base import FlightForecasts
from np_drake.residual_models.neural_predictor import NeuralPredictor, PredictorOptions
from np_drake.residual_models.window_stability import WindowStability, stability_of

METHODS = ("NeuroBEM", "NeuroMHE", "NP")  # as published
OURS = {PAPER: "ours, paper", DEFAULT: "ours, default"}  # configuration: row
NAIVE = ("persistence", "linear")  # predictors without training
ROWS = (*METHODS, *OURS.values(), *NAIVE)  # in the order of the table


@dc.dataclass(frozen=True)
class EstimationTable:
    """Errors of all rows on all flights.

    cells: flight -> row -> column -> RMSE [N, N·m].   stability: configuration -> flight.   origins: number of a
    flight.
    """

    cells: dict[str, dict[str, dict[str, float]]]
    stability: dict[str, dict[str, WindowStability]]
    origins: dict[str, int]

    def at_or_below(self, row: str, method: str = "NP") -> int:
        """Return the number of cells in which a row is at or below the published value."""
        return sum(
            rows[row][column] <= rows[method][column] for rows in self.cells.values() for column in COLUMNS
        )

    def worst(self, row: str, method: str = "NP") -> float:
        """Return the largest ratio of a row to the published value [1]."""
        return max(
            rows[row][column] / rows[method][column] for rows in self.cells.values() for column in COLUMNS
        )

    def lines(self) -> list[dict]:
        """Return one line a flight and column, as `--json` has them.

        `paper` is its NP, `ours` the default configuration.
        """
        return [
            {
                "row": flight, "column": column, "paper": rows["NP"][column], "ours": rows[OURS[DEFAULT]][column],
                "ours_paper": rows[OURS[PAPER]][column],
                **{name: rows[name][column] for name in ("NeuroMHE", "NeuroBEM", *NAIVE)},
            }
            for flight, rows in self.cells.items()
            for column in COLUMNS
        ]  # fmt: skip


def estimation_table(
    models: dict[str, LiftedModel],
    flown: Sequence[Flight],
    on_progress: Callable[[int, int], None] = lambda *_: None,
) -> EstimationTable:
    """Return the errors of every flight, row and column, over every origin from the first full window of all models on.

    Args: models: configuration -> trained model.
    Raises: ValueError: if a flight is too short.
    """
    first = max(model.window for model in models.values())
    cells: dict[str, dict[str, dict[str, float]]] = {}
    stability: dict[str, dict[str, WindowStability]] = {name: {} for name in models}
    origins_of = {}
    for number, flight in enumerate(flown):
        chi, zeta = flight.segment.chi, flight.segment.zeta
        origins = np.arange(first, len(chi) - 1)
        naive = naive_predictions(chi, origins, [1], np.zeros(6))
        predictions = {name: naive[name] for name in NAIVE}
        for k, (name, model) in enumerate(models.items()):
            course = forecasts(model, flight)
            predictions[OURS[name]] = course.at([1], origins, zeta, zeta_known=False)
            stability[name][flight.name] = stability_of(course)
            on_progress(len(models) * number + k + 1, len(models) * len(flown))
        rows = {method: dict(zip(COLUMNS, PUBLISHED[flight.name][method], strict=True)) for method in METHODS}
        rows |= {name: column_rmse(chi_hat[:, 0] - chi[origins + 1]) for name, chi_hat in predictions.items()}
        cells[flight.name], origins_of[flight.name] = (
            {name: rows[name] for name in ROWS if name in rows},
            len(origins),
        )
    return EstimationTable(cells, stability, origins_of)


def forecasts(model: LiftedModel, flight: Flight) -> FlightForecasts:
    """Return all forecasts of a model on a flight, force and torque predicted.

    Raises: ValueError: if it is too short.
    """
    course = NeuralPredictor(model, PredictorOptions(torque="predict")).along(
        flight.segment.chi, flight.segment.zeta
    )
    if course is None or len(flight.segment) < model.window + 2:
        raise ValueError(f"{flight.name}: at least {model.window + 2} samples are needed.")
    return course
