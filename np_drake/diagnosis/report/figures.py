"""Figures of the report: replay error, and the gap by regime."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from np_drake.diagnosis.result import Regime, ReplayGap
from np_drake.files.figure_file import PALETTE, new_figure

BEFORE, AFTER, NOISE = PALETTE[1], PALETTE[0], "0.25"
NOMINAL, WITH = "nominal simulator", "with the causes"  # in every legend


def legend(figure: Figure) -> None:
    """Add one legend above all panels, with every label once."""
    shown = {
        label: handle
        for ax in figure.get_axes()
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        list(shown.values()),
        list(shown),
        loc="outside upper center",
        ncols=max(len(shown), 1),
        frameon=False,
    )


def replay_figure(before: ReplayGap | None, after: ReplayGap | None) -> Figure:
    """Return the median replay error against horizon on logarithmic axes, with 95 % intervals.

    One panel each shows position, velocity and attitude.
    """
    figure, grid = new_figure(1, 3, width=9.0, height=3.1)
    panels = (
        ("position", "position [m]"),
        ("velocity", "velocity [m/s]"),
        ("attitude", "attitude [deg]"),
    )
    curves = ((before, NOMINAL, BEFORE, "o", "--"), (after, WITH, AFTER, "s", "-"))
    for ax, (name, axis) in zip(grid[0], panels, strict=True):
        ax.set(xscale="log", yscale="log", xlabel="horizon [s]", ylabel=f"error of {axis}")
        for gap, label, colour, marker, dash in curves:
            if gap is None:
                continue
            values = np.asarray(getattr(gap, name), float)
            values = np.where(np.isfinite(values) & (values > 0), values, np.nan)
            ax.fill_between(
                gap.horizon, values[:, 1], values[:, 2], color=colour, alpha=0.22, linewidth=0
            )
            ax.plot(
                gap.horizon, values[:, 0], color=colour, marker=marker, linestyle=dash, label=label
            )
            ax.set_xticks(gap.horizon, [f"{h:g}" for h in gap.horizon])
            ax.set_xticks([], minor=True)
        ax.yaxis.set_major_formatter(plain_ticks())
        _tidy(ax, "both")
    legend(figure)
    return figure


def plain_ticks() -> FuncFormatter:
    """Return a tick formatter that writes 0.01, 0.1, 1 instead of powers of ten."""
    return FuncFormatter(lambda value, _: f"{value:g}")


def _tidy(ax, axis: str) -> None:
    ax.grid(axis=axis, alpha=0.3, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def regime_figure(regimes: Sequence[Regime]) -> Figure:
    """Return the residual over noise against each quantity, before and after: largest channel."""
    names = list(dict.fromkeys(regime.quantity for regime in regimes))
    figure, grid = new_figure(1, len(names), width=9.0, height=2.6, sharey=True)
    curves = (("rms", NOMINAL, BEFORE, "--"), ("rms_after", WITH, AFTER, "-"))
    for ax, name in zip(grid[0], names, strict=True):
        group = [regime for regime in regimes if regime.quantity == name]
        edges = [group[0].lower, *(regime.upper for regime in group)]
        for field, label, colour, dash in curves:
            values = [max(getattr(regime, field)) for regime in group]
            ax.stairs(values, edges, color=colour, linestyle=dash, linewidth=1.6, label=label)
        ax.axhline(1.0, color=NOISE, linestyle=":", linewidth=1.0, label="noise")
        ax.set(xlabel=f"{name} [{group[0].unit}]", yscale="log")
    grid[0, 0].set_ylabel("RMS residual over noise [1]")
    legend(figure)
    return figure
