"""Robustness sweep as one figure: a column an axis, E_xy above E_z."""

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from diagrams.robustness.table import ERRORS, NOMINAL, axes_of
from np_drake.figure_file import DASHES, PALETTE, new_figure

MARKERS = ("o", "s", "^", "v", "D", "P", "X")


def robustness_figure(lines: Sequence[dict], title: str = "") -> Figure:
    """Plot error against value, with a cross at the upper edge where a flight is lost.

    Args: lines: of `robustness_table`.
    """
    varied = axes_of(lines)
    figure, axes = new_figure(
        2, len(varied), width=1.5 + 1.9 * len(varied), height=5.4, sharey="row", sharex="col"
    )
    rows = list(dict.fromkeys(line["row"] for line in lines))
    for column, axis in enumerate(varied):
        for ax, key in zip(axes[:, column], ERRORS, strict=True):
            ax.set_yscale("log")
            ax.axvline(axis.base, color="0.6", linewidth=0.8, linestyle=":")
            ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            ax.yaxis.set_major_formatter("{x:g}")
            ax.yaxis.set_minor_formatter(NullFormatter())
            ax.grid(alpha=0.3, linewidth=0.4)
            for line in (line for line in lines if line["axis"] == axis.name):
                _draw(ax, line, key, rows.index(line["row"]))
        unit = "×" if axis.unit == "1" else axis.unit
        axes[1, column].set_xticks(axis.values, [f"{value:g}" for value in axis.values])
        axes[1, column].set_xlabel(f"{axis.title} [{unit}]")
    for ax, key in zip(axes[:, 0], ERRORS, strict=True):
        ax.set_ylabel(f"{key} [cm]")
    figure.suptitle(title, fontsize=9)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=min(len(rows), 1 + len(varied) * 2),
        fontsize=8,
    )
    return figure


def _draw(ax, line: dict, key: str, number: int) -> None:
    """Draw one controller in one panel."""
    nominal = line["row"] == NOMINAL
    style = {
        "color": "black" if nominal else PALETTE[(number - 1) % 6],
        "linestyle": "-" if nominal else DASHES[(number - 1) % 6],
        "marker": MARKERS[number % len(MARKERS)],
        "linewidth": 2.0 if nominal else 1.2,
        "markersize": 3.5,
    }
    values = [point["value"] for point in line["points"]]
    errors = [float("nan") if point[key] is None else 100 * point[key] for point in line["points"]]
    ax.plot(values, errors, label=line["row"], **style)
    lost = [point["value"] for point in line["points"] if point["lost"]]
    if lost:  # one below the other, so that none hides another
        at, across = 0.97 - 0.05 * number, ax.get_xaxis_transform()
        ax.plot(lost, [at] * len(lost), "x", color=style["color"], transform=across)
