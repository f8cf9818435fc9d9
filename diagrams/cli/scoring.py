"""Skill of trained predictors on flights as tables."""

from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np

from diagrams.cli.output import Table
from np_drake.files.number_text import number
from np_drake.skill.flight_skill import diverged
from np_drake.skill.skill import mean_interval


def tables(rows: list[dict[str, Any]], zeta: str, *, mean: bool) -> list[Table]:
    """Return two tables, a column for every horizon, for every flight or, with `mean`, for all
    together.

    A flight's hold RMSE and, in brackets, skill; the mean over flights is that of the ratio to
    persistence with its 95 % interval and the worst skill.

    Args:
        rows: of `score_flights`.
        zeta: what a forecast knows of the coming motion, held | known.
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
            lines = [
                (model, *(cell(of[horizon]) for horizon in horizons)) for model, of in cells.items()
            ]
            header = ["ahead", *(f"{horizon:.4g} s" for horizon in horizons)]
            found.append((f"{name}: {kind}{what}, coming motion {zeta}", header, lines))
    return found


def _cell(kind: str, cell: list[dict[str, Any]]) -> str:
    return f"{number(cell[-1][f'{kind}_rmse'])} ({cell[-1][f'{kind}_skill']:.2f})"


def _mean_cell(kind: str, cell: list[dict[str, Any]]) -> str:
    mean, low, high = mean_interval(np.array([row[f"{kind}_ratio"] for row in cell]))
    worst = max(row[f"{kind}_skill"] for row in cell)
    return f"{_short(float(mean))} ±{_short(float(high - low) / 2)} ({_short(worst)})"


def _short(value: float) -> str:
    """Format with two digits behind the point, or two significant ones."""
    return f"{value:.2f}" if 0.1 <= value < 1000 or value != value else number(value, 2)


def ending(rows: list[dict[str, Any]], models: Iterable[str]) -> str:
    """Return in a sentence how far the best of the models beats the naive forecasts, the coming
    motion held.

    Args:
        rows: of `score_flights`.
    """
    held = [row for row in rows if row["zeta"] == "held"]
    skills = {
        name: {kind: _skill(held, name, kind) for kind in ("force", "torque")} for name in models
    }
    best = min(skills, key=lambda name: np.mean([*skills[name]["force"].values()]))
    told = " and ".join(f"{kind} {_beaten(skills[best][kind])}" for kind in ("force", "torque"))
    which = f", the best of {len(skills)}," if len(skills) > 1 else ""
    return f"With the coming motion held, {best}{which} forecasts {told}."


def _skill(rows: list[dict[str, Any]], model: str, kind: str) -> dict[float, float]:
    """Return by horizon [s] the mean over flights of error over that of the best naive forecast
    [1].
    """
    found: dict[float, list[float]] = {}
    for row in rows:
        if row["model"] == model:
            found.setdefault(row["horizon"], []).append(row[f"{kind}_skill"])
    return {horizon: float(np.mean(values)) for horizon, values in sorted(found.items())}


def _beaten(skill: dict[float, float]) -> str:
    """Return at how many horizons a forecast beats the naive ones, and where it does so best."""
    better = [horizon for horizon, value in skill.items() if value < 1]
    if not better:
        return "no better than a naive forecast at any horizon"
    where = min(better, key=lambda horizon: skill[horizon])
    horizons = (
        "every horizon" if len(better) == len(skill) else f"{len(better)} of {len(skill)} horizons"
    )
    error = f"{number(skill[where], 2)} of its error at {where:.4g} s"
    return f"better than every naive one at {horizons} ({error})"


def stability_text(lines: list[dict[str, Any]], rows: list[dict[str, Any]]) -> list[str]:
    """Return two sentences for every model: spectral radii of its windows; flights that diverge,
    longest forecast.

    Args:
        lines: of `flight_stability`.
        rows: of `score_flights`.
    """
    said = []
    for name in dict.fromkeys(line["model"] for line in lines):
        of = [line for line in lines if line["model"] == name]
        windows, unstable, pulled = (
            sum(line[key] for line in of) for key in ("windows", "unstable", "pulled")
        )
        scored = [row for row in rows if row["model"] == name]
        peak = np.nanmax(
            [row[f"{kind}_peak"] for row in scored for kind in ("force", "torque")], initial=0.0
        )
        lost, flown = diverged(scored), len({line["flight"] for line in of})
        made = f" ({pulled} were made stable)" if pulled else ""
        said += [
            f"{name}: spectral radius above 1 in {unstable} of {windows} windows{made}, "
            f"largest {max(line['largest'] for line in of):.6f}",
            f"{name}: {len(lost)} of {flown} flights diverge up to "
            f"{max(row['horizon'] for row in scored):.4g} s; "
            f"longest forecast {peak:.2f} x the longest label",
        ]
    return said


def distance_text(lines: list[dict[str, Any]]) -> list[str]:
    """Return a sentence for every flight on which a model forecasts the wrench without low-pass."""
    return [
        f"{line['model']} forecasts without low-pass; such labels of {line['flight']} are "
        f"{number(line['force'])} N "
        f"and {number(line['torque'])} N·m from the target"
        for line in lines
    ]
