"""The figures of a score: detection against visibility, and reliability of probabilities; others beside."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import expit

from diagrams.challenge.score.confusion_figure import confusion_figure
from diagrams.challenge.score.detection import FAINTEST, abscissa
from diagrams.challenge.score.effect_figure import effect_figure
from np_drake.figure_file import PALETTE, new_figure, save

BLUE, ORANGE = PALETTE[0], PALETTE[1]
GREY = "0.45"
TICKS = (1.001, 1.01, 1.1, 1.5, 2.0, 4.0, 11.0, 51.0)  # of visibility [1]
JITTER = 0.035  # of points that would hide each other [1]


def write_figures(score: dict[str, Any], folder: Path) -> list[Path]:
    """<folder>/<name>.png for every figure that the set gives."""
    makers: dict[str, Callable[[dict[str, Any]], Figure | None]] = {
        "detection": detection_figure,
        "confusion": confusion_figure,
        "reliability": reliability_figure,
        "effects": effect_figure,
    }
    written = []
    for name, make in makers.items():
        figure = make(score)
        if figure is not None:
            written.append(folder / f"{name}.png")
            save(figure, written[-1])
    return written


def detection_figure(score: dict[str, Any]) -> Figure | None:
    """Share of effects found against visibility: every case, bins with intervals, the logistic curve."""
    found = score["detection"]
    if not found["n"]:
        return None
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
    ax.set_xlabel("visibility: residual / noise, most visible channel [1]")
    ax.set_ylabel("effect found [1]")
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
    ax.errorbar(x, y, error, fmt="s", color=BLUE, markersize=5, capsize=3, linewidth=1.2, label=label)


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


def reliability_figure(score: dict[str, Any]) -> Figure | None:
    """Share of named causes that are true, by reported probability, with counts."""
    found = score["reliability"]
    if not found["n"]:
        return None
    rows = found["bins"]
    figure, axes = new_figure(1, 1, width=5.4, height=3.9)
    ax = axes[0, 0]
    for i, row in enumerate(rows):
        said = "mean of reported probabilities" if i == 0 else None
        ax.plot([i - 0.35, i + 0.35], [row["mean"]] * 2, color=ORANGE, linewidth=2.5, label=said)
    _bins(ax, rows, list(range(len(rows))), "share that is true, 95 % interval")
    names = [f"{row['lower']:g}–{row['upper']:g}\nn = {row['n']}" for row in rows]
    ax.set_xticks(range(len(rows)), names, fontsize=8)
    ax.set_xlim(-0.6, len(rows) - 0.4)
    ax.set_ylim(-0.03, 1.03)
    ax.set_xlabel("reported probability of a named cause [1]")
    ax.set_ylabel("share that is true [1]")
    ax.grid(axis="y", color="0.9", linewidth=0.5)
    title = f"Brier score {found['brier']:.3f}, calibration error {found['ece']:.3f}"
    ax.set_title(title, fontsize=9)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8)
    return figure
