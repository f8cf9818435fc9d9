"""Plots of flights: plane track, errors, wrench; every function returns a Figure and shows
nothing.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from diagrams.loop.flight_result import FlightResult
from np_drake.files.figure_file import DASHES, PALETTE, new_figure, new_mosaic

LEAST_EXTENT = 0.05  # of a track that is no hover [m]; half the window about a hover
LEAST_HEIGHT = (
    0.05  # half the height that is shown at least, so that noise does not fill the panel [m]
)
_AXES = ("x", "y", "z")


def plane_track(flights: Sequence[FlightResult], title: str = "") -> Figure:
    """Plot the track of several controllers from above and its height, with the reference; the last
    lap only.

    An error along the track does not show here; `errors` has it.
    """
    tall = 1.0 + 5.0 * _aspect(flights[0])
    figure, axes = new_mosaic(
        [["track"], ["height"]], width=6.0, height=tall + 1.8, height_ratios=[tall, 1.4]
    )
    _draw_track(axes["track"], flights, title)
    _draw_height(axes["height"], flights)
    return _legend(figure, axes["track"])


def errors(flights: Sequence[FlightResult], title: str = "") -> Figure:
    """Plot the position error against time, one panel an axis."""
    figure, axes = new_figure(3, 1, width=7.0, height=5.0)
    _draw_errors(axes[:, 0], flights)
    axes[0, 0].set_title(title)
    return _legend(figure, axes[0, 0])


def overlay(flights: Sequence[FlightResult], title: str = "") -> Figure:
    """Plot the flights of several controllers over each other: track, height, and the position
    error an axis.
    """
    layout = [
        ["track", "x"],
        ["track", "x"],
        ["track", "y"],
        ["track", "y"],
        ["height", "z"],
        ["height", "z"],
    ]
    figure, axes = new_mosaic(layout, width=12.0, height=6.4)
    _draw_track(axes["track"], flights, "")
    _draw_height(axes["height"], flights)
    _draw_errors([axes[name] for name in _AXES], flights)
    figure.suptitle(title, fontsize=11)
    return _legend(figure, axes["track"])


def _legend(figure: Figure, ax: Axes) -> Figure:
    """Return the figure with the legend of one of its axes below."""
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    return figure


def _aspect(flight: FlightResult) -> float:
    """Return the extent of the reference along y over that along x, at most 1 and at least a
    third.
    """
    x, y = np.ptp(flight.wanted[flight.last_lap, :2], axis=0) + 0.3
    return float(np.clip(y / x, 1 / 3, 1.0))


def _draw_track(ax: Axes, flights: Sequence[FlightResult], title: str) -> None:
    """Draw the last lap from above, with waypoints."""
    first = flights[0]
    ref = first.wanted[first.last_lap]
    drawn = "last lap" if len(ref) < np.sum(first.scored) else "as scored"
    middle, extent = (
        0.5 * (ref.max(axis=0) + ref.min(axis=0)),
        float(np.ptp(ref[:, :2], axis=0).max()),
    )
    point: dict[str, Any] = {"marker": "+", "markersize": 10} if extent < LEAST_EXTENT else {}
    ax.plot(
        ref[:, 0], ref[:, 1], color="0.3", linestyle=":", linewidth=1.5, label="reference", **point
    )
    if point:  # a window about a hover, so that its noise does not look like a track
        around = [[-LEAST_EXTENT, -LEAST_EXTENT], [LEAST_EXTENT, LEAST_EXTENT]]
        ax.update_datalim(middle[:2] + around)
    points = first.config.reference.waypoints
    if points is not None:
        ax.plot(
            points[:, 0],
            points[:, 1],
            "x",
            color="black",
            markersize=7,
            markeredgewidth=1.6,
            label="waypoint",
        )
    for k, flight in enumerate(flights):
        p = flight.followed[flight.last_lap]
        ax.plot(p[:, 0], p[:, 1], **_line(k), linewidth=1.3, label=_label(flight))
    ax.set(
        xlabel="x [m]",
        ylabel="y [m]",
        title=" · ".join(filter(None, (title, drawn))),
        aspect="equal",
    )
    ax.set_adjustable("datalim")
    ax.grid(alpha=0.3)


def _draw_height(ax: Axes, flights: Sequence[FlightResult]) -> None:
    """Draw the height against time, and the heights of waypoints."""
    first = flights[0]
    rows = first.last_lap
    t, ref = first.signals["t"][rows], first.wanted[rows]
    ax.plot(t, ref[:, 2], color="0.3", linestyle=":", linewidth=1.5)
    points = first.config.reference.waypoints
    if points is not None:
        near = [int(np.argmin(np.linalg.norm(ref - point, axis=1))) for point in points]
        ax.plot(t[near], points[:, 2], "x", color="black", markersize=7, markeredgewidth=1.6)
    for k, flight in enumerate(flights):
        own = flight.last_lap
        ax.plot(flight.signals["t"][own], flight.followed[own, 2], **_line(k), linewidth=1.3)
    low, high = ax.get_ylim()
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), LEAST_HEIGHT)
    ax.set(xlabel="time [s]", ylabel="height z [m]", ylim=(middle - half, middle + half))
    ax.grid(alpha=0.3)
    ax.margins(x=0)


def _draw_errors(axes: Sequence[Axes], flights: Sequence[FlightResult]) -> None:
    """Draw the position error against time, an axis a panel."""
    for i, ax in enumerate(axes):
        for k, flight in enumerate(flights):
            s = flight.signals
            e = 100 * (flight.followed[:, i] - flight.wanted[:, i])
            ax.plot(s["t"], e, **_line(k), linewidth=1.0, label=_label(flight))
        ax.axvspan(0, flights[0].config.reference.lead, color="0.92", zorder=0)
        ax.set_ylabel(f"$e_{_AXES[i]}$ [cm]")
        ax.grid(alpha=0.3)
        ax.margins(x=0)
    axes[-1].set_xlabel("time [s] (grey: ramp, not scored)")


def _label(flight: FlightResult) -> str:
    """Return the controller, and that it is the payload that is shown where that follows the
    track.
    """
    return f"payload, {flight.label}" if flight.config.follows_payload else flight.label


def _line(k: int) -> dict[str, Any]:
    """Return colour and dashes of the k-th controller."""
    return {"color": PALETTE[k % len(PALETTE)], "linestyle": DASHES[k % len(DASHES)]}


def wrench(flight: FlightResult, span: float = 8.0) -> Figure:
    """Plot external force and torque, as truth, label and prediction, at the end of a flight.

    Args:
        span: that is shown [s].
    """
    s = flight.signals
    rows = s["t"] > s["t"][-1] - span
    figure, axes = new_figure(3, 2, width=9.0, height=5.5)
    for c in range(6):
        ax = axes[c % 3, c // 3]
        t = s["t"][rows]
        ax.plot(t, flight.chi_true[rows, c], color="0.55", linewidth=2.0, label="truth")
        if (label := flight.wrench_label) is not None:
            ax.plot(
                t, label[rows, c], color=PALETTE[4], linestyle=":", linewidth=1.2, label="label"
            )
        if flight.chi_foreseen is not None:
            ax.plot(
                t, flight.chi_foreseen[rows, c], color=PALETTE[0], linewidth=1.1, label="prediction"
            )
        name, unit = ("f", "N") if c < 3 else ("\\tau", "N·m")
        ax.set_ylabel(f"${name}_{_AXES[c % 3]}$ [{unit}]")
        ax.grid(alpha=0.3)
        ax.margins(x=0)
    axes[0, 0].set_title(f"external force in W · {flight.config.name} · {flight.label}", fontsize=9)
    axes[0, 1].set_title("external torque in B", fontsize=9)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8
    )
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    return figure
