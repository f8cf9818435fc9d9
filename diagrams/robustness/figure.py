"""Robustness sweep as one figure: a column an axis, E_xy above E_z, in blocks of five axes."""

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from diagrams.robustness.axes import Axis
from diagrams.robustness.cells import ERRORS
from diagrams.robustness.table import NOMINAL, axes_of
from np_drake.files.figure_file import DASHES, PALETTE, new_figure

COLUMNS = 5  # axes side by side
COLOURS = (*PALETTE[:6], "0.55")  # nominal alone is black
MARKERS = ("o", "s", "^", "v", "D", "P", "X")


def robustness_figure(lines: Sequence[dict], title: str = "") -> Figure:
    """Plot error against value, with a cross at the upper edge where a flight is lost.

    Args:
        lines: of `robustness_table`.
    """
    varied = axes_of(lines)
    blocks, columns = -(-len(varied) // COLUMNS), min(COLUMNS, len(varied))
    figure, axes = new_figure(
        2 * blocks, columns, width=1.5 + 1.9 * columns, height=0.6 + 4.8 * blocks, sharey="row"
    )
    rows = list(dict.fromkeys(line["row"] for line in lines))
    for number, axis in enumerate(varied):
        block, column = divmod(number, COLUMNS)
        panels = axes[2 * block : 2 * block + 2, column]
        for ax, key in zip(panels, ERRORS, strict=True):
            _prepare(ax, axis)
            for line in (line for line in lines if line["axis"] == axis.name):
                _draw(ax, line, key, rows.index(line["row"]))
            if column == 0:
                ax.set_ylabel(f"{key} [cm]")
        panels[0].tick_params(labelbottom=False)
        unit = "×" if axis.unit == "1" else axis.unit
        panels[1].set_xlabel(f"{axis.title} [{unit}]")
    for ax in axes.T.reshape(columns, blocks, 2)[
        len(varied) - (blocks - 1) * COLUMNS :, -1
    ].ravel():
        ax.remove()
    figure.suptitle(title, fontsize=9)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=min(len(rows), 1 + columns * 2),
        fontsize=8,
    )
    return figure


def _prepare(ax, axis: Axis) -> None:
    """Set the scales of a panel and mark the axis' base."""
    ax.set_yscale("log")
    ax.axvline(axis.base, color="0.6", linewidth=0.8, linestyle=":")
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.grid(alpha=0.3, linewidth=0.4)
    ax.set_xticks(axis.values, [f"{value:g}" for value in axis.values], rotation=60, fontsize=8)


def _draw(ax, line: dict, key: str, number: int) -> None:
    """Draw one controller in one panel."""
    nominal = line["row"] == NOMINAL
    style = {
        "color": "black" if nominal else COLOURS[(number - 1) % len(COLOURS)],
        "linestyle": "-" if nominal else DASHES[(number - 1) % len(COLOURS)],
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
