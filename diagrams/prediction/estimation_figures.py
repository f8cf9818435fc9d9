"""Plots of the wrench on real flights; every function returns a Figure and shows nothing."""

import dataclasses as dc

import numpy as np
from matplotlib.figure import Figure

from diagrams.prediction.array_flights import NAIVE, Flight, forecasts
from np_drake.estimation.wrench_table import column_rmse
from np_drake.files.figure_file import DASHES, PALETTE, new_figure
from np_drake.lifting.model.lifted_model import LiftedModel
from np_drake.skill.skill import naive_predictions

FAR = 40  # steps ahead of the far forecast [1]
SPAN = (45.0, 55.0)  # of "random points", as the paper shows it [s]
ZOOM = 0.8  # width of the enlargement around the largest jerk [s]
_NAMES = ("F_x", "F_y", "F_z", r"\tau_x", r"\tau_y", r"\tau_z")


@dc.dataclass(frozen=True)
class Window:
    """Labels and forecasts of a time span.

    t: (m,) time [s].   label and every course: (m, 6) for that time [N, N·m].   jerk: (m,) [m/s³].
    ahead: time from a forecast to what it tells [s].
    """

    t: np.ndarray
    label: np.ndarray
    courses: dict[str, np.ndarray]
    jerk: np.ndarray
    ahead: float


def window(
    models: dict[str, LiftedModel], flight: Flight, span: tuple[float, float] = SPAN
) -> Window:
    """Return the forecasts of all models and of the naive rows, made `FAR` steps before each
    instant of a span.

    Args:
        span: first and last instant [s].
    Raises: ValueError: if the flight does not reach so far.
    """
    chi, zeta, step = flight.segment.chi, flight.segment.zeta, flight.segment.step
    rows = rows_of(flight, span)
    courses = {
        name: forecasts(model, flight).at([FAR], rows - FAR, zeta, zeta_known=False)[:, 0]
        for name, model in models.items()
    }
    naive = naive_predictions(chi, rows - FAR, [FAR], np.zeros(6))
    courses |= {name: naive[name][:, 0] for name in NAIVE}
    return Window(step * rows, chi[rows], courses, flight.jerk[rows], FAR * step)


def _with_errors(name: str, shown: Window) -> str:
    """Return the name of a row with its RMSE over the span, where it is a forecast."""
    if name not in shown.courses:
        return name
    errors = column_rmse(shown.courses[name] - shown.label)
    return f"{name} ({errors['F']:.3g} N, {errors['tau']:.2g} N·m)"


def rows_of(flight: Flight, span: tuple[float, float] = SPAN) -> np.ndarray:
    """Return the samples of a time span, (m,).

    Args:
        span: first and last instant [s].
    Raises: ValueError: if the flight does not reach so far.
    """
    rows = np.arange(*np.rint(np.array(span) / flight.segment.step).astype(int))
    if len(rows) == 0 or rows[-1] >= len(flight.segment):
        end = flight.segment.step * len(flight.segment)
        raise ValueError(
            f"{flight.name}: must reach from {span[0]:g} s to {span[1]:g} s; it ends at {end:g} s."
        )
    return rows


def window_figure(shown: Window, title: str) -> Figure:
    """Plot six channels: the whole span on the left, the surroundings of the largest jerk on the
    right.

    Args:
        shown: of `window`.
    """
    figure, axes = new_figure(6, 2, width=9.0, height=9.5, width_ratios=(1.5, 1.0), sharex="col")
    peak = shown.t[np.argmax(shown.jerk)]
    low = np.clip(peak - ZOOM / 2, shown.t[0], max(shown.t[-1] - ZOOM, shown.t[0]))
    near = (shown.t >= low) & (shown.t <= low + ZOOM)
    for c in range(6):
        for ax, rows in ((axes[c, 0], slice(None)), (axes[c, 1], near)):
            ax.plot(shown.t[rows], shown.label[rows, c], color="0.6", linewidth=2.6, label="label")
            for k, (name, course) in enumerate(shown.courses.items()):
                if ax is axes[c, 0] and name in NAIVE:  # the left column has room for two
                    continue
                ax.plot(
                    shown.t[rows],
                    course[rows, c],
                    color=PALETTE[k],
                    linestyle=DASHES[k],
                    linewidth=1.0,
                    label=name,
                )
            ax.grid(alpha=0.3)
            ax.margins(x=0)
            reach = np.abs(
                shown.label[:, c]
            ).max()  # a line that shoots beyond would flatten all others
            ax.set_ylim(*np.clip(ax.get_ylim(), -1.5 * reach, 1.5 * reach))
        axes[c, 0].axvspan(low, low + ZOOM, color="0.9", zorder=0)
        axes[c, 0].set_ylabel(f"${_NAMES[c]}$ [{'N' if c < 3 else 'N·m'}]")
    axes[0, 0].set_title(f"{title}, {1e3 * shown.ahead:.3g} ms ahead", fontsize=9)
    axes[0, 1].set_title("around the largest jerk (grey on the left)", fontsize=9)
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    handles, names = axes[0, 1].get_legend_handles_labels()
    figure.legend(
        handles,
        [_with_errors(name, shown) for name in names],
        loc="outside lower center",
        ncols=3,
        fontsize=8,
    )
    return figure
