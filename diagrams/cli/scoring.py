"""Skill of trained predictors on flights, as rows of the metrics file and as tables."""

import dataclasses as dc
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from diagrams.cli.flights import Flight
from diagrams.cli.output import Table
from np_drake.lifting.metrics.skill import UNTRAINED, skill_table
from np_drake.lifting.metrics.skill_interval import mean_interval
from np_drake.lifting.model.lifted_model import DEFAULT, PAPER, LiftedModel
from np_drake.lifting.model.origin import require_origin
from np_drake.lifting.training.segments import Segment
from np_drake.logs.neurobem import TESTS
from np_drake.logs.wrench_sequence import WrenchSequence
from np_drake.residual_models.base import ResidualModel
from np_drake.residual_models.neural_predictor import NeuralPredictor, PredictorOptions
from np_drake.residual_models.window_stability import window_stability

OURS = (PAPER, DEFAULT)
MOTIONS = ("held", "known")  # what a forecast knows of the coming zeta
DIVERGED = 10.0  # longest forecast over longest label from which a flight counts as diverged [1]
STEP_TOLERANCE = 0.02  # between a model's step and an array's [1]


def score(
    models: dict[str, LiftedModel],
    flights: Sequence[Flight],
    horizons: list[int],
    *,
    zeta: str,
    baselines: Mapping[str, ResidualModel] = MappingProxyType({}),
    mean: np.ndarray | None = None,
    on_model: Callable[[int, int], None] = lambda *_: None,
) -> list[dict[str, Any]]:
    """Return the rows of `--json`: every model, baseline and naive row on every flight, horizon in seconds.

    Args:
        mean: (6,) of chi in training; None: the flight's own, which no predictor could know.
        zeta: `held` at its last value, or `known`.
        on_model: called with (done, total) after every model.
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
                {label: predictor, **(baselines if place == 0 else {})},
                segment.chi,
                segment.zeta,
                horizons=horizons,
                mean=segment.chi.mean(axis=0) if mean is None else mean,
                target=segment.goal,
                zeta_known=zeta == "known",
                warm_up=max(40, model.window),
                flight=name,
            )
            rows += [
                {**dc.asdict(row), "horizon": row.horizon * segment.step, "zeta": zeta}
                for row in table
                if place == 0 or row.model not in UNTRAINED
            ]
            on_model(number * len(models) + place + 1, len(flights) * len(models))
    return rows


def flight_name(flight: Flight) -> str:
    """Return the paper's name of a flight where it has one."""
    return TESTS.get(f"merged_{flight.data.name}", flight.data.name)


def options_for(model: LiftedModel) -> PredictorOptions:
    """Return the options of a model: torque is predicted where it was trained."""
    return PredictorOptions(torque="predict" if model.predicts_torque else "hold")


def longest_piece(flight: Flight, step: float) -> Segment:
    """Return the longest uninterrupted piece of a flight, at a model's step [s].

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


def tables(rows: list[dict[str, Any]], zeta: str, *, mean: bool) -> list[Table]:
    """Return two tables, a column for every horizon, for every flight or, with `mean`, for all together.

    A flight's hold RMSE and, in brackets, skill; the mean over flights is that of the ratio to persistence with its
    95 % interval and the worst skill.
    """
    rows = [row for row in rows if row["zeta"] == zeta]
    flights = dict.fromkeys(row["flight"] for row in rows)
    groups = {name: [row for row in rows if row["flight"] == name] for name in flights}
    found = []
    for name, group in ({"mean over flights": rows} if mean else groups).items():
        cells: dict[str, dict[float, list[dict]]] = {}
        for row in group:
            cells.setdefault(row["model"], {}).setdefault(row["horizon"], []).append(row)
        horizons = sorted({row["horizon"] for row in group})
        for kind, unit in (("force", "N"), ("torque", "N·m")):
            what = f" RMSE [{unit}] (skill: below 1 beats all naive)"
            what = ", ratio to persistence (worst skill)" if mean else what
            cell = partial(_mean_cell if mean else _cell, kind)
            lines = [(model, *(cell(of[horizon]) for horizon in horizons)) for model, of in cells.items()]
            header = ["ahead", *(f"{horizon:.4g} s" for horizon in horizons)]
            found.append((f"{name}: {kind}{what}, coming motion {zeta}", header, lines))
    return found


def _cell(kind: str, cell: list[dict[str, Any]]) -> str:
    return f"{cell[-1][f'{kind}_rmse']:.3g} ({cell[-1][f'{kind}_skill']:.2f})"


def _mean_cell(kind: str, cell: list[dict[str, Any]]) -> str:
    mean, low, high = mean_interval(np.array([row[f"{kind}_ratio"] for row in cell]))
    worst = max(row[f"{kind}_skill"] for row in cell)
    return f"{_short(float(mean))} ±{_short(float(high - low) / 2)} ({_short(worst)})"


def _short(value: float) -> str:
    """Format with two digits behind the point, or two significant ones."""
    return f"{value:.2f}" if 0.1 <= value < 1000 or value != value else f"{value:.2g}"


def diverged(rows: list[dict[str, Any]]) -> list[str]:
    """Return the flights on which a model's RMSE is no number, or a forecast is `DIVERGED` times the longest label.

    A baseline may diverge; nothing keeps it from that.
    """
    return sorted({row["flight"] for row in rows if row["model"] in OURS and not _bounded(row)})


def _bounded(row: dict[str, Any]) -> bool:
    peaks = [row[f"{kind}_peak"] for kind in ("force", "torque")]
    finite = np.isfinite(row["force_rmse"]) and np.isfinite(row["torque_rmse"])
    return bool(finite and not any(peak > DIVERGED for peak in peaks))


def stability(models: dict[str, LiftedModel], flights: Sequence[Flight]) -> list[dict[str, Any]]:
    """Return the spectral radius of A in every window of every flight, model by model; see `WindowStability`.

    Raises: ValueError: as `score`.
    """
    lines = []
    for flight in flights:
        for label, model in models.items():
            segment = longest_piece(flight, model.step)
            found = window_stability(NeuralPredictor(model, options_for(model)), segment.chi, segment.zeta)
            lines.append({"flight": flight_name(flight), "model": label, **dc.asdict(found)})
    return lines


def stability_text(lines: list[dict[str, Any]], rows: list[dict[str, Any]]) -> list[str]:
    """Return two sentences for every model: spectral radii of its windows; flights that diverge, longest forecast."""
    said = []
    for name in dict.fromkeys(line["model"] for line in lines):
        of = [line for line in lines if line["model"] == name]
        windows, unstable, pulled = (
            sum(line[key] for line in of) for key in ("windows", "unstable", "pulled")
        )
        scored = [row for row in rows if row["model"] == name]
        peak = np.nanmax([row[f"{kind}_peak"] for row in scored for kind in ("force", "torque")], initial=0.0)
        lost, flown = diverged(scored), len({line["flight"] for line in of})
        made = f" ({pulled} were made stable)" if pulled else ""
        said += [
            f"{name}: spectral radius above 1 in {unstable} of {windows} windows{made}, "
            f"largest {max(line['largest'] for line in of):.6f}",
            f"{name}: {len(lost)} of {flown} flights diverge up to {max(row['horizon'] for row in scored):.4g} s; "
            f"longest forecast {peak:.2f} x the longest label",
        ]
    return said
