"""Plots of flights: plane track, errors, wrench; every function returns a Figure and shows
nothing.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from np_drake.files.figure_file import DASHES, PALETTE, Axes, Figure, new_figure, new_mosaic

FlightResult = Any  # of diagrams.loop.flight_result, which draws these figures itself
Flights = Sequence[FlightResult]
LEAST_EXTENT = 0.05  # of a track that is no hover [m]; half the window about a hover
# half the height that is shown at least, so that noise does not fill the panel [m]
LEAST_HEIGHT = 0.05
_AXES = ("x", "y", "z")
_REFERENCE: dict[str, Any] = {"color": "0.3", "linestyle": ":", "linewidth": 1.5}
_WAYPOINTS: dict[str, Any] = {
    "color": "black",
    "marker": "x",
    "linestyle": "none",
    "markersize": 7,
    "markeredgewidth": 1.6,
}


def plane_track(flights: Flights, title: str = "") -> Figure:
    """Plot the track of several controllers from above and its height, with the reference; the last
    lap only.

    An error along the track does not show here; `errors` has it.
    """
    x, y = np.ptp(flights[0].signals["p_ref"][flights[0].last_lap, :2], axis=0) + 0.3
    tall = 1.0 + 5.0 * np.clip(y / x, 1 / 3, 1.0)
    figure, axes = new_mosaic(
        [["track"], ["height"]], width=6.0, height=tall + 1.8, height_ratios=[tall, 1.4]
    )
    _draw_track(axes["track"], flights, title)
    _draw_height(axes["height"], flights)
    return _legend(figure, axes["track"])


def errors(flights: Flights, title: str = "") -> Figure:
    """Plot the position error against time, one panel an axis."""
    figure, axes = new_figure(3, 1, width=7.0, height=5.0)
    _draw_errors(axes[:, 0], flights)
    axes[0, 0].set_title(title)
    return _legend(figure, axes[0, 0])


def overlay(flights: Flights, title: str = "") -> Figure:
    """Plot the flights of several controllers over each other: track, height, and the position
    error an axis.
    """
    layout = [["track", "x"]] * 2 + [["track", "y"]] * 2 + [["height", "z"]] * 2
    figure, axes = new_mosaic(layout, width=12.0, height=6.4)
    _draw_track(axes["track"], flights, "")
    _draw_height(axes["height"], flights)
    _draw_errors([axes[name] for name in _AXES], flights)
    figure.suptitle(title, fontsize=11)
    return _legend(figure, axes["track"])


def _legend(figure: Figure, ax: Axes, columns: int = 4) -> Figure:
    """Return the figure with the legend of one of its axes below."""
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)
    return figure


def _draw_track(ax: Axes, flights: Flights, title: str) -> None:
    """Draw the last lap from above, with waypoints."""
    first = flights[0]
    ref = first.signals["p_ref"][first.last_lap]
    points = first.config.reference.waypoints
    drawn = "last lap" if len(ref) < np.sum(first.scored) else "as scored"
    ax.plot(ref[:, 0], ref[:, 1], **_REFERENCE, label="reference")
    # a window about a hover, so that its noise does not look like a track
    middle = 0.5 * (ref[:, :2].max(axis=0) + ref[:, :2].min(axis=0))
    ax.update_datalim([middle - LEAST_EXTENT, middle + LEAST_EXTENT])
    if points is not None:
        ax.plot(points[:, 0], points[:, 1], **_WAYPOINTS, label="waypoint")
    for k, flight in enumerate(flights):
        p = flight.flown[flight.last_lap]
        ax.plot(p[:, 0], p[:, 1], **_line(k), linewidth=1.5, label=flight.label)
    title = " · ".join(filter(None, (title, drawn)))
    ax.set(xlabel="x [m]", ylabel="y [m]", title=title, aspect="equal", adjustable="datalim")
    ax.grid(alpha=0.3)


def _draw_height(ax: Axes, flights: Flights) -> None:
    """Draw the height against time, and the heights of waypoints."""
    first = flights[0]
    points = first.config.reference.waypoints
    t = first.signals["t"][first.last_lap]
    ref = first.signals["p_ref"][first.last_lap]
    ax.plot(t, ref[:, 2], **_REFERENCE)
    if points is not None:
        near = [np.argmin(np.linalg.norm(ref - point, axis=1)) for point in points]
        ax.plot(t[near], points[:, 2], **_WAYPOINTS)
    for k, flight in enumerate(flights):
        lap = flight.last_lap
        ax.plot(flight.signals["t"][lap], flight.flown[lap, 2], **_line(k), linewidth=1.5)
    low, high = ax.get_ylim()
    middle = 0.5 * (low + high)
    half = max(0.5 * (high - low), LEAST_HEIGHT)
    _against_time(ax, "height z [m]", ylim=(middle - half, middle + half), xlabel="time [s]")


def _draw_errors(axes: Sequence[Axes], flights: Flights) -> None:
    """Draw the position error against time, an axis a panel."""
    for i, ax in enumerate(axes):
        for k, flight in enumerate(flights):
            e = 100 * (flight.flown[:, i] - flight.signals["p_ref"][:, i])
            ax.plot(flight.signals["t"], e, **_line(k), linewidth=1.4, label=flight.label)
        ax.axvspan(0, flights[0].config.reference.lead, color="0.92", zorder=0)
        _against_time(ax, f"$e_{_AXES[i]}$ [cm]")
    axes[-1].set_xlabel("time [s] (grey: ramp, not scored)")


def _against_time(ax: Axes, ylabel: str, **more: Any) -> None:
    ax.set(ylabel=ylabel, xmargin=0, **more)
    ax.grid(alpha=0.3)


def _line(k: int) -> dict[str, Any]:
    """Return colour and dashes of the k-th controller."""
    return {"color": PALETTE[k % len(PALETTE)], "linestyle": DASHES[k % len(DASHES)]}


def wrench(flight: FlightResult) -> Figure:
    """Plot external force and torque, as truth, label and prediction, over the last 8 s of a
    flight.
    """
    rows = flight.signals["t"] > flight.signals["t"][-1] - 8.0
    t = flight.signals["t"][rows]
    lines = [
        ("truth", flight.chi_true, {"color": "0.55", "linewidth": 2.0}),
        ("label", flight.wrench_label, {"color": PALETTE[4], "linestyle": ":", "linewidth": 1.2}),
        ("prediction", flight.chi_foreseen, {"color": PALETTE[0], "linewidth": 1.1}),
    ]
    figure, axes = new_figure(3, 2, width=9.0, height=5.5)
    for c, ax in enumerate(axes.T.flat):
        for label, chi, style in lines:
            if chi is not None:
                ax.plot(t, chi[rows, c], label=label, **style)
        name, unit = ("f", "N") if c < 3 else ("\\tau", "N·m")
        _against_time(ax, f"${name}_{_AXES[c % 3]}$ [{unit}]")
    axes[0, 0].set_title(f"external force in W · {flight.config.name} · {flight.label}", fontsize=9)
    axes[0, 1].set_title("external torque in B", fontsize=9)
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    return _legend(figure, axes[0, 0], columns=3)
