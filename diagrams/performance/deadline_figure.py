"""Responses of the control loop as a histogram, a panel a rate."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from diagrams.performance.deadlines import COLLECTORS, EDGES
from np_drake.files.figure_file import DASHES, PALETTE, new_figure


def response_histogram(lines: Sequence[dict]) -> Figure:
    """Plot the number of periods by response, with the period as a line.

    Args: lines: of `deadlines.deadline_line`.
    """
    rates = list(dict.fromkeys(line["rate"] for line in lines))
    figure, axes = new_figure(1, len(rates), width=1.2 + 2.6 * len(rates), height=2.8, sharey="row")
    for ax, rate in zip(axes.ravel(), rates, strict=True):
        for line in (line for line in lines if line["rate"] == rate):
            number = COLLECTORS.index(line["collector"])
            ax.stairs(
                [max(count, 0.1) for count in line["histogram"]],
                EDGES,
                color=PALETTE[number],
                linestyle=DASHES[number],
                label=f"collector {line['collector']}",
            )
        ax.axvline(1e3 / rate, color="0.4", linewidth=0.8, label="period")
        ax.set(xscale="log", yscale="log", xlabel="response [ms]", title=f"{rate:g} Hz", ylim=(0.5, None))
    axes.ravel()[0].set_ylabel("periods")
    axes.ravel()[-1].legend(fontsize=7)
    return figure
