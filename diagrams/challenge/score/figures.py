"""Figures of a score: detection, confusion, reliability, and gap reduction and parameters by
effect.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from scipy.special import expit

from diagrams.challenge.score.detection import FAINTEST, abscissa
from np_drake.effects.library import LIBRARY
from np_drake.files.figure_file import PALETTE, new_figure

BLUE, ORANGE = PALETTE[0], PALETTE[1]
GREY = "0.45"
TICKS = (1.001, 1.01, 1.1, 1.5, 2.0, 4.0, 11.0, 51.0)  # of visibility [1]
JITTER = 0.035  # of points that would hide each other [1]


def figures(score: dict[str, Any]) -> dict[str, Callable[[], Figure]]:
    """Return what draws every figure that the set gives, by file name."""
    shrinks = _shrinks(score["cases"])
    errors = [row for row in score["parameters"]["rows"] if row["kind"] == "relative"]
    made: dict[str, tuple[Callable[..., Figure], tuple, Any]] = {
        "detection.png": (_detection, (score["detection"],), score["detection"]["n"]),
        "confusion.png": (_confusion, (score["confusion"],), score["confusion"]["true"]),
        "reliability.png": (_reliability, (score["reliability"],), score["reliability"]["n"]),
        "effects.png": (_effects, (shrinks, errors), shrinks or errors),
    }
    return {name: partial(draw, *content) for name, (draw, content, given) in made.items() if given}


def _detection(found: dict[str, Any]) -> Figure:
    """Draw the share of effects found against visibility: every case, bins with intervals, the
    logistic curve.
    """
    figure, axes = new_figure(1, 1, width=6.4, height=3.9)
    ax = axes[0, 0]
    _points(ax, np.array(found["visibility"]), np.array(found["found"]))
    places = [max(row["median"] - 1, FAINTEST) for row in found["bins"]]
    _bins(ax, found["bins"], places, "share found, 95 % interval")
    if found["curve"] is not None:
        _curve(ax, found)
    ax.set_xscale("log")
    ax.set_xlim(0.7 * FAINTEST, None)
    ticks = [tick for tick in TICKS if tick - 1 <= ax.get_xlim()[1]]
    ax.set_xticks([tick - 1 for tick in ticks], ["≤ 1.001", *(f"{tick:g}" for tick in ticks[1:])])
    ax.minorticks_off()
    ax.set(
        xlabel="visibility: residual / noise, most visible channel [1]", ylabel="effect found [1]"
    )
    ax.set_ylim(-0.13, 1.13)
    figure.legend(loc="outside lower center", ncols=3, fontsize=8)
    return figure


def _points(ax: Axes, visibility: np.ndarray, found: np.ndarray) -> None:
    """Found ones at 1, the others at 0, each a little aside."""
    x = np.maximum(visibility - 1, FAINTEST)
    aside = JITTER * (1 + np.arange(len(x)) % 3)
    for right, marker, label in ((True, "o", "a case, found"), (False, "x", "a case, not found")):
        y = aside[found] + 1 if right else -aside[~found]
        rows = found if right else ~found
        ax.plot(x[rows], y, marker, color=GREY, markersize=4, fillstyle="none", label=label)


def _bins(ax: Axes, bins: list[dict[str, Any]], x: Sequence[float], label: str) -> None:
    """Rates with exact intervals and counts."""
    y = np.array([row["rate"] for row in bins])
    bounds = np.array([row["ci95"] for row in bins]).T
    error = np.maximum([y - bounds[0], bounds[1] - y], 0.0)
    ax.errorbar(
        x, y, error, fmt="s", color=BLUE, markersize=5, capsize=3, linewidth=1.2, label=label
    )


def _curve(ax: Axes, found: dict[str, Any]) -> None:
    """The logistic curve, and where it says one half."""
    intercept, slope = found["curve"]
    x = np.geomspace(FAINTEST, max(np.max(found["visibility"]) - 1, 2 * FAINTEST), 200)
    ax.plot(x, expit(intercept + slope * abscissa(1 + x)), color=ORANGE, label="logistic fit")
    half, bounds = found["half"], found["half_ci95"]
    if half is not None and bounds is not None and FAINTEST < half - 1 < x[-1]:
        text = f"half found at {half:.3g} [{bounds[0]:.3g}, {bounds[1]:.3g}]"
        ax.plot([half - 1] * 2, [0.0, 0.5], "--", color=ORANGE, linewidth=1)
        ax.plot([FAINTEST, half - 1], [0.5] * 2, "--", color=ORANGE, linewidth=1, label=text)


def _reliability(found: dict[str, Any]) -> Figure:
    """Draw the share of named causes that are true, by reported probability, with counts."""
    rows = found["bins"]
    figure, axes = new_figure(1, 1, width=5.4, height=3.9)
    ax = axes[0, 0]
    for i, row in enumerate(rows):
        said = "mean of reported probabilities" if i == 0 else None
        ax.plot([i - 0.35, i + 0.35], [row["mean"]] * 2, color=ORANGE, linewidth=2.5, label=said)
    _bins(ax, rows, list(range(len(rows))), "share that is true, 95 % interval")
    names = [f"{row['lower']:g}–{row['upper']:g}\nn = {row['n']}" for row in rows]
    ax.set_xticks(range(len(rows)), names, fontsize=8)
    ax.set(xlim=(-0.6, len(rows) - 0.4), ylim=(-0.03, 1.03))
    ax.set(xlabel="reported probability of a named cause [1]", ylabel="share that is true [1]")
    ax.grid(axis="y", color="0.9", linewidth=0.5)
    ax.set_title(
        f"Brier score {found['brier']:.3f}, calibration error {found['ece']:.3f}", fontsize=9
    )
    figure.legend(loc="outside lower center", ncols=2, fontsize=8)
    return figure


SHADES = LinearSegmentedColormap.from_list("shades", ["#ffffff", PALETTE[0]])
CELL = 0.27  # [inch]
DARK = 0.55  # share from which a count is printed in white [1]


def _confusion(matrix: dict[str, Any]) -> Figure:
    """Draw the counts, shaded by their share of the row, so that a column without any colour was
    never named.
    """
    counts = np.array(matrix["counts"])
    used = counts.sum(axis=0) > 0
    used |= np.isin(matrix["named"], [*matrix["true"], "unknown", "several", "none"])
    names = [name for name, shown in zip(matrix["named"], used, strict=True) if shown]
    counts = counts[:, used]
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure, axes = new_figure(1, 1, width=2.6 + CELL * len(names), height=2.2 + CELL * len(counts))
    ax = axes[0, 0]
    ax.imshow(share, cmap=SHADES, vmin=0, vmax=1, aspect="equal")
    for i, j in np.argwhere(counts > 0):
        color = "white" if share[i, j] > DARK else "black"
        ax.text(j, i, str(counts[i, j]), ha="center", va="center", color=color, fontsize=8)
    _frame_right(ax, matrix["true"], names)
    ax.set_xticks(range(len(names)), [_words(n) for n in names], rotation=90, fontsize=8)
    ax.set_yticks(range(len(counts)), [_words(n) for n in matrix["true"]], fontsize=8)
    ax.set_xticks(np.arange(-0.5, len(names)), minor=True)
    ax.set_yticks(np.arange(-0.5, len(counts)), minor=True)
    ax.grid(which="minor", color="0.85", linewidth=0.5)
    ax.tick_params(which="minor", length=0)
    ax.set(xlabel="named", ylabel="acts")
    return figure


def _frame_right(ax, true: list[str], names: list[str]) -> None:
    """A frame around the cell that is right in each row."""
    right = {"foreign": "unknown", "clean": "none"}
    for i, name in enumerate(true):
        word = right.get(name, name)
        if word in names:
            j = names.index(word)
            x, y = np.array([0, 1, 1, 0, 0]) + j - 0.5, np.array([0, 0, 1, 1, 0]) + i - 0.5
            ax.plot(x, y, color="black", linewidth=1.2, clip_on=False)


def _words(name: str) -> str:
    return name.replace("_", " ")


ERRORS = (1e-4, 10.0)  # smallest and largest relative error that is drawn [1]
ROW = 0.2  # [inch]


def _effects(shrinks: dict[str, list[float]], errors: list[dict[str, Any]]) -> Figure:
    """Draw the shrink of every case with a gap, and the median relative error of every parameter
    that was named.
    """
    rows = max(len(shrinks), len(errors), 4)
    figure, axes = new_figure(1, 2, width=9.5, height=1.0 + ROW * rows)
    _draw_shrinks(axes[0, 0], shrinks)
    _draw_errors(axes[0, 1], errors)
    return figure


def _shrinks(cases: list[dict[str, Any]]) -> dict[str, list[float]]:
    """Return gap reductions by what acts; pairs and triples in a line each."""
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
    sizes = np.clip([row["median_error"] for row in errors], *ERRORS)
    ax.plot(sizes, range(len(errors)), "s", color=PALETTE[0], markersize=5)
    for i, row in enumerate(errors):
        inside = row["coverage"]
        text = f"n = {row['n']}, {inside['count']} of {inside['n']}"
        ax.annotate(text, (1.02, i), xycoords=("axes fraction", "data"), va="center", fontsize=7)
    ax.set_xscale("log")
    ax.set_xlim(0.7 * ERRORS[0], 1.4 * ERRORS[1])
    ax.axvline(0.1, color="0.45", linestyle="--", linewidth=1)
    _name_rows(
        ax,
        [
            f"{row['effect'].replace('_', ' ')}: {row['parameter'].replace('_', ' ')}"
            for row in errors
        ],
    )
    ax.set_xlabel("median relative error [1]")
    ax.set_title("named effects; n, truth inside how many 95 % intervals", fontsize=9)


def _name_rows(ax: Axes, names: list[str]) -> None:
    ax.set_yticks(range(len(names)), names, fontsize=8)
    ax.set_ylim(-0.7, max(len(names), 4) - 0.3)
    ax.grid(axis="y", color="0.9", linewidth=0.5)
