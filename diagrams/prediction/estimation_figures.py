"""Plots of the wrench on real flights; every function returns a Figure and shows nothing."""

import dataclasses as dc

import numpy as np
from matplotlib.figure import Figure

from diagrams.prediction.array_flights import Flight, forecasts
from np_drake.files.figure_file import DASHES, PALETTE, new_figure
from np_drake.lifting.model.lifted_model import LiftedModel

FAR = 40  # steps ahead of the far forecast [1]
SPAN = (45.0, 55.0)  # of "random points", as the paper shows it [s]
ZOOM = 0.8  # width of the enlargement around the largest jerk [s]
_NAMES = ("F_x", "F_y", "F_z", r"\tau_x", r"\tau_y", r"\tau_z")


@dc.dataclass(frozen=True)
class Window:
    """Labels and forecasts of a time span.

    t: (m,) time [s].   label and every course: (m, 6) for that time [N, N·m].   jerk: (m,) [m/s³].
    """

    t: np.ndarray
    label: np.ndarray
    courses: dict[str, np.ndarray]
    jerk: np.ndarray


def window(model: LiftedModel, flight: Flight, span: tuple[float, float] = SPAN) -> Window:
    """Return the forecasts of the model and of persistence, made one and `FAR` steps before each instant of a span.

    Args:
        model: that is trained.
        flight: that is forecast.
        span: first and last instant [s].
    Raises: ValueError: if the flight does not reach so far.
    """
    chi, zeta, step = flight.segment.chi, flight.segment.zeta, flight.segment.step
    rows = rows_of(flight, span)
    course = forecasts(model, flight)

    def ahead(steps: int) -> np.ndarray:
        return course.at([steps], rows - steps, zeta, zeta_known=False)[:, 0]

    far = f"{1e3 * FAR * step:.3g} ms ahead"
    courses = {
        f"prediction {1e3 * step:.3g} ms ahead": ahead(1),
        f"prediction {far}": ahead(FAR),
        f"persistence {far}": chi[rows - FAR],
    }
    return Window(step * rows, chi[rows], courses, flight.jerk[rows])


def rows_of(flight: Flight, span: tuple[float, float] = SPAN) -> np.ndarray:
    """Return the samples of a time span, (m,).

    Args:
        flight: that they are of.
        span: first and last instant [s].
    Raises: ValueError: if the flight does not reach so far.
    """
    rows = np.arange(*np.rint(np.array(span) / flight.segment.step).astype(int))
    if len(rows) == 0 or rows[-1] >= len(flight.segment):
        end = flight.segment.step * len(flight.segment)
        raise ValueError(f"{flight.name}: must reach from {span[0]:g} s to {span[1]:g} s; it ends at {end:g} s.")
    return rows


def window_figure(shown: Window, title: str) -> Figure:
    """Plot six channels: the whole span on the left, the surroundings of the largest jerk on the right.

    Args:
        shown: of `window`.
        title: above the left column.
    """
    figure, axes = new_figure(6, 2, width=9.0, height=9.5, width_ratios=(1.5, 1.0), sharex="col")
    peak = shown.t[np.argmax(shown.jerk)]
    low = np.clip(peak - ZOOM / 2, shown.t[0], max(shown.t[-1] - ZOOM, shown.t[0]))
    near = (shown.t >= low) & (shown.t <= low + ZOOM)
    for c in range(6):
        for ax, rows in ((axes[c, 0], slice(None)), (axes[c, 1], near)):
            ax.plot(shown.t[rows], shown.label[rows, c], color="0.6", linewidth=2.6, label="label")
            for k, (name, course) in enumerate(shown.courses.items()):
                # the left column has room for one prediction: that a controller would use
                if ax is axes[c, 0] and k == 2:
                    continue
                ax.plot(
                    shown.t[rows], course[rows, c], color=PALETTE[k], linestyle=DASHES[k], linewidth=1.0, label=name
                )  # fmt: skip
            ax.grid(alpha=0.3)
            ax.margins(x=0)
        axes[c, 0].axvspan(low, low + ZOOM, color="0.9", zorder=0)
        axes[c, 0].set_ylabel(f"${_NAMES[c]}$ [{'N' if c < 3 else 'N·m'}]")
    axes[0, 0].set_title(title, fontsize=9)
    axes[0, 1].set_title("around the largest jerk (grey on the left)", fontsize=9)
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    figure.legend(*axes[0, 1].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    return figure
