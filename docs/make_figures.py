"""Draws the pictures of the pages in docs/figures (`python docs/make_figures.py`).

`diagnosis.svg` has the steps of the diagnosis, the PNG files what the guide's flights show.
"""

import dataclasses as dc
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from diagrams.loop.flight import default_flight
from diagrams.loop.flight_result import fly
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.report.figures import timeline_figure
from np_drake.files.figure_file import png
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig

FOLDER = Path(__file__).parent / "figures"
FILE, RESOLUTION = FOLDER / "diagnosis.svg", 70  # of small pictures [dots an inch]
BLUE, ORANGE, GREY = (
    "#0072B2",
    "#E69F00",
    "#555555",
)  # Okabe and Ito's colours, for the colour-blind
STEPS = (  # step, what it does, dataclass that it passes on, flights that it reads
    (
        "Residuals",
        "equations of motion inverted; sensors compared",
        "FlightResiduals",
        "all flights",
    ),
    (
        "Regressors",
        "each effect of the library as columns",
        "RegressionProblem",
        "training flights",
    ),
    (
        "Model selection",
        "beam search over sets of effects by evidence",
        "SearchResult",
        "training flights",
    ),
    (
        "MAP fit and ranking",
        "Gauss-Newton with priors; rivals refined",
        "Ranking",
        "training flights",
    ),
    ("Prediction", "the fit on flights that it has not seen", "HeldOut", "held-out flights"),
    ("What is left", "generic structure, spectral lines, gusts", "Unexplained", "all flights"),
    ("Decision", "probability of each effect; practical equivalence", "Inference", "all flights"),
    (
        "Identifiability",
        "what these flights cannot show or tell apart",
        "Identifiability",
        "training flights",
    ),
    ("Localisation", "channels, times", "Localisation", "held-out flights"),
    ("Gap reduction", "residual and replay before and after", "GapReduction", "held-out flights"),
)
HEIGHT, PITCH, WIDTH = 0.62, 1.0, 4.6


def draw() -> plt.Figure:
    """Return the figure: steps from top to bottom, on each arrow the dataclass that is passed
    on.
    """
    figure, axes = plt.subplots(figsize=(7.2, 8.4))
    axes.set(xlim=(-0.2, 8.2), ylim=(-PITCH * (len(STEPS) + 0.3), 0.75))
    axes.axis("off")
    axes.text(WIDTH / 2, 0.5, "Vehicle and FlightLogs", ha="center", family="monospace", color=GREY)
    for k, (step, what, passed, reads) in enumerate(STEPS):
        y = -PITCH * k
        _box(
            axes,
            y,
            BLUE
            if reads == "training flights"
            else ORANGE
            if reads == "held-out flights"
            else GREY,
        )
        axes.text(WIDTH / 2, y - 0.2, step, ha="center", va="center", weight="bold")
        axes.text(WIDTH / 2, y - 0.44, what, ha="center", va="center", fontsize=9)
        axes.text(WIDTH + 0.25, y - HEIGHT / 2, reads, va="center", fontsize=9, color=GREY)
        _arrow(axes, y - HEIGHT, y - PITCH)
        axes.text(
            WIDTH / 2 + 0.15,
            y - (HEIGHT + PITCH) / 2,
            passed,
            va="center",
            fontsize=9,
            family="monospace",
        )
    axes.text(
        WIDTH / 2,
        -PITCH * len(STEPS) - 0.2,
        "Diagnosis",
        ha="center",
        family="monospace",
        weight="bold",
    )
    _arrow(axes, 0.42, 0.0)
    _second_answer(axes)
    return figure


def _box(axes: Axes, top: float, colour: str) -> None:
    box = FancyBboxPatch(
        (0.0, top - HEIGHT), WIDTH, HEIGHT, boxstyle="round,pad=0,rounding_size=0.08"
    )
    box.set(facecolor="white", edgecolor=colour, linewidth=1.6)
    axes.add_patch(box)


def _arrow(axes: Axes, start: float, end: float) -> None:
    style = {"arrowstyle": "-|>", "color": GREY, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (WIDTH / 2, end), (WIDTH / 2, start), arrowprops=style)


def _second_answer(axes: Axes) -> None:
    """Draw the way back: where held-out flights show more, their first halves join the fit."""
    x, bottom, top = 7.0, -PITCH * 9 - HEIGHT / 2, -PITCH - HEIGHT / 2
    axes.plot(
        [WIDTH + 1.75, x, x], [bottom, bottom, top], color=GREY, linewidth=1.0, linestyle="--"
    )
    style = {"arrowstyle": "-|>", "color": GREY, "linestyle": "--", "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (WIDTH + 1.75, top), (x, top), arrowprops=style)
    note = "second answer: where held-out flights\nshow more, their first halves join the fit"
    axes.text(
        x + 0.15,
        (bottom + top) / 2,
        note,
        rotation=90,
        ha="left",
        va="center",
        fontsize=9,
        color=GREY,
    )


def timeline() -> Figure:
    """Return the residual against time in the report on the drag of
    docs/guide/read-the-report.md.
    """
    config = default_flight(Vehicle())
    config.reality.payload, config.reality.rotor_drag = PayloadConfig(tether="none"), 0.4
    config.reality.motor_lag, config.reality.thrust_scale = 0.0, 1.0
    config.duration, config.reference.speed, config.reference.ramp = 5.0, 2.0, 2.0
    config.reference.dither = [0.08, 0.08, 0.04]
    logs = []
    for seed in range(2):
        config.reference.dither_seed = seed
        logs.append(fly(config.check_and_step(), seed=seed).log())
    names = ("train_1.csv", "heldout_1.csv")
    train, held_out = (dc.replace(log, name=name) for log, name in zip(logs, names, strict=True))
    return timeline_figure(diagnose(config.vehicle, [train], [held_out]).localisation, {})


if __name__ == "__main__":
    plt.rcParams["svg.hashsalt"] = "diagnosis"
    draw().savefig(FILE, bbox_inches="tight", metadata={"Date": None})
    (FOLDER / "report_timeline.png").write_bytes(png(timeline(), RESOLUTION))
