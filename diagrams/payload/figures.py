"""Plots of a payload that swings, is attached or is lost; every function returns a Figure and shows
nothing.
"""

import numpy as np
from matplotlib.figure import Figure

from diagrams.loop.flight import FlightConfig
from diagrams.payload.attach import AFTER, expected_step
from np_drake.files.figure_file import DASHES, PALETTE, new_figure
from np_drake.metrics import SETTLED

_TITLES = {
    "attach": "100 g more are hung on",
    "release": "the cable is cut",
    "snap": "the payload is tossed up: slack, then taut",
}
_FORESEES = ("np", "payload_filter", "oracle")  # names of rows begin with
_LEGEND = 1.25  # room for a legend above the curves: height of an axis over that of its content [1]
_SHOWN = (-0.5, 1.5)  # around the event [s]


def payload_distance(runs: list[dict], title: str) -> Figure:
    """Plot the payload's horizontal distance from the origin against time, one flight a controller
    (its first seed).

    Above: controllers that know the present wrench or motion alone. Below: controllers that predict
    the swing.

    Args:
        runs: of `run_hover`.
    """
    figure, axes = new_figure(2, 1, width=7.5, height=5.6, sharex=True, sharey=True)
    seen = dict[str, dict]()
    for run in runs:
        if run["course"] is not None:
            seen.setdefault(run["row"], run)
    ahead = {name for name in seen if name.startswith(_FORESEES)}
    for ax, names in zip(axes[:, 0], (seen.keys() - ahead, ahead), strict=True):
        for k, name in enumerate(name for name in seen if name in names):
            t, distance = seen[name]["course"]
            ax.plot(
                t, 100 * distance, color=PALETTE[k], linestyle=DASHES[k], linewidth=1.3, label=name
            )
        ax.axhline(100 * SETTLED, color="0.4", linewidth=0.8)
        ax.margins(x=0)
        ax.grid(alpha=0.3)
        if names:
            ax.legend(loc="upper right", ncols=3, fontsize=8)
    top = axes[0, 0].get_ylim()[1]
    axes[0, 0].set_ylim(0, _LEGEND * top)
    axes[0, 0].set_title(title)
    axes[-1, 0].set_xlabel(
        "time since the impulse [s]; line: 5 cm, below it the swing counts as gone"
    )
    figure.supylabel("payload from the origin, horizontally [cm]", fontsize="medium")
    return figure


def event_responses(runs: list[dict], config: FlightConfig, title: str) -> Figure:
    """Plot f_z that each controller predicts around every event, and the label of the first.

    One flight is thin, the mean of all thick, the new level dotted.

    Args:
        runs: of `run_attach`.
    """
    events = list(dict.fromkeys(run["event"] for run in runs))
    figure, axes = new_figure(
        len(events), 1, width=7.5, height=2.4 * len(events) + 0.6, sharex=True
    )
    rows = list(dict.fromkeys(run["row"] for run in runs))
    curves = [
        (rows[0], "label", f"label of {rows[0]} (low-passed)"),
        *((row, "chi_hat", row) for row in rows),
    ]
    for ax, event in zip(axes[:, 0], events, strict=True):
        for k, (row, name, text) in enumerate(curves):
            mine = [run for run in runs if (run["event"], run["row"]) == (event, row)]
            t = mine[0]["t"]
            shown = (t >= _SHOWN[0]) & (t <= _SHOWN[1])
            courses = np.array([run[name] for run in mine])[:, shown]
            ax.plot(t[shown], courses[0], color=PALETTE[k], linewidth=0.6, alpha=0.6)
            mean = courses.mean(axis=0)
            ax.plot(
                t[shown], mean, color=PALETTE[k], linestyle=DASHES[k], linewidth=1.8, label=text
            )
        mine = [run for run in runs if (run["event"], run["row"]) == (event, rows[0])]
        step = expected_step(event, config)
        if step:
            before = np.array([run["label"] for run in mine])[:, (t < 0) & (t > -AFTER)].mean()
            ax.plot(
                [0, _SHOWN[1]],
                [before + step] * 2,
                color="k",
                linestyle=":",
                label="expected level",
            )
        ax.axvline(0, color="0.4", linewidth=0.8)
        ax.set_title(f"{_TITLES[event]} ({len(mine)} flights)", fontsize=9)
        ax.set_ylabel("$f_z$ [N]")
        ax.grid(alpha=0.3)
        ax.margins(x=0)
    axes[-1, 0].set_xlabel(f"time since the event [s] ({title})")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8
    )
    return figure
