"""Figures of the gap reduction: the ladder of effects, and replay error against horizon."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from np_drake.diagnosis.report.words import number, title_of
from np_drake.diagnosis.result import GapReduction, ReplayGap
from np_drake.figure_file import PALETTE, new_figure

BEFORE, AFTER, NOISE = PALETTE[1], PALETTE[0], "0.25"


def ladder_figure(reduction: GapReduction) -> Figure:
    """Return the ladder as bars of held-out residual in noise units, with the noise floor as a line."""
    rungs = reduction.ladder
    figure, grid = new_figure(1, 1, width=7.2, height=0.95 + 0.42 * len(rungs))
    ax = grid[0, 0]
    for place, rung in enumerate(rungs):
        ax.barh(place, rung.residual, height=0.62, color=_rung_colour(rung.name, place))
        ax.annotate(
            number(rung.residual, 3),
            (rung.residual, place),
            (4, 0),
            textcoords="offset points",
            va="center",
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.85},
            zorder=4,
        )
    ax.axvline(reduction.floor, color=NOISE, linestyle="--", linewidth=1.2, zorder=3, label="noise alone")
    ax.set_yticks(range(len(rungs)), [_rung_name(rung.name) for rung in rungs])
    ax.invert_yaxis()
    ax.set_xlabel("held-out residual [noise units]")
    ax.set_xlim(0, 1.12 * max([rung.residual for rung in rungs] + [reduction.floor]))
    _tidy(ax, "x")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper right", frameon=False)
    return figure


def _rung_name(name: str) -> str:
    title = title_of(name.removeprefix("+ "))
    return f"+ {title[:1].lower()}{title[1:]}" if name.startswith("+") else title


def _rung_colour(name: str, place: int) -> str:
    if place == 0:
        return BEFORE
    return AFTER if name.startswith("+") else "0.6"


def replay_figure(before: ReplayGap | None, after: ReplayGap | None) -> Figure:
    """Return the median replay error against horizon on logarithmic axes, with 95 % intervals.

    One panel each shows position, velocity and attitude.
    """
    figure, grid = new_figure(1, 3, width=9.0, height=3.1)
    panels = (("position", "position [m]"), ("velocity", "velocity [m/s]"), ("attitude", "attitude [deg]"))
    curves = ((before, "before", BEFORE, "o", "--"), (after, "after", AFTER, "s", "-"))
    for ax, (name, label) in zip(grid[0], panels, strict=True):
        ax.set(xscale="log", yscale="log", xlabel="horizon [s]", ylabel=f"error of {label}")
        for gap, legend, colour, marker, dash in curves:
            if gap is None:
                continue
            values = np.asarray(getattr(gap, name), float)
            values = np.where(np.isfinite(values) & (values > 0), values, np.nan)
            ax.fill_between(gap.horizon, values[:, 1], values[:, 2], color=colour, alpha=0.22, linewidth=0)
            ax.plot(gap.horizon, values[:, 0], color=colour, marker=marker, linestyle=dash, label=legend)
            ax.set_xticks(gap.horizon, [f"{h:g}" for h in gap.horizon])
            ax.set_xticks([], minor=True)
        ax.yaxis.set_major_formatter(plain_ticks())
        _tidy(ax, "both")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2, frameon=False)
    return figure


def plain_ticks() -> FuncFormatter:
    """Return a tick formatter that writes 0.01, 0.1, 1 instead of powers of ten."""
    return FuncFormatter(lambda value, _: f"{value:g}")


def _tidy(ax, axis: str) -> None:
    ax.grid(axis=axis, alpha=0.3, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
