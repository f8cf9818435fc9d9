"""Figures of the report: replay error, and the gap by regime and time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from np_drake.diagnosis.report.words import plain_name
from np_drake.diagnosis.result import Localisation, Regime, ReplayGap
from np_drake.files.figure_file import PALETTE, new_figure
from np_drake.files.number_text import suited

BEFORE, AFTER, NOISE = PALETTE[1], PALETTE[0], "0.25"
NOMINAL, WITH = "nominal simulator", "with the causes"  # in every legend
FLIGHTS = 4  # largest number of flights in the timeline
_WINDOW = 0.25  # window of the running RMS in the timeline [s]
_KINDS = (("force", "N", slice(0, 3)), ("torque", "N·m", slice(3, 6)))


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


Onsets = dict[str, list[tuple[str, float]]]  # flight: (effect, time)


def timeline_figure(localisation: Localisation, onsets: Onsets) -> Figure:
    """Return the running RMS of force and torque residual of each flight, with noise and onsets.

    Args:
        onsets: by flight, effects and when they begin [s].
    """
    flights = list(localisation.times)[:FLIGHTS]
    kinds = [
        kind for kind in _KINDS if any(np.any(localisation.before[f][:, kind[2]]) for f in flights)
    ]
    figure, grid = new_figure(
        len(flights),
        max(len(kinds), 1),
        width=9.0,
        height=0.9 + 1.75 * len(flights),
        sharex="row",
        sharey="col",
    )
    for axes, flight in zip(grid, flights, strict=True):
        for ax, (kind, unit, channels) in zip(axes, kinds, strict=False):
            factor, shown = _trace(ax, localisation, flight, channels, unit)
            for _, time in onsets.get(flight, []):
                ax.axvline(time, color=PALETTE[2], linewidth=1.6, label="a cause begins")
            if floor := factor * np.linalg.norm(
                [c.noise_floor for c in localisation.channels[channels]]
            ):
                ax.axhline(floor, color=NOISE, linestyle="--", linewidth=1.0, label="noise")
            ax.set_ylabel(f"{kind} [{shown}]")
            ax.set_title(plain_name(flight), fontsize=8, loc="left", parse_math=False)
    for ax in grid[-1]:
        ax.set_xlabel("time [s]")
        ax.autoscale(axis="y")  # of all flights, which share the axis
        ax.set_ylim(bottom=0)
    legend(figure)
    return figure


def _trace(
    ax, localisation: Localisation, flight: str, channels: slice, unit: str
) -> tuple[float, str]:
    """Draw the running RMS before and after, and return the factor and the unit in which it is
    drawn.
    """
    curves = ((localisation.before, NOMINAL, BEFORE, "--"), (localisation.after, WITH, AFTER, "-"))
    every = np.concatenate([values[:, channels].ravel() for values in localisation.before.values()])
    factor, shown = suited(float(np.nanmax(np.abs(every))), unit)
    t = localisation.times[flight]
    for traces, label, colour, dash in curves:
        if flight in traces:
            size = factor * np.linalg.norm(traces[flight][:, channels], axis=1)
            # The root mean square (n,) over `_WINDOW` [s]; rows that are not finite are left
            # out.
            rows = (
                max(1, round(_WINDOW / max(float(np.median(np.diff(t))), 1e-6)))
                if len(t) > 1
                else 1
            )
            good = np.isfinite(size)
            kernel = np.ones(min(rows, len(t)))
            square = np.convolve(np.where(good, size, 0.0) ** 2, kernel, "same")
            count = np.convolve(good.astype(float), kernel, "same")
            ax.plot(
                t,
                (np.sqrt(square / np.where(count > 0.5, count, np.nan))),
                color=colour,
                linestyle=dash,
                linewidth=1.1,
                label=label,
            )
    ax.margins(x=0)
    ax.xaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 5, 10]))
    ax.grid(alpha=0.3, linewidth=0.6)
    return factor, shown
