"""Figures of the report: replay error, and the gap by regime, time and frequency."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from np_drake.diagnosis.report.words import plain_name
from np_drake.diagnosis.result import CHANNELS, Band, Localisation, Regime, ReplayGap
from np_drake.files.figure_file import PALETTE, new_figure
from np_drake.files.number_text import fixed, number, suited

BEFORE, AFTER, NOISE = PALETTE[1], PALETTE[0], "0.25"
NOMINAL, WITH = "nominal simulator", "with the causes"  # in every legend
FLIGHTS = 4  # largest number of flights in the timeline
_WINDOW = 0.25  # window of the running RMS in the timeline [s]
_KINDS = (("force", "N", slice(0, 3)), ("torque", "N·m", slice(3, 6)))
_OCTAVES = 4  # ranges of frequency in an octave, over which a spectrum is averaged


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


Onsets = dict[str, list[tuple[str, float]]]  # flight: (effect, time)


def regime_figure(regimes: Sequence[Regime]) -> Figure:
    """Return a heat map of RMS residual in noise units, channel against regime, before and, where
    known, after.
    """
    quantities = list(dict.fromkeys(regime.quantity for regime in regimes))
    groups = [
        [regime for regime in regimes if regime.quantity == quantity] for quantity in quantities
    ]
    known = [
        c for c in range(len(CHANNELS)) if any(r.rms[c] != 0 for r in regimes)
    ]  # no log tells every torque
    rows = [(NOMINAL, "rms")]
    if all(regime.rms_after for regime in regimes):
        rows.append((WITH, "rms_after"))
    values = np.concatenate(
        [[getattr(r, name)[c] for c in known] for _, name in rows for r in regimes]
    )
    scale = LogNorm(1.0, max([3.0, *values[np.isfinite(values)]]), clip=True)
    widths = {"width_ratios": [len(group) for group in groups]}
    columns = sum(map(len, groups))
    figure, grid = new_figure(
        len(rows),
        len(groups),
        width=1.6 + 0.46 * max(columns, 12),
        height=max(1.1 + len(rows) * (0.25 + 0.32 * len(known)), 2.9),
        gridspec_kw=widths,
        sharey=True,
    )
    for axes, (when, name) in zip(grid, rows, strict=True):
        for ax, group in zip(axes, groups, strict=True):
            shown = _heat(ax, np.array([getattr(r, name) for r in group], float).T[known], scale)
        axes[0].set_yticks(range(len(known)), [CHANNELS[c] for c in known])
        axes[0].set_title(when, loc="left", fontsize=9)
    for ax, group in zip(grid[-1], groups, strict=True):
        ax.set_xticks(range(len(group)), _ranges(group), rotation=60, ha="right", fontsize=7.5)
        ax.tick_params(axis="x", pad=1)
        ax.set_xlabel(f"{group[0].quantity} [{group[0].unit}]")
    figure.align_xlabels(grid[-1])
    bar = figure.colorbar(shown, ax=grid, pad=0.01, aspect=30)
    bar.set_label("RMS residual over noise [1]")
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    bar.ax.yaxis.set_major_formatter(plain_ticks())
    bar.ax.yaxis.set_minor_locator(NullLocator())
    return figure


def _heat(ax, values: np.ndarray, scale: LogNorm):
    """Draw one panel of values (channel, regime) with its numbers, and return its image."""
    shown = ax.imshow(np.maximum(values, 1.0), cmap="Blues", norm=scale, aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        colour = "white" if np.isfinite(value) and scale(max(value, 1.0)) > 0.6 else "black"
        ax.text(column, row, number(value, 2), ha="center", va="center", fontsize=7, color=colour)
    ax.set_xticks([])
    ax.tick_params(length=0)
    return shown


def _ranges(group: Sequence[Regime]) -> list[str]:
    """Return 'lower to upper' of regimes of one quantity, with as few decimals as tell the bounds
    apart.
    """
    width = min(regime.upper - regime.lower for regime in group)
    decimals = int(np.clip(-np.floor(np.log10(max(width, 1e-6)) + 1e-9), 0, 6))
    return [f"{fixed(r.lower, decimals)} to {fixed(r.upper, decimals)}" for r in group]


def timeline_figure(localisation: Localisation, onsets: Onsets) -> Figure:
    """Return the running RMS of force and torque residual of each flight, with noise, change points
    and onsets.

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
            _marks(ax, localisation, flight, onsets.get(flight, []))
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
            ax.plot(
                t, _running_rms(size, t), color=colour, linestyle=dash, linewidth=1.1, label=label
            )
    ax.margins(x=0)
    ax.xaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 5, 10]))
    ax.grid(alpha=0.3, linewidth=0.6)
    return factor, shown


