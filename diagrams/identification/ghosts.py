"""Open-loop predictions of a held-out flight from many starts: the identified vehicle beside the
file as it was.
"""

import dataclasses as dc
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from np_drake import attitude
from np_drake.diagnosis.report.figures import legend
from np_drake.diagnosis.report.words import plain_name
from np_drake.files.figure_file import DASHES, PALETTE, new_figure, new_mosaic
from np_drake.flight_log import FlightLog
from np_drake.identification.identify import Identification
from np_drake.identification.validation import Prediction, adapted, predict, values_of_file

# length of a prediction, and time between those that are drawn [s]; that of the open-loop table
HORIZON = 0.5
WINDOW = 8.0  # shown against time [s]; own choice: a swing of a small vehicle stays readable
EVERY = 0.1  # between the starts of the errors [s]
FILE, FOUND = "vehicle file", "identified"
COLOURS = {FILE: PALETTE[1], FOUND: PALETTE[0]}
STYLES = {FILE: DASHES[1], FOUND: DASHES[0]}
LOGGED = "0.15"
MARGIN = 0.6  # of the range of the log that a panel shows beside it [1]
QUANTITIES = (
    ("position", "m", 1.0),
    ("velocity", "m/s", 1.0),
    ("attitude", "deg", 180 / np.pi),
    ("rates", "rad/s", 1.0),
)


@dc.dataclass(frozen=True)
class Ghosts:
    """Predictions of one flight by model.

    rows: (first, last) of the log that are judged.
    window: (start, stop) of what is drawn against time [s]. drawn: predictions one behind the
        other.
    many: those from many starts.
    """

    log: FlightLog
    rows: tuple[int, int]
    window: tuple[float, float]
    drawn: Mapping[str, Prediction]
    many: Mapping[str, Prediction]


def ghosts_of(
    found: Identification, log: FlightLog, part: tuple[float, float] = (0.0, 1.0)
) -> Ghosts:
    """Return the ghosts of a flight.

    Args:
        part: share of the flight that counts, first and last [1].
    Raises: ValueError: where no stretch is long enough, in one line.
    """
    rows = {FILE: values_of_file(found), FOUND: found.estimate.layout.values(found.estimate.z)}
    model, values = adapted(found, log, part, rows)
    drawn = {
        name: predict(model, log, v, seconds=HORIZON, every=HORIZON) for name, v in values.items()
    }
    many = {
        name: predict(model, log, v, seconds=HORIZON, every=EVERY) for name, v in values.items()
    }
    edges = model.flight.edges
    bins = np.flatnonzero(model.flight.good)
    judged = (int(edges[bins[0]]), int(edges[bins[-1] + 1]))
    return Ghosts(log, judged, _liveliest(log, judged), drawn, many)


def _liveliest(log: FlightLog, rows: tuple[int, int]) -> tuple[float, float]:
    """Return the window (start, stop) [s] with the largest mean square of body rates."""
    t, power = log.t[rows[0] : rows[1] + 1], np.sum(log.w[rows[0] : rows[1] + 1] ** 2, axis=1)
    total = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(t))])
    starts = t[t <= max(t[-1] - WINDOW, t[0])]
    energy = np.interp(starts + WINDOW, t, total) - np.interp(starts, t, total)
    start = float(starts[int(np.argmax(energy))])
    return start, float(min(start + WINDOW, t[-1]))


def path_figure(ghosts: Ghosts) -> Figure:
    """Return the logged path from above with the ghosts of the window, a panel a model."""
    log, (first, last) = ghosts.log, ghosts.rows
    inside = (log.t >= ghosts.window[0]) & (log.t <= ghosts.window[1])
    low, high = log.p[first : last + 1, :2].min(axis=0), log.p[first : last + 1, :2].max(axis=0)
    half = np.maximum(0.65 * (high - low), 0.25 * np.max(high - low) + 0.01)
    x, y = (0.5 * (low + high)[c] + half[c] * np.array([-1.0, 1.0]) for c in (0, 1))
    height = 1.1 + 4.0 * half[1] / half[0]
    figure, grid = new_figure(1, 2, width=9.0, height=min(height, 6.5), sharex=True, sharey=True)
    for ax, (name, prediction) in zip(grid[0], ghosts.drawn.items(), strict=True):
        ax.plot(*log.p[first : last + 1, :2].T, color="0.8", linewidth=0.9, label="whole flight")
        ax.plot(
            *log.p[inside, :2].T, color=LOGGED, linewidth=1.6, label="logged, as shown against time"
        )
        for k in _shown(ghosts, prediction):
            track = prediction.x[:, k, :2]
            ax.plot(*track.T, color=COLOURS[name], linewidth=1.5, label=name)
            ax.plot(*track[0], marker="o", markersize=3.2, color=COLOURS[name])
        ax.set(xlabel="x [m]", aspect="equal", adjustable="box", xlim=x, ylim=y)
        ax.set_title(name, loc="left", fontsize=10)
        _tidy(ax)
    grid[0, 0].set_ylabel("y [m]")
    legend(figure)
    return figure


