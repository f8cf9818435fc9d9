"""The figure maker of all studies: panels of curves, one colour a name, one legend."""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

from np_drake.files.figure_file import DASHES, PALETTE, Figure, new_figure

Curve = Any  # x and y, (n,) each


@dc.dataclass(frozen=True)
class Panel:
    """Curves by name; grey: those that are compared with; axes: arguments of `Axes.set`."""

    curves: Mapping[str, Curve]
    axes: Mapping[str, Any] = dc.field(default_factory=dict)
    grey: Mapping[str, Curve] = dc.field(default_factory=dict)


def panel_figure(
    panels: Sequence[Sequence[Panel]],
    title: str,
    *,
    width: float,
    height: float,
    marker: str = "",
    **layout: Any,
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
            (handles[name],) = ax.plot(*curve, marker=marker, markersize=3.5, lw=1.2, **style)
        ax.set(**panel.axes)
        ax.grid(alpha=0.3)
    figure.suptitle(title, fontsize=10)
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4)
    return figure
