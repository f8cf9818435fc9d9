"""Figures of the gap reduction: the ladder of effects, and replay error against horizon."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from np_drake.diagnosis.report.words import bare_name, number
from np_drake.diagnosis.result import GapReduction, ReplayGap
from np_drake.files.figure_file import PALETTE, new_figure

BEFORE, AFTER, NOISE = PALETTE[1], PALETTE[0], "0.25"
NOMINAL, WITH = "nominal simulator", "with the causes"  # in every legend


def ladder_figure(reduction: GapReduction) -> Figure:
    """Return the ladder as bars of held-out residual over noise, with the noise as a line."""
    rungs = [rung for rung in reduction.ladder if rung.name == "nominal" or rung.name.startswith("+")]
    figure, grid = new_figure(1, 1, width=7.2, height=1.1 + 0.42 * len(rungs))
    ax = grid[0, 0]
    for place, rung in enumerate(rungs):
        colour, label = (AFTER, WITH) if rung.name.startswith("+") else (BEFORE, NOMINAL)
        bar = ax.barh(place, rung.residual, height=0.62, color=colour, label=label)
        ax.bar_label(bar, [number(rung.residual, 2)], padding=4)
    ax.axvline(reduction.floor, color=NOISE, linestyle="--", linewidth=1.2, zorder=3, label="noise")
    names = [rung.name.removeprefix("+ ") for rung in rungs]
    ax.set_yticks(
        range(len(rungs)),
        [f"+ {bare_name(n)}" if n != r.name else n for n, r in zip(names, rungs, strict=True)],
    )
    ax.invert_yaxis()
    ax.set_xlabel("held-out residual over noise [1]")
    ax.set_xlim(0, 1.12 * max([rung.residual for rung in rungs] + [reduction.floor]))
    _tidy(ax, "x")
    legend(figure)
    return figure


def legend(figure: Figure) -> None:
    """Add one legend above all panels, with every label once."""
    shown = {
        label: handle
        for ax in figure.get_axes()
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        list(shown.values()), list(shown), loc="outside upper center", ncols=max(len(shown), 1), frameon=False
    )


def replay_figure(before: ReplayGap | None, after: ReplayGap | None) -> Figure:
    """Return the median replay error against horizon on logarithmic axes, with 95 % intervals.

    One panel each shows position, velocity and attitude.
    """
    figure, grid = new_figure(1, 3, width=9.0, height=3.1)
    panels = (("position", "position [m]"), ("velocity", "velocity [m/s]"), ("attitude", "attitude [deg]"))
    curves = ((before, NOMINAL, BEFORE, "o", "--"), (after, WITH, AFTER, "s", "-"))
    for ax, (name, axis) in zip(grid[0], panels, strict=True):
        ax.set(xscale="log", yscale="log", xlabel="horizon [s]", ylabel=f"error of {axis}")
        for gap, label, colour, marker, dash in curves:
            if gap is None:
                continue
            values = np.asarray(getattr(gap, name), float)
            values = np.where(np.isfinite(values) & (values > 0), values, np.nan)
            ax.fill_between(gap.horizon, values[:, 1], values[:, 2], color=colour, alpha=0.22, linewidth=0)
            ax.plot(gap.horizon, values[:, 0], color=colour, marker=marker, linestyle=dash, label=label)
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
