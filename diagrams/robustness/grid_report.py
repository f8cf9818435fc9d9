"""Printed table and maps of the grid of payload, tether and speed."""

import re
from collections.abc import Callable, Sequence
from functools import partial

from matplotlib.figure import Figure

from diagrams.batch.columns import MISSING, Column, tabulate
from diagrams.batch.run import Table
from diagrams.robustness.axes import Grid
from diagrams.robustness.grid_figure import grid_figure
from diagrams.robustness.grid_table import FLOOR, NAIVE, NEAR, grid_by_speed, grid_table
from diagrams.robustness.measures import GROWING
from diagrams.robustness.robustness import ROWS


def grid_printed(points: Sequence[dict], title: str) -> list[Table]:
    """Return the tables of `grid_by_speed` and `grid_table`; none without a grid."""
    if not points:
        return []
    lines = grid_table(points)

    def shares(name: str) -> Callable[[dict], str]:
        def cell(line: dict) -> str:
            if name not in line["better"]:
                return MISSING
            return f"{_percent(line['better'][name])} / {_percent(line['worse'][name])}"

        return cell

    flown = [name for name in NAIVE if any(line["row"] == name for line in lines)]
    columns: list[Column] = [
        ("controller", "row"),
        ("near oracle", lambda line: MISSING if line["near"] is None else _percent(line["near"])),
        ("worst ratio", _worst),
        *((f"against {name}", shares(name)) for name in flown),
        ("growing", lambda line: f"{line['growing']} of {line['points']}"),
        ("lost", lambda line: f"{line['lost']} of {line['flights']}"),
    ]
    said = (
        f"grid, shares of {lines[0]['points']} points in E_xy; near oracle: at most {NEAR:g} times its error and "
        f"{100 * FLOOR:g} cm; against: better / worse by the 95 % interval of paired differences; growing: error or "
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
        f"grid, E_xy [cm] by speed: median (smallest–largest) of its points; {title}", lines, columns
    )


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _worst(line: dict) -> str:
    if line["worst"] is None:
        return MISSING
    at = line["worst_at"]
    tether = f", {at['length']:g} m" if at["mass"] > 0 else ""
    return f"{line['worst']:.3g} ({at['mass']:g} kg{tether}, {at['speed']:g} m/s)"


def grid_figures(points: Sequence[dict], grid: Grid | None, title: str) -> dict[str, Callable[[], Figure]]:
    """Return the maps of every controller with a Neural Predictor, by file name; none without a grid."""
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
