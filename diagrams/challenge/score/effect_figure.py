"""By effect: held-out shrink relative to the true model, and errors of parameters."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from np_drake.effects.library import LIBRARY
from np_drake.figure_file import PALETTE, new_figure

LEAST, MOST = 1e-4, 10.0  # of relative errors that are drawn [1]
ROW = 0.2  # [inch]


def effect_figure(score: dict[str, Any]) -> Figure | None:
    """Left: shrink of every case with a gap. Right: median relative error of every parameter that was named."""
    shrinks = _shrinks(score["cases"])
    errors = [row for row in score["parameters"]["rows"] if row["kind"] == "relative"]
    if not shrinks and not errors:
        return None
    rows = max(len(shrinks), len(errors), 4)
    figure, axes = new_figure(1, 2, width=9.5, height=1.0 + ROW * rows)
    _draw_shrinks(axes[0, 0], shrinks)
    _draw_errors(axes[0, 1], errors)
    return figure


def _shrinks(cases: list[dict[str, Any]]) -> dict[str, list[float]]:
    """By what acts; pairs and triples in a line each."""
    found: dict[str, list[float]] = {}
    for row in cases:
        if row["shrink_relative"] is not None:
            one = row["kind"] in ("single", "onset", "foreign")
            name = row["true"][0] if one else f"({row['kind']}s)"
            found.setdefault(name, []).append(row["shrink_relative"])
    order = [*LIBRARY, *sorted(set(found) - set(LIBRARY))]
    return {name: found[name] for name in order[::-1] if name in found}


def _draw_shrinks(ax: Axes, shrinks: dict[str, list[float]]) -> None:
    """A dot a case, a bar at the median."""
    for i, values in enumerate(shrinks.values()):
        ax.plot(values, [i] * len(values), "o", color=PALETTE[0], markersize=4, fillstyle="none")
        ax.plot([np.median(values)] * 2, [i - 0.3, i + 0.3], color=PALETTE[1], linewidth=2)
    ax.axvline(1.0, color="0.45", linestyle="--", linewidth=1)
    ax.set_xlim(-1.05, 1.08)
    _name_rows(ax, [name.replace("_", " ") for name in shrinks])
    ax.set_xlabel("held-out shrink, true model = 1 [1]")
    ax.set_title("○ every case with a visible gap, | median", fontsize=9)


def _draw_errors(ax: Axes, errors: list[dict[str, Any]]) -> None:
    """Median relative error a parameter, with coverage and number of cases behind it."""
    errors = errors[::-1]
    sizes = np.clip([row["median_error"] for row in errors], LEAST, MOST)
    ax.plot(sizes, range(len(errors)), "s", color=PALETTE[0], markersize=5)
    for i, row in enumerate(errors):
        inside = row["coverage"]
        text = f"n = {row['n']}, {inside['count']} of {inside['n']}"
        ax.annotate(text, (1.02, i), xycoords=("axes fraction", "data"), va="center", fontsize=7)
    ax.set_xscale("log")
    ax.set_xlim(0.7 * LEAST, 1.4 * MOST)
    ax.axvline(0.1, color="0.45", linestyle="--", linewidth=1)
    _name_rows(
        ax, [f"{row['effect'].replace('_', ' ')}: {row['parameter'].replace('_', ' ')}" for row in errors]
    )
    ax.set_xlabel("median relative error [1]")
    ax.set_title("named effects; n, truth inside how many 95 % intervals", fontsize=9)


def _name_rows(ax: Axes, names: list[str]) -> None:
    ax.set_yticks(range(len(names)), names, fontsize=8)
    ax.set_ylim(-0.7, max(len(names), 4) - 0.3)
    ax.grid(axis="y", color="0.9", linewidth=0.5)
