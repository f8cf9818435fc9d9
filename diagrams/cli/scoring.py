"""Skill of trained predictors on flights, as rows of the metrics file and as tables."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from diagrams.cli.flights import Flight
from diagrams.cli.output import print_table
from np_drake.lifting.lifted_model import LiftedModel
from np_drake.lifting.origin import require_origin
from np_drake.lifting.segments import Segment
from np_drake.lifting.skill import NAIVE, skill_table
from np_drake.logs.neurobem import TESTS
from np_drake.logs.wrench_sequence import WrenchSequence
from np_drake.residual_models.neural_predictor import NeuralPredictor, PredictorOptions

MOTIONS = ("held", "known")  # what a forecast is told of the coming zeta
STEP_TOLERANCE = 0.02  # between a model's step and an array's [1]


def score(
    models: dict[str, LiftedModel],
    flights: Sequence[Flight],
    horizons: list[int],
    *,
    zeta: str,
    on_model: Callable[[int, int], None] = lambda *_: None,
) -> list[dict[str, Any]]:
    """The rows of `--json`: every model and naive row on every flight, horizon in seconds.

    The mean is the flight's own. zeta: `held` at its last value, or `known`.
    `on_model` is called with (done, total) after every model.
    Raises: ValueError: if a step is not the model's, or a flight too short.
    """
    rows: list[dict[str, Any]] = []
    for number, flight in enumerate(flights):
        name = flight_name(flight)
        for place, (label, model) in enumerate(models.items()):
            require_origin(model, {"frame": flight.frame})
            segment = longest_piece(flight, model.step)
            predictor = NeuralPredictor(model, options_for(model))
            table = skill_table(
                {label: predictor},
                segment.chi,
                segment.zeta,
                horizons=horizons,
                mean=segment.chi.mean(axis=0),
                target=segment.goal,
                zeta_known=zeta == "known",
                warm_up=max(40, model.window),
                flight=name,
            )
            rows += [
                {**dc.asdict(row), "horizon": row.horizon * segment.step, "zeta": zeta}
                for row in table
                if place == 0 or row.model not in NAIVE
            ]
            on_model(number * len(models) + place + 1, len(flights) * len(models))
    return rows


def flight_name(flight: Flight) -> str:
    """The paper's name where it has one."""
    return TESTS.get(f"merged_{flight.data.name}", flight.data.name)


def options_for(model: LiftedModel) -> PredictorOptions:
    """Torque predicted where it was trained."""
    return PredictorOptions(torque="predict" if model.predicts_torque else "hold")


def longest_piece(flight: Flight, step: float) -> Segment:
    """The longest uninterrupted piece of a flight, at a model's step [s].

    Raises: ValueError: if an array has another step, or nothing usable is left.
    """
    data = flight.data
    if isinstance(data, WrenchSequence) and abs(data.step - step) > STEP_TOLERANCE * step:
        raise ValueError(
            f"{data.name}: step must be the model's, {step:g} s; got {data.step:g} s. Train on such arrays."
        )
    pieces = flight.segments(step)
    if not pieces:
        raise ValueError(f"{data.name}: must hold rows without NaN; got none.")
    return max(pieces, key=len)


def show(rows: list[dict[str, Any]], zeta: str) -> None:
    """Two tables a flight, a column a horizon: RMSE and, in brackets, skill."""
    for flight in dict.fromkeys(row["flight"] for row in rows):
        of_flight = [row for row in rows if row["flight"] == flight]
        horizons = sorted({row["horizon"] for row in of_flight})
        for kind, unit in (("force", "N"), ("torque", "N·m")):
            cells = {
                (row["model"], row["horizon"]): f"{row[f'{kind}_rmse']:.3g} ({row[f'{kind}_skill']:.2f})"
                for row in of_flight
            }
            lines = [
                [model, *(cells[model, horizon] for horizon in horizons)]
                for model in dict.fromkeys(row["model"] for row in of_flight)
            ]
            title = f"{flight}: {kind} RMSE [{unit}] (skill: below 1 beats all naive), coming motion {zeta}"
            print_table(title, ["ahead", *(f"{horizon:.4g} s" for horizon in horizons)], lines)


def finite(rows: list[dict[str, Any]]) -> bool:
    """Whether every RMSE is a number."""
    return all(np.isfinite(row["force_rmse"]) and np.isfinite(row["torque_rmse"]) for row in rows)
