"""Figures without a display, and the writing of their files."""

import io
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from np_drake.files.file_access import write_bytes

# Okabe and Ito's palette: distinguishable for colour-blind readers and, with the dashes, in grey
# print.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = (
    "-",
    "--",
    "-.",
    ":",
    (0, (5, 1, 1, 1, 1, 1)),
    (0, (8, 2)),
    "-",
)  # one a colour of the palette
SCREEN = 90  # of a picture in a notebook [dots an inch]
RESOLUTION = 150  # of a picture [dots an inch]


class Picture(Figure):
    """Figure that a notebook shows without a backend of its own."""

    def _repr_png_(self) -> bytes:
        return png(self, SCREEN)


def new_figure(rows: int, columns: int, *, width: float, height: float, **layout):
    """Return a Figure and its (rows, columns) axes, without global state or display.

    Args:
        rows: of axes.
        width: of the figure [inch].
        height: likewise [inch].
        layout: passed to `Figure.subplots`.
    """
    figure = Picture(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **layout)


def new_mosaic(layout: list[Any], *, width: float, height: float, **ratios):
    """Return a Figure and its axes by name, without global state or display.

    Args:
        layout: names of the axes, a row each; a name that stands several times spans its cells.
        width: of the figure [inch].
        height: likewise [inch].
        ratios: passed to `Figure.subplot_mosaic`.
    """
    figure = Picture(figsize=(width, height), layout="constrained")
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
