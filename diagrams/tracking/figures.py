"""Plots of flights: plane track, errors, wrench; every function returns a Figure and shows nothing."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from diagrams.loop.flight_result import FlightResult
from np_drake.files.figure_file import DASHES, PALETTE, new_figure

_AXES = ("x", "y", "z")


def plane_track(flights: Sequence[FlightResult], title: str = "") -> Figure:
    """Plot the track in the x-y plane of several controllers, the reference dotted; the last lap only.

    An error along the track does not show here; `errors` has it.

    Args:
        flights: a controller each.
        title: above the plot.
    """
    first = flights[0]
    ref = first.signals["p_ref"][first.last_lap]
    drawn = "last lap" if len(ref) < np.sum(first.scored) else "as scored"
    span = np.ptp(ref[:, :2], axis=0) + 0.3
    figure, axes = new_figure(1, 1, width=6.0, height=1.6 + 5.0 * min(span[1] / span[0], 1.0))
    ax = axes[0, 0]
    ax.plot(ref[:, 0], ref[:, 1], color="0.3", linestyle=":", linewidth=1.5, label="reference")
    for k, flight in enumerate(flights):
        p = flight.signals["x_true"][flight.last_lap]
        ax.plot(p[:, 0], p[:, 1], color=PALETTE[k], linestyle=DASHES[k], linewidth=1.3, label=flight.label)
    ax.set(xlabel="x [m]", ylabel="y [m]", title=f"{title} · {drawn}", aspect="equal")
    ax.grid(alpha=0.3)
    figure.legend(loc="outside lower center", ncols=4, fontsize=8)
    return figure


def errors(flights: Sequence[FlightResult], title: str = "") -> Figure:
    """Plot the position error against time, one panel an axis.

    Args:
        flights: a controller each.
        title: above the plot.
    """
    figure, axes = new_figure(3, 1, width=7.0, height=5.0)
    for i, ax in enumerate(axes[:, 0]):
        for k, flight in enumerate(flights):
            s = flight.signals
            e = 100 * (s["x_true"][:, i] - s["p_ref"][:, i])
            ax.plot(s["t"], e, color=PALETTE[k], linestyle=DASHES[k], linewidth=1.0, label=flight.label)
        ax.axvspan(0, flights[0].config.reference.lead, color="0.92", zorder=0)
        ax.set_ylabel(f"$e_{_AXES[i]}$ [cm]")
        ax.grid(alpha=0.3)
        ax.margins(x=0)
    axes[0, 0].set_title(title)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    axes[-1, 0].set_xlabel("time [s] (grey: ramp, not scored)")
    return figure


def wrench(flight: FlightResult, span: float = 8.0) -> Figure:
    """Plot external force and torque, as truth, label and prediction, at the end of a flight.

    Args:
        flight: that was simulated.
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
            ax.plot(t, label[rows, c], color=PALETTE[4], linestyle=":", linewidth=1.2, label="label")
        if flight.chi_foreseen is not None:
            ax.plot(t, flight.chi_foreseen[rows, c], color=PALETTE[0], linewidth=1.1, label="prediction")
        name, unit = ("f", "N") if c < 3 else ("\\tau", "N·m")
        ax.set_ylabel(f"${name}_{_AXES[c % 3]}$ [{unit}]")
        ax.grid(alpha=0.3)
        ax.margins(x=0)
    axes[0, 0].set_title(f"external force in W · {flight.config.name} · {flight.label}", fontsize=9)
    axes[0, 1].set_title("external torque in B", fontsize=9)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    return figure
