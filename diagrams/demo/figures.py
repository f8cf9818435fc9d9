"""Figure of the demo: position error in flight, and as either simulator foretells it."""

import numpy as np
from matplotlib.figure import Figure

from diagrams.demo.story import FORETOLD, HELD_OUT, SIMULATORS, Demo, until
from diagrams.loop.flight_result import FlightResult
from np_drake.files.figure_file import DASHES, PALETTE, new_figure

LABELS = {
    "nominal": "nominal MPC",
    "hold": "hold",
    "np": "NP-MPC (np)",
    "payload_filter": "MPC with payload_filter",
}
COLOURS = dict(zip(SIMULATORS, (PALETTE[1], PALETTE[0]), strict=True))


def foretold(demo: Demo) -> Figure:
    """Return the position error of the held-out track against time, a panel a controller."""
    figure, grid = new_figure(len(FORETOLD), 1, width=8.0, height=4.6, sharex=True)
    for ax, row in zip(grid[:, 0], FORETOLD, strict=True):
        flight = until(demo.flown(HELD_OUT, row.kind), demo.simulated_seconds)
        ax.plot(*_error(flight), color="0.1", linewidth=2.2, alpha=0.55, label="flight")
        for k, name in enumerate(SIMULATORS):
            curve = _error(demo.simulated[name, row.kind])
            ax.plot(
                *curve,
                color=COLOURS[name],
                linestyle=DASHES[1 - k],
                linewidth=1.2,
                label=f"{name} simulator",
            )
        ax.set(ylabel="position error [cm]", title=LABELS[row.kind], ylim=(0, None))
        ax.grid(alpha=0.3)
        ax.margins(x=0)
    grid[-1, 0].set_xlabel("time [s]")
    figure.legend(
        *grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False
    )
    return figure


def _error(flight: FlightResult) -> tuple[np.ndarray, np.ndarray]:
    """Return the scored times [s] and the distance from the reference there [cm]."""
    s, rows = flight.signals, flight.scored
    off = s["x_true"][rows, :3] - s["p_ref"][rows]
    return s["t"][rows], 100 * np.linalg.norm(off, axis=1)
