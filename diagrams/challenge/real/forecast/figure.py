"""Figure of the forecasts on payload flights: ratio to persistence against the horizon."""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from diagrams.challenge.real.forecast.rows import PERSISTENCE
from diagrams.challenge.real.forecast.tables import ASKED, ASKED_KIND, marked
from np_drake.files.figure_file import DASHES, PALETTE, new_figure

MARKERS = ("o", "s", "^", "D", "v", "P", "X")
SHOWN = (0.1, 3.0)  # ratios [1]


def ratio_figure(lines: Sequence[Mapping[str, Any]]) -> Figure:
    """Return the ratio of the lateral force to persistence against the horizon, one panel a coming
    motion.
    """
    lines = [line for line in lines if line["kind"] == ASKED_KIND]
    motions = list(dict.fromkeys(line["motion"] for line in lines))
    names = [name for name in dict.fromkeys(line["row"] for line in lines) if name != PERSISTENCE]
    figure, axes = new_figure(1, len(motions), width=7.2, height=4.4, sharey=True)
    for axis, motion in zip(axes[0], motions, strict=True):
        axis.axhline(1.0, color="0.5", linewidth=1)
        for i, name in enumerate(names):
            own = [line for line in lines if (line["motion"], line["row"]) == (motion, name)]
            axis.plot(
                [line["horizon"] for line in own],
                [line["ratio"] for line in own],
                color=PALETTE[i % len(PALETTE)],
                linestyle=DASHES[i // len(PALETTE)],
                marker=MARKERS[i % len(MARKERS)],
                markerfacecolor="white" if i >= len(PALETTE) else None,
                markersize=4,
                linewidth=1.2,
                label=marked(name) if axis is axes[0, 0] else None,
            )
        axis.plot(
            list(ASKED),
            list(ASKED.values()),
            "k_",
            markersize=11,
            markeredgewidth=2,
            label="asked" if axis is axes[0, 0] else None,
        )
        axis.set(title=f"coming motion {motion}", xlabel="horizon [s]", yscale="log", ylim=SHOWN)
        axis.set_yticks([0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0], minor=False)
        axis.set_yticks([], minor=True)
        axis.yaxis.set_major_formatter("{x:g}")
        axis.grid(color="0.9", linewidth=0.5)
        axis.set_axisbelow(True)
    axes[0, 0].set_ylabel("lateral force: RMSE over that of persistence [1]")
    figure.legend(loc="outside lower center", ncols=5, fontsize=8)
    return figure
