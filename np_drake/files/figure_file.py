"""Figures without a display, and the writing of their files; matplotlib is loaded when one is
drawn.
"""

import dataclasses as dc
import io
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from np_drake.files.file_access import write_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:
    Axes = Figure = Any

# Okabe and Ito's palette: distinguishable for colour-blind readers and, with the dashes, in grey
# print.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#000000", "#E69F00", "#56B4E9", "#CC79A7")
DASHES = (
    "-",
    "--",
    "-.",
    (0, (3, 1)),  # no dots, which are the reference's
    (0, (5, 1, 1, 1, 1, 1)),
    (0, (8, 2)),
    "-",
)  # one a colour of the palette
SCREEN = 90  # of a picture in a notebook [dots an inch]
RESOLUTION = 150  # of a picture [dots an inch]


def _empty(width: float, height: float) -> Figure:
    """Return a figure of a size [inch] that a notebook shows without a backend of its own."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    figure._repr_png_ = partial(png, figure, SCREEN)  # type: ignore[attr-defined]
    return figure


def new_figure(rows: int, columns: int, *, width: float, height: float, **layout):
    """Return a Figure and its (rows, columns) axes, without global state or display.

    Args:
        rows: of axes.
        width: of the figure [inch].
        height: likewise [inch].
        layout: passed to `Figure.subplots`.
    """
    figure = _empty(width, height)
    return figure, figure.subplots(rows, columns, squeeze=False, **layout)


def new_mosaic(layout: list[Any], *, width: float, height: float, **ratios):
    """Return a Figure and its axes by name, without global state or display.

    Args:
        layout: names of the axes, a row each; a name that stands several times spans its cells.
        width: of the figure [inch].
        height: likewise [inch].
        ratios: passed to `Figure.subplot_mosaic`.
    """
    figure = _empty(width, height)
    return figure, figure.subplot_mosaic(layout, **ratios)


def png(figure: Figure, resolution: float = RESOLUTION) -> bytes:
    """Return the figure as a PNG.

    Args:
        resolution: [dots an inch].
    """
    stream = io.BytesIO()
    figure.savefig(stream, dpi=resolution, format="png")
    return stream.getvalue()


def save(figure: Figure, path: str | Path) -> None:
    """Write a PNG, whole or not at all."""
    write_bytes(path, png(figure))


Curve = Any  # x and y, (n,) each


@dc.dataclass(frozen=True)
class Panel:
    """Curves by name; grey: those that are compared with; axes: arguments of `Axes.set`."""

    curves: Mapping[str, Curve]
    axes: Mapping[str, Any] = dc.field(default_factory=dict)
    grey: Mapping[str, Curve] = dc.field(default_factory=dict)


def panel_figure(
    panels: Sequence[Sequence[Panel]], title: str, *, width: float, height: float, **layout: Any
) -> Figure:
    """Plot rows of panels [inch]; further arguments of `Figure.subplots`."""
    figure, axes = new_figure(len(panels), len(panels[0]), width=width, height=height, **layout)
    names = list(dict.fromkeys(chain(*(panel.curves for panel in chain(*panels)))))
    handles: dict[str, Any] = {}
    for ax, panel in zip(axes.ravel(), chain(*panels), strict=True):
        for name, curve in panel.grey.items():
            (handles[name],) = ax.plot(*curve, color="0.45", linestyle=":", linewidth=1.5)
        for name, curve in panel.curves.items():
            k = names.index(name)
            style = {"color": PALETTE[k % len(PALETTE)], "linestyle": DASHES[k % len(DASHES)]}
            (handles[name],) = ax.plot(*curve, lw=1.2, **style)
        ax.set(**panel.axes)
        ax.grid(alpha=0.3)
    figure.suptitle(title, fontsize=10)
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4)
    return figure