def motion_figure(ghosts: Ghosts) -> Figure:
    """Return attitude and body rates against time, logged and predicted."""
    log = ghosts.log
    inside = (log.t >= ghosts.window[0]) & (log.t <= ghosts.window[1])
    names = (("roll", "pitch", "yaw"), ("roll rate", "pitch rate", "yaw rate"))
    figure, axes = new_mosaic(
        [[names[0][i], names[1][i]] for i in range(3)], width=11.0, height=6.4, sharex=True
    )
    near = np.unwrap(_angles(log.q), axis=0)
    for i in range(3):
        for kind, logged in ((0, np.rad2deg(near[:, i])), (1, log.w[:, i])):
            ax = axes[names[kind][i]]
            for name, prediction in ghosts.drawn.items():
                for k in _shown(ghosts, prediction):
                    rows = prediction.rows[:, k]
                    if kind == 0:
                        own = np.unwrap(_angles(prediction.x[:, k, 3:7])[:, i])
                        turns = np.round((own[0] - near[rows[0], i]) / (2 * np.pi))
                        y = np.rad2deg(own - 2 * np.pi * turns)
                    else:
                        y = prediction.x[:, k, 10 + i]
                    ax.plot(
                        log.t[rows],
                        y,
                        color=COLOURS[name],
                        linestyle=STYLES[name],
                        linewidth=1.3,
                        label=name,
                    )
                    ax.plot(log.t[rows[0]], y[0], marker="o", markersize=3.0, color=LOGGED)
            ax.plot(log.t[inside], logged[inside], color=LOGGED, linewidth=1.0, label="logged")
            ax.set_ylim(*_limits(logged[inside], MARGIN))
            ax.set_ylabel(f"{names[kind][i]} [{'deg' if kind == 0 else 'rad/s'}]")
            _tidy(ax)
    for kind in (0, 1):
        axes[names[kind][2]].set_xlabel("time [s]")
        axes[names[kind][2]].set_xlim(*ghosts.window)
    legend(figure)
    return figure


def error_figure(ghosts: Ghosts) -> Figure:
    """Return the error of the predictions against the time ahead: median and the middle half of the
    starts.
    """
    figure, grid = new_figure(1, 4, width=11.0, height=2.9)
    for name, prediction in ghosts.many.items():
        errors, t = prediction.errors(ghosts.log), prediction.t
        for c, (ax, (quantity, unit, factor)) in enumerate(zip(grid[0], QUANTITIES, strict=True)):
            low, middle, high = factor * np.quantile(errors[..., c], [0.25, 0.5, 0.75], axis=1)
            ax.fill_between(t, low, high, color=COLOURS[name], alpha=0.2, linewidth=0)
            ax.plot(
                t, middle, color=COLOURS[name], linestyle=STYLES[name], linewidth=1.6, label=name
            )
            ax.set(xlabel="time ahead [s]", ylabel=f"{quantity} [{unit}]", xlim=(0.0, t[-1]))
            ax.set_ylim(bottom=0.0)
            _tidy(ax)
    legend(figure)
    return figure


def title_of(ghosts: Ghosts) -> str:
    """Return the name of the flight and the window, for a caption."""
    return f"{plain_name(ghosts.log.name)}, {ghosts.window[0]:.1f} to {ghosts.window[1]:.1f} s"


def _shown(ghosts: Ghosts, prediction: Prediction) -> list[int]:
    """Return the predictions that lie in the window."""
    start, stop = (ghosts.log.t[prediction.rows[k]] for k in (0, -1))
    return np.flatnonzero((start >= ghosts.window[0]) & (stop <= ghosts.window[1] + 1e-9)).tolist()


def _angles(q: np.ndarray) -> np.ndarray:
    """Return roll, pitch and yaw (n, 3) of quaternions (n, 4) [rad]."""
    R = attitude.rotation_matrix(q)
    return np.stack(
        [
            np.arctan2(R[:, 2, 1], R[:, 2, 2]),
            np.arcsin(np.clip(-R[:, 2, 0], -1.0, 1.0)),
            np.arctan2(R[:, 1, 0], R[:, 0, 0]),
        ],
        axis=1,
    )


def _limits(values: np.ndarray, margin: float) -> tuple[float, float]:
    """Return limits of an axis that hold the values with a margin, in shares of their range."""
    low, high = float(np.min(values)), float(np.max(values))
    pad = margin * max(high - low, 1e-3)
    return low - pad, high + pad


def _tidy(ax) -> None:
    ax.grid(alpha=0.3, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
