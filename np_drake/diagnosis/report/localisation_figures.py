"""Figures of the localisation: channel against regime, timeline, spectra."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from np_drake.diagnosis.report.gap_figures import AFTER, BEFORE, NOISE, plain_ticks
from np_drake.diagnosis.report.words import number, plain_name
from np_drake.diagnosis.result import CHANNELS, Band, Localisation, Regime
from np_drake.figure_file import PALETTE, new_figure

FLIGHTS = 4  # largest number of flights in the timeline
_WINDOW = 0.25  # window of the running RMS in the timeline [s]
_KINDS = (("force", "N", slice(0, 3)), ("torque", "N·m", slice(3, 6)))
Onsets = dict[str, list[tuple[str, float]]]  # flight: (effect, time)


def regime_figure(regimes: Sequence[Regime]) -> Figure:
    """Return a heat map of RMS residual in noise units, channel against regime, before and, where known, after."""
    quantities = list(dict.fromkeys(regime.quantity for regime in regimes))
    groups = [[regime for regime in regimes if regime.quantity == quantity] for quantity in quantities]
    rows = [("before", [r.rms for r in regimes])]
    if all(regime.rms_after for regime in regimes):
        rows.append(("after", [r.rms_after for r in regimes]))
    values = np.concatenate([np.ravel(figures) for _, figures in rows])
    scale = LogNorm(1.0, max([3.0, *values[np.isfinite(values)]]), clip=True)
    widths = {"width_ratios": [len(group) for group in groups]}
    columns = sum(map(len, groups))
    figure, grid = new_figure(
        len(rows),
        len(groups),
        width=1.6 + 0.46 * max(columns, 12),
        height=0.9 + 2.0 * len(rows),
        gridspec_kw=widths,
        sharey=True,
    )
    for axes, (when, _) in zip(grid, rows, strict=True):
        for ax, group in zip(axes, groups, strict=True):
            shown = _heat(ax, group, when, scale)
        axes[0].set_yticks(range(6), CHANNELS)
        axes[0].set_ylabel(f"{when} [channel]", fontweight="bold")
    for ax, group in zip(grid[-1], groups, strict=True):
        ax.set_xticks(range(len(group)), _ranges(group), rotation=60, ha="right", fontsize=7.5)
        ax.tick_params(axis="x", pad=1)
        ax.set_xlabel(f"{group[0].quantity} [{group[0].unit}]")
    figure.align_xlabels(grid[-1])
    bar = figure.colorbar(shown, ax=grid, pad=0.01, aspect=30)
    bar.set_label("RMS residual [noise units]")
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    bar.ax.yaxis.set_major_formatter(plain_ticks())
    bar.ax.yaxis.set_minor_locator(NullLocator())
    return figure


def _heat(ax, group: Sequence[Regime], when: str, scale: LogNorm):
    """Draw one panel with its numbers, and return its image."""
    values = np.array([r.rms if when == "before" else r.rms_after for r in group], float).T
    shown = ax.imshow(np.maximum(values, 1.0), cmap="Blues", norm=scale, aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        colour = "white" if np.isfinite(value) and scale(max(value, 1.0)) > 0.6 else "black"
        ax.text(column, row, number(value, 2), ha="center", va="center", fontsize=7, color=colour)
    ax.set_xticks([])
    ax.tick_params(length=0)
    return shown


def _ranges(group: Sequence[Regime]) -> list[str]:
    """Return 'lower … upper' of regimes of one quantity, with enough decimals to tell them apart."""
    span = max(regime.upper for regime in group) - min(regime.lower for regime in group)
    decimals = int(np.clip(-np.floor(np.log10(max(span, 1e-6) / 30)), 0, 6))
    return [f"{r.lower:.{decimals}f} … {r.upper:.{decimals}f}".replace("-", "−") for r in group]


def timeline_figure(localisation: Localisation, onsets: Onsets) -> Figure:
    """Return the running RMS of force and torque residual of each flight, with change points and onsets."""
    flights = list(localisation.times)[:FLIGHTS]
    figure, grid = new_figure(
        len(flights), 2, width=9.0, height=0.9 + 1.75 * len(flights), sharex="row", sharey="col"
    )
    for axes, flight in zip(grid, flights, strict=True):
        for ax, (kind, unit, channels) in zip(axes, _KINDS, strict=True):
            _trace(ax, localisation, flight, channels)
            _marks(ax, localisation, flight, onsets.get(flight, []))
            ax.set_ylabel(f"{kind} [{unit}]")
            ax.set_title(plain_name(flight), fontsize=8, loc="left", parse_math=False)
    for ax in grid[-1]:
        ax.set_xlabel("time [s]")
    handles = {
        label: handle
        for ax in grid.flat
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles.keys(), loc="outside upper right", ncols=4, frameon=False)
    return figure


def _trace(ax, localisation: Localisation, flight: str, channels: slice) -> None:
    t = localisation.times[flight]
    curves = ((localisation.before, "before", BEFORE, 0.9), (localisation.after, "after", AFTER, 0.9))
    for traces, label, colour, width in curves:
        if flight in traces:
            size = np.linalg.norm(traces[flight][:, channels], axis=1)
            ax.plot(t, _running_rms(size, t), color=colour, linewidth=width, label=label)
    ax.margins(x=0)
    ax.xaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 5, 10]))
    ax.set_ylim(bottom=0)
    ax.grid(alpha=0.3, linewidth=0.6)


def _marks(ax, localisation: Localisation, flight: str, onsets: list[tuple[str, float]]) -> None:
    """Draw change points as dotted lines and onsets as solid ones, and shade every second segment."""
    segments = [segment for segment in localisation.segments if segment.flight == flight]
    for place, segment in enumerate(segments):
        if place % 2:
            ax.axvspan(segment.start, segment.end, color="0.93", zorder=0, linewidth=0)
        if place:
            ax.axvline(segment.start, color=NOISE, linestyle=":", linewidth=1.0, label="change point")
    for _, time in onsets:
        ax.axvline(time, color=PALETTE[2], linewidth=1.6, label="onset of a cause")


def _running_rms(size: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the root mean square (n,) over `_WINDOW` [s]; rows that are not finite are left out."""
    rows = max(1, round(_WINDOW / max(float(np.median(np.diff(t))), 1e-6))) if len(t) > 1 else 1
    good = np.isfinite(size)
    kernel = np.ones(min(rows, len(t)))
    square = np.convolve(np.where(good, size, 0.0) ** 2, kernel, "same")
    count = np.convolve(good.astype(float), kernel, "same")
    return np.sqrt(square / np.where(count > 0.5, count, np.nan))


def spectrum_figure(bands: Sequence[Band]) -> Figure:
    """Return the spectral density of the residual before and after, with that of the noise model."""
    bands = bands[:6]
    rows = -(-len(bands) // 3)
    figure, grid = new_figure(rows, min(3, len(bands)), width=9.0, height=0.7 + 2.2 * rows, sharex=True)
    for ax, band in zip(grid.flat, bands, strict=False):
        inside = band.frequency > 0
        curves = (
            (band.before, "before", BEFORE, "-"),
            (band.after, "after", AFTER, "-"),
            (band.noise, "noise model", NOISE, "--"),
        )
        for density, label, colour, dash in curves:
            ax.loglog(
                band.frequency[inside],
                density[inside],
                color=colour,
                linestyle=dash,
                linewidth=1.2,
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
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=3, frameon=False)
    return figure
