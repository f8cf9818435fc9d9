"""Figures of a design: the track in space and from above, and which pair is separated when."""

from itertools import combinations

import numpy as np
from matplotlib.figure import Figure

from np_drake.flight_design.design import Candidate, FlightDesigner
from np_drake.flight_design.expected_residual import separation
from np_drake.flight_design.nominal_flight import nominal_residuals

MOST_PAIRS = 6  # that are drawn, the weakest first


def design_figure(candidate: Candidate, designer: FlightDesigner) -> Figure:
    """Return the figure of a designed flight."""
    t, limits = designer.basis.t, designer.limits
    flat = candidate.reference.sample(t)
    figure = Figure(figsize=(11, 7), layout="constrained")
    space = figure.add_subplot(2, 2, 1, projection="3d")
    space.plot(*flat[0].T, linewidth=0.8)
    space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="track")  # type: ignore[call-arg]
    above = figure.add_subplot(2, 2, 2)
    above.plot(flat[0, :, 0], flat[0, :, 1], linewidth=0.8)
    (x, y, _), (x_, y_, _) = limits.lower, limits.upper
    above.plot([x, x_, x_, x, x], [y, y, y_, y_, y], "k--", linewidth=0.8)
    above.set(xlabel="x [m]", ylabel="y [m]", title="from above; dashed: the room", aspect="equal")
    moved = figure.add_subplot(2, 2, 3)
    moved.plot(t, flat[0] - limits.center, linewidth=0.8, label=["x", "y", "z"])
    moved.set(xlabel="time [s]", ylabel="from the middle of the room [m]", title="position")
    moved.legend(loc="upper right")
    told = figure.add_subplot(2, 2, 4)
    _draw_separation(told, candidate, designer, flat)
    return figure


def _draw_separation(axes, candidate: Candidate, designer: FlightDesigner, flat: np.ndarray) -> None:
    """Draw how the distance of each pair grows, the weakest pairs first."""
    every, distances = designer.explanations, candidate.information.distances
    flight = nominal_residuals(
        designer.limits.vehicle, designer.basis.t, flat, accelerations=designer.accelerations
    )
    pairs = sorted(combinations(range(len(every)), 2), key=lambda ij: distances[ij])
    for i, j in pairs[:MOST_PAIRS]:
        t, growth = separation(flight, every, designer.readings, (i, j))
        axes.plot(t, growth, linewidth=1.0, label=f"{every[i].label} – {every[j].label}")
    axes.set(xlabel="time [s]", ylabel="distance so far [nat]", title="what tells which pair apart, and when")
    if pairs:
        axes.set_yscale("symlog", linthresh=1.0)
        axes.legend(loc="upper left", fontsize="small")
