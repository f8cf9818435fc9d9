"""Figures of an identification: intervals beside the prior, agreement of flights, residuals of
held-out flights.
"""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from diagrams.identification.text import interval, shown_in
from np_drake.diagnosis.report.figures import legend, plain_ticks
from np_drake.diagnosis.report.words import suited
from np_drake.files.figure_file import PALETTE, new_figure
from np_drake.identification.flight_agreement import FlightValues
from np_drake.identification.identify import Identification
from np_drake.identification.quantities import Identified
from np_drake.identification.validation import HeldOut

TOLD, OTHER, PRIOR = PALETTE[0], PALETTE[1], "0.85"
REACH = 2.2  # of the axis, in half widths of the prior [1]
ACROSS = 3  # panels beside each other
MARKS = {
    "vehicle file": ("o", PALETTE[1]),
    "identified": ("s", PALETTE[0]),
    "least squares": ("^", PALETTE[2]),
}


def interval_figure(found: Identification) -> Figure:
    """Return value and 95 % interval of each quantity on the scale of its prior's, with its numbers
    beside.
    """
    shown = found.quantities
    figure, grid = new_figure(1, 1, width=9.6, height=1.3 + 0.27 * len(shown))
    ax = grid[0, 0]
    for place, q in enumerate(shown):
        value, *ends = (place_in_prior(q, v) for v in (q.value, q.low, q.high))
        colour = TOLD if q.told else OTHER
        ax.hlines(place, -1, 1, color=PRIOR, linewidth=9, label="prior, 95 %", zorder=1)
        reach = np.clip(ends, -REACH, REACH)
        ax.plot(reach, [place, place], color=colour, linewidth=2.4, zorder=2)
        ax.plot(
            np.clip(value, -REACH, REACH),
            place,
            marker="o" if abs(value) <= REACH else "<" if value < 0 else ">",
            markersize=5.5,
            color=colour,
            markerfacecolor=colour if q.told else "white",
            linestyle="none",
            label="told by the flights" if q.told else "not told: the prior's",
            zorder=3,
        )
        told, both = interval(q)
        ax.text(REACH + 0.12, place, f"{told}   ({both})", va="center", fontsize=8)
    ax.set_yticks(range(len(shown)), [q.name for q in shown], fontsize=8.5)
    ax.set(xlim=(-REACH, REACH), ylim=(len(shown) - 0.4, -0.6), xticks=[-2, -1, 0, 1, 2])
    ax.set_xlabel(
        "place in the prior: 0 its middle, ±1 its 95 % (of logarithms where a quantity is positive)"
    )
    ax.axvline(0.0, color="0.6", linewidth=0.7, zorder=0)
    ax.tick_params(axis="y", length=0)
    ax.spines[["top", "right", "left"]].set_visible(False)
    legend(figure)
    return figure


def place_in_prior(q: Identified, value: float) -> float:
    """Return where a value lies in the prior: 0 in its middle, -1 and 1 at the ends of its 95 %."""
    low, high = q.prior
    if q.quantity.positive:
        value, low, high = math.log(value), math.log(low), math.log(high)
    return (value - 0.5 * (low + high)) / max(0.5 * (high - low), 1e-300)


def agreement_figure(found: Identification, each: Sequence[FlightValues]) -> Figure:
    """Return what each flight tells alone of each quantity, beside what all tell together."""
    rows, count = math.ceil(len(each) / ACROSS), len(found.models)
    figure, grid = new_figure(rows, ACROSS, width=10.5, height=0.9 + 1.75 * rows)
    for place, ax in enumerate(grid.ravel()):
        if place >= len(each):
            ax.set_visible(False)
            continue
        _flights(ax, each[place])
        ax.set_xticks(
            range(count), [str(i + 1) if count <= 15 else "" for i in range(count)], fontsize=8
        )
        ax.set_xlim(-0.6, count - 0.4)
        if place >= len(each) - ACROSS:
            ax.set_xlabel("flight, in the order given")
    legend(figure)
    return figure


def _flights(ax, told: FlightValues) -> None:
    q = told.quantity
    factor, shown = shown_in(q)
    ax.axhspan(factor * q.low, factor * q.high, color=PRIOR, zorder=0, label="all together, 95 %")
    ax.axhline(factor * q.value, color="0.5", linewidth=0.9, zorder=1)
    apart = np.isin(told.names, told.apart)
    for out, colour, mark, label in (
        (False, TOLD, "o", "one flight alone, 95 %"),
        (True, OTHER, "D", "a flight that stands out"),
    ):
        i = np.flatnonzero(np.isfinite(told.value) & (apart == out))
        if len(i):
            ax.vlines(i, factor * told.low[i], factor * told.high[i], color=colour, linewidth=1.6)
            ax.plot(i, factor * told.value[i], mark, markersize=5, color=colour, label=label)
    p = "" if math.isnan(q.p) else f"p {q.p:.2g}" if q.p >= 0.001 else "p < 0.001"
    weight = "bold" if told.differ else "normal"
    ax.set_title(q.name, loc="left", fontsize=9, fontweight=weight)
    ax.set_title(p, loc="right", fontsize=8.5, fontweight=weight)
    ax.set_ylabel(f"[{shown or '1'}]", fontsize=8)
    ax.tick_params(labelsize=8)
    ax.ticklabel_format(axis="y", useOffset=False)
    _tidy(ax, "y")


def residual_figure(rows: Sequence[HeldOut]) -> Figure:
    """Return the RMS of held-out force and torque by axis, a mark a model and flight."""
    figure, grid = new_figure(1, 2, width=9.0, height=3.0)
    flights = list(dict.fromkeys(row.flight for row in rows))
    models = list(dict.fromkeys(row.model for row in rows))
    for ax, (name, unit) in zip(grid[0], (("force", "N"), ("torque", "N·m")), strict=True):
        factor, shown = suited(max(float(np.max(getattr(row, name))) for row in rows), unit)
        for row in rows:
            shift = 0.18 * (models.index(row.model) - 0.5 * (len(models) - 1))
            if len(flights) > 1:
                shift += 0.1 * (flights.index(row.flight) / (len(flights) - 1) - 0.5)
            values, (mark, colour) = factor * getattr(row, name), MARKS[row.model]
            at = np.arange(3) + shift
            ax.plot(at, values, mark, color=colour, markersize=7, label=row.model)
        ax.set_xticks(range(3), [f"{name} {axis}" for axis in "xyz"])
        ax.set(yscale="log", ylabel=f"RMS [{shown}]", xlim=(-0.5, 2.5))
        low, high = ax.get_ylim()
        ax.set_ylim(low / 1.5, 1.5 * high)
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter(plain_ticks())
        ax.yaxis.set_minor_locator(NullLocator())
        _tidy(ax, "y")
    legend(figure)
    return figure


def _tidy(ax, axis: str = "both") -> None:
    ax.grid(axis=axis, alpha=0.3, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
