"""Printed table and maps of the grid of payload, tether and speed.

A map is E_xy of a controller over that of others, a panel a speed, payload by tether.
"""

import re
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from diagrams.batch.columns import Column, tabulate
from diagrams.batch.run import Table
from diagrams.robustness.axes import Grid
from diagrams.robustness.grid_table import FLOOR, NAIVE, NEAR, grid_by_speed, grid_table
from diagrams.robustness.measures import GROWING
from diagrams.robustness.robustness import ROWS
from np_drake.files.figure_file import new_figure
from np_drake.files.number_text import NOTHING

# Key of the ratio, what it is divided by, and the ratio that is drawn white.
RATIOS = (("over_oracle", "oracle", NEAR), ("over_naive", "best naive", 1.0))
# diverging, and distinguishable for colour-blind readers: violet is low, orange is high
COLOURS = "PuOr_r"
SPAN = 3.0  # octaves from white to the darkest colour


def grid_printed(points: Sequence[dict], title: str) -> list[Table]:
    """Return the tables of `grid_by_speed` and `grid_table`.

    Args:
        points: of `grid_points`; empty without a grid, which has no table.
    """
    if not points:
        return []
    lines = grid_table(points)

    def shares(name: str) -> Callable[[dict], str]:
        def cell(line: dict) -> str:
            if name not in line["better"]:
                return NOTHING
            return f"{_percent(line['better'][name])} / {_percent(line['worse'][name])}"

        return cell

    flown = [name for name in NAIVE if any(line["row"] == name for line in lines)]
    columns: list[Column] = [
        ("controller", "row"),
        ("near oracle", lambda line: NOTHING if line["near"] is None else _percent(line["near"])),
        ("worst ratio", _worst),
        *((f"against {name}", shares(name)) for name in flown),
        ("growing", lambda line: f"{line['growing']} of {line['points']}"),
        ("lost", lambda line: f"{line['lost']} of {line['flights']}"),
    ]
    said = (
        f"grid, shares of {lines[0]['points']} points in E_xy; near oracle: at most "
        f"{NEAR:g} times its error and "
        f"{100 * FLOOR:g} cm; against: better / worse by the 95 % interval of paired "
        f"differences; growing: error or "
        f"swing of the last third above {GROWING:g} times that of the first"
    )
    return [_by_speed(grid_by_speed(points), title), tabulate(f"{said}; {title}", lines, columns)]


def _by_speed(lines: Sequence[dict], title: str) -> Table:
    def cell(speed: float) -> Callable[[dict], str]:
        def of(line: dict) -> str:
            found = line["speeds"][speed]
            if found is None:
                return "lost"
            median, least, most = (100 * value for value in found)
            return f"{median:.2f} ({least:.2f}–{most:.2f})"

        return of

    columns: list[Column] = [("controller", "row")]
    columns += [(f"{speed:g} m/s", cell(speed)) for speed in lines[0]["speeds"]]
    return tabulate(
        f"grid, E_xy [cm] by speed: median (smallest–largest) of its points; {title}",
        lines,
        columns,
    )


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _worst(line: dict) -> str:
    if line["worst"] is None:
        return NOTHING
    at = line["worst_at"]
    tether = f", {at['length']:g} m" if at["mass"] > 0 else ""
    return f"{line['worst']:.3g} ({at['mass']:g} kg{tether}, {at['speed']:g} m/s)"


def grid_figures(
    points: Sequence[dict], grid: Grid | None, title: str
) -> dict[str, Callable[[], Figure]]:
    """Return the maps of every controller with a Neural Predictor, by file name.

    Args:
        points: of `grid_points`.
        grid: that was flown; None for none, which has no map.
    """
    if grid is None:
        return {}
    flown = {point["row"] for point in points}
    names = [row.name for row in ROWS if row.kind in ("np", "payload_filter") and row.name in flown]
    return {
        f"grid_{re.sub(r'[^a-z0-9]+', '_', name)}.png": partial(
            grid_figure, points, grid, row=name, title=f"{name}, {title}"
        )
        for name in names
    }


def grid_figure(points: Sequence[dict], grid: Grid, *, row: str, title: str = "") -> Figure:
    """Plot the ratios of `row` as maps, one row of panels a ratio, with a cross where a flight is
    lost.

    Args:
        points: of `grid_points`.
    """
    mine = {(p["mass"], p["length"], p["speed"]): p for p in points if p["row"] == row}
    shown = [
        ratio for ratio in RATIOS if any(p[ratio[0]] is not None for p in mine.values())
    ] or RATIOS[1:]
    figure, axes = new_figure(
        len(shown),
        len(grid.speed),
        width=1.6 + 2.1 * len(grid.speed),
        height=0.8 + 2.2 * len(shown),
        sharex=True,
        sharey=True,
    )
    for panels, (key, other, white) in zip(axes, shown, strict=True):
        for ax, speed in zip(panels, grid.speed, strict=True):
            image = _map(ax, mine, grid, speed, key=key, white=white)
            ax.set_title(f"{speed:g} m/s", fontsize=9)
        bar = figure.colorbar(image, ax=panels, extend="both")
        ticks = np.arange(-SPAN, SPAN + 1)
        bar.set_ticks(ticks, labels=[f"{white * 2.0**octave:g}" for octave in ticks])
        bar.set_label(f"E_xy of {row} over\n{other} [1]", fontsize=8)
        panels[0].set_ylabel("tether [m]")
    for ax in axes[-1]:
        ax.set_xlabel("payload [kg]")
    figure.suptitle(title, fontsize=9)
    return figure


def _map(ax, points: dict, grid: Grid, speed: float, *, key: str, white: float):
    """Draw one panel and return its image."""
    values = np.full((len(grid.length), len(grid.mass)), np.nan)
    for i, length in enumerate(grid.length):
        for j, mass in enumerate(grid.mass):
            setting = grid.setting(mass, length, speed)
            point = points.get((setting["mass"], setting["length"], setting["speed"]))
            if point is None:
                continue
            if point[key] is not None:
                values[i, j] = np.log2(point[key] / white)
            _write(ax, j, i, point, key, dark=abs(np.nan_to_num(values[i, j])) > 0.6 * SPAN)
    image = ax.imshow(
        values,
        origin="lower",
        aspect="auto",
        cmap=COLOURS,
        norm=Normalize(-SPAN, SPAN),
        interpolation="none",
    )
    ax.set_xticks(range(len(grid.mass)), [f"{mass:g}" for mass in grid.mass], fontsize=8)
    ax.set_yticks(range(len(grid.length)), [f"{length:g}" for length in grid.length], fontsize=8)
    ax.set_facecolor("0.85")
    return image


def _write(ax, column: int, line: int, point: dict, key: str, *, dark: bool) -> None:
    """Write the ratio of a cell, or a cross with the number of lost flights."""
    if point["lost"]:
        text = f"× {point['lost']}/{point['flights']}"
    else:
        text = "–" if point[key] is None else _digits(point[key])
    colour = "white" if dark else "black"
    ax.text(column, line, text, ha="center", va="center", fontsize=7, color=colour)


def _digits(ratio: float) -> str:
    return f"{ratio:.0f}" if ratio >= 10 else f"{ratio:.2g}"
