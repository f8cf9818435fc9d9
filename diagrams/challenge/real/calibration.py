"""Calibration of the names: reported probability against the share that is true."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from diagrams.batch.run import Table
from diagrams.challenge.score.binomial_intervals import binned
from diagrams.studies.columns import fixed, tabulate
from np_drake.files.figure_file import DASHES, PALETTE, new_figure

Pairs = Sequence[tuple[float, bool]]  # probability and truth of names
EDGES = (0.0, 0.3, 0.5, 0.7, 0.9, 0.97, 1.0001)  # of the bins of probability [1]
MARKERS = ("o", "s", "^", "D")
ASIDE = 0.008  # by which series stand beside each other [1]


def bins(pairs: Pairs) -> list[dict[str, Any]]:
    """Return, by bin of probability, mean probability, share true with its 95 % interval, and
    count.
    """
    p = np.array([pair[0] for pair in pairs], float)
    true = np.array([pair[1] for pair in pairs], float)
    place = np.clip(np.searchsorted(EDGES, p, side="right") - 1, 0, len(EDGES) - 2)
    return binned(true, place, EDGES, mean=(np.mean, p)) if len(p) else []


def calibration_figure(series: Mapping[str, Pairs]) -> Figure:
    """Return reported probability against share true, by series, with 95 % intervals and counts."""
    figure, axes = new_figure(2, 1, width=5.2, height=5.6, sharex=True, height_ratios=(4, 1.3))
    ax, counts = axes[:, 0]
    ax.plot([0, 1], [0, 1], color="0.6", linewidth=1, label="as reported")
    shown = {name: bins(pairs) for name, pairs in series.items() if pairs}
    for i, (name, rows) in enumerate(shown.items()):
        x = np.array([row["mean"] for row in rows]) + ASIDE * (i - (len(shown) - 1) / 2)
        y = np.array([row["rate"] for row in rows])
        bounds = np.array([row["ci95"] for row in rows]).T
        total = sum(row["n"] for row in rows)
        color, marker, line = (kinds[i % len(kinds)] for kinds in (PALETTE, MARKERS, DASHES))
        style = {"color": color, "marker": marker, "linestyle": line}
        error = np.maximum([y - bounds[0], bounds[1] - y], 0.0)
        ax.errorbar(
            x,
            y,
            error,
            capsize=3,
            markersize=5,
            linewidth=1,
            label=f"{name} (n = {total})",
            **style,
        )
        counts.plot(x, [row["n"] for row in rows], linewidth=1, markersize=4, **style)
    ax.set(xlim=(-0.02, 1.03), ylim=(-0.04, 1.04), ylabel="share that is true, 95 % interval [1]")
    ax.grid(color="0.92", linewidth=0.5)
    ax.set_axisbelow(True)
    counts.set(xlabel="reported probability of a name [1]", ylabel="names in the bin", yscale="log")
    counts.grid(color="0.92", linewidth=0.5)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8)
    return figure


def calibration_error(pairs: Pairs) -> float | None:
    """Return the mean of |share true - mean probability| over the bins, weighted by count; None
    without a name.
    """
    return (
        sum(row["n"] * abs(row["rate"] - row["mean"]) for row in bins(pairs)) / len(pairs)
        if pairs
        else None
    )


def calibration_table(series: Mapping[str, Pairs]) -> Table:
    """Return a row for every series and bin of probability."""
    lines = [{"by": name, **row} for name, pairs in series.items() for row in bins(pairs)]
    columns = (
        ("by", "by"),
        ("probability", lambda row: f"{row['lower']:g} to {min(row['upper'], 1.0):g}"),
        ("names", "n"),
        ("mean", fixed("mean", 2)),
        ("true", fixed("rate", 2)),
        ("95 % interval", lambda row: "{:.2f} to {:.2f}".format(*row["ci95"])),
    )
    return tabulate("names of which the truth is known, by reported probability", lines, columns)
