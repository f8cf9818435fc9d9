"""What is named where what acts, as a matrix that can be read in grey print."""

from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from np_drake.figure_file import PALETTE, new_figure

SHADES = LinearSegmentedColormap.from_list("shades", ["#ffffff", PALETTE[0]])
CELL = 0.27  # [inch]
DARK = 0.55  # share from which a count is printed in white [1]


def confusion_figure(score: dict[str, Any]) -> Figure | None:
    """Counts; shaded by their share of the row, so that a column without any colour was never named."""
    matrix = score["confusion"]
    counts = np.array(matrix["counts"])
    if not counts.size:
        return None
    used = counts.sum(axis=0) > 0
    used |= np.isin(matrix["named"], [*matrix["true"], "unknown", "several", "none"])
    names = [name for name, shown in zip(matrix["named"], used, strict=True) if shown]
    counts = counts[:, used]
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    size = {"width": 2.6 + CELL * len(names), "height": 2.2 + CELL * len(counts)}
    figure, axes = new_figure(1, 1, **size)
    ax = axes[0, 0]
    ax.imshow(share, cmap=SHADES, vmin=0, vmax=1, aspect="equal")
    for i, j in np.argwhere(counts > 0):
        color = "white" if share[i, j] > DARK else "black"
        ax.text(j, i, str(counts[i, j]), ha="center", va="center", color=color, fontsize=8)
    _frame_right(ax, matrix["true"], names)
    ax.set_xticks(range(len(names)), [_words(n) for n in names], rotation=90, fontsize=8)
    ax.set_yticks(range(len(counts)), [_words(n) for n in matrix["true"]], fontsize=8)
    ax.set_xticks(np.arange(-0.5, len(names)), minor=True)
    ax.set_yticks(np.arange(-0.5, len(counts)), minor=True)
    ax.grid(which="minor", color="0.85", linewidth=0.5)
    ax.tick_params(which="minor", length=0)
    ax.set_xlabel("named")
    ax.set_ylabel("acts")
    return figure


def _frame_right(ax, true: list[str], names: list[str]) -> None:
    """A frame around the cell that is right in each row."""
    right = {"foreign": "unknown", "clean": "none"}
    for i, name in enumerate(true):
        word = right.get(name, name)
        if word in names:
            j = names.index(word)
            x, y = np.array([0, 1, 1, 0, 0]) + j - 0.5, np.array([0, 0, 1, 1, 0]) + i - 0.5
            ax.plot(x, y, color="black", linewidth=1.2, clip_on=False)


def _words(name: str) -> str:
    return name.replace("_", " ")