def _marks(ax, localisation: Localisation, flight: str, onsets: list[tuple[str, float]]) -> None:
    """Draw onsets as solid lines, and change points, where no onset is, as dotted ones."""
    segments = [segment for segment in localisation.segments if segment.flight == flight]
    for start in (segment.start for segment in segments[1:]):
        if all(abs(start - time) > _WINDOW for _, time in onsets):
            ax.axvline(start, color=NOISE, linestyle=":", linewidth=1.0, label="change point")
    for _, time in onsets:
        ax.axvline(time, color=PALETTE[2], linewidth=1.6, label="a cause begins")


def _running_rms(size: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the root mean square (n,) over `_WINDOW` [s]; rows that are not finite are left
    out.
    """
    rows = max(1, round(_WINDOW / max(float(np.median(np.diff(t))), 1e-6))) if len(t) > 1 else 1
    good = np.isfinite(size)
    kernel = np.ones(min(rows, len(t)))
    square = np.convolve(np.where(good, size, 0.0) ** 2, kernel, "same")
    count = np.convolve(good.astype(float), kernel, "same")
    return np.sqrt(square / np.where(count > 0.5, count, np.nan))


def spectrum_figure(bands: Sequence[Band]) -> Figure:
    """Return the spectral density of the residual before and after, with that of the noise
    model.
    """
    bands = [band for band in bands[:6] if np.any(band.before > 0)]
    rows = max(-(-len(bands) // 3), 1)
    figure, grid = new_figure(
        rows, min(3, max(len(bands), 1)), width=9.0, height=0.8 + 2.1 * rows, sharex=True
    )
    for ax, band in zip(grid.flat, bands, strict=False):
        curves = (
            (band.before, NOMINAL, BEFORE, "--"),
            (band.after, WITH, AFTER, "-"),
            (band.noise, "noise", NOISE, ":"),
        )
        for density, label, colour, dash in curves:
            ax.loglog(
                *smoothed(band.frequency, density),
                color=colour,
                linestyle=dash,
                linewidth=1.4,
                label=label,
            )
        unit = "N²/Hz" if band.channel.startswith("force") else "(N·m)²/Hz"
        ax.set_ylabel(f"{band.channel} [{unit}]")
        if np.any(band.noise > 0):  # below it there is only the roll-off of a filter
            ax.set_ylim(bottom=0.05 * np.quantile(band.noise[band.noise > 0], 0.1))
        ax.xaxis.set_major_formatter(plain_ticks())
        ax.grid(alpha=0.3, linewidth=0.6)
    for ax in grid.flat[len(bands) :]:
        ax.set_visible(False)
    for ax in grid[-1]:
        ax.set_xlabel("frequency [Hz]")
    legend(figure)
    return figure


def smoothed(frequency: np.ndarray, density: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return frequency and density averaged over `_OCTAVES` ranges in an octave, without frequency
    zero.

    Args:
        frequency: (m,) [Hz].
        density: (m,) in any unit.
    """
    frequency, density = frequency[frequency > 0], density[frequency > 0]
    place = np.round(_OCTAVES * np.log2(frequency / frequency[0])).astype(int)
    count = np.bincount(place)
    kept = count > 0
    f, mean = (np.bincount(place, values)[kept] / count[kept] for values in (frequency, density))
    return f, mean
