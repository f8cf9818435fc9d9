"""Tables of the grid of payload, tether and speed: how near a controller is to the oracle and to
naive ones.
"""

from collections.abc import Sequence

import numpy as np

from diagrams.batch.campaign import Record
from diagrams.loop.controller_config import LEARNED
from diagrams.robustness.axes import Grid, distinct
from diagrams.robustness.cells import GROWTHS, Cells, compare, summary
from diagrams.robustness.measures import GROWING
from diagrams.robustness.robustness import ROWS

ORACLE = "oracle"  # row that knows everything
NAIVE = tuple(
    row.name for row in ROWS if row.kind not in (*LEARNED, ORACLE)
)  # rows that learn nothing
NEAR, FLOOR = 2.0, 0.001  # near the oracle: at most NEAR times its E_xy [1] and FLOOR more [m]
E_XY = "E_xy"


def grid_points(records: Sequence[Record], grid: Grid) -> list[dict]:
    """Return one line a row and setting of the grid; without payload, one for all tethers.
    Returns: {"row", "mass" [kg], "length" [m], "speed" [m/s], what `summary` returns,
        "over_oracle", "over_naive": E_xy over that of the oracle and of the best naive row [1],
        None where either is lost, "near": whether it is near the oracle, "grows": whether error or
        swing grows by more than `GROWING`, "against": result of `compare` by naive row}.
    """
    cells, lines = Cells(records), []
    for setting in distinct(grid.settings()):
        means = {row: summary(cells.flights(row, setting)) for row in cells.rows}
        naive = [means[row][E_XY] for row in NAIVE if row in means and means[row][E_XY] is not None]
        ideal = means[ORACLE][E_XY] if ORACLE in means else None
        for row in cells.rows:
            line: dict = {
                "row": row,
                **{name: setting[name] for name in ("mass", "length", "speed")},
            }
            line |= means[row]
            line["over_oracle"] = _ratio(line[E_XY], ideal)
            line["over_naive"] = _ratio(line[E_XY], min(naive, default=None))
            line["near"] = None if ideal is None else _near(line[E_XY], ideal)
            line["grows"] = any(line[key] is not None and line[key] > GROWING for key in GROWTHS)
            mine = cells.flights(row, setting)
            line["against"] = {
                other: compare(mine, cells.flights(other, setting))
                for other in NAIVE
                if other in means and other != row
            }
            lines.append(line)
    return lines


def _ratio(error: float | None, other: float | None) -> float | None:
    return None if error is None or other is None else error / other


def _near(error: float | None, ideal: float) -> bool:
    return error is not None and error <= NEAR * ideal + FLOOR


def grid_table(points: Sequence[dict]) -> list[dict]:
    """Return one line a row that flew, in the order of `ROWS`.

    Returns: {"row", "points", "near": share of the points near the oracle [1], None without oracle,
    "worst": largest
        E_xy over the oracle's [1], "worst_at": its point, "better", "worse": shares of the points
        by naive row [1], "growing": points where error or swing grows, "lost": lost or failed
        flights, "flights"}.
    """
    lines = []
    for row in (row.name for row in ROWS):
        mine = [point for point in points if point["row"] == row]
        if not mine:
            continue
        judged = [point for point in mine if point["near"] is not None]
        worst = max(
            (p for p in mine if p["over_oracle"] is not None),
            key=lambda p: p["over_oracle"],
            default=None,
        )
        others = mine[0]["against"]
        lines.append(
            {
                "row": row,
                "points": len(mine),
                "near": float(np.mean([p["near"] for p in judged])) if judged else None,
                "worst": worst and worst["over_oracle"],
                "worst_at": worst and {name: worst[name] for name in ("mass", "length", "speed")},
                "better": {name: _share(mine, name, -1) for name in others},
                "worse": {name: _share(mine, name, 1) for name in others},
                "growing": sum(p["grows"] for p in mine),
                "lost": sum(p["lost"] for p in mine),
                "flights": sum(p["flights"] for p in mine),
            }
        )
    return lines


def grid_by_speed(points: Sequence[dict]) -> list[dict]:
    """Return one line a row: by speed [m/s] median, smallest and largest E_xy of its points [m].

    Returns: {"row", "speeds": {speed: (median, smallest, largest), None where one is lost}}.
    """
    lines = []
    for row in (row.name for row in ROWS):
        mine = [point for point in points if point["row"] == row]
        if mine:
            speeds = sorted({point["speed"] for point in mine})
            lines.append({"row": row, "speeds": {v: _spread(mine, v) for v in speeds}})
    return lines


def _spread(points: Sequence[dict], speed: float) -> tuple[float, float, float] | None:
    errors = [point[E_XY] for point in points if point["speed"] == speed]
    return None if None in errors else (float(np.median(errors)), min(errors), max(errors))


def _share(points: Sequence[dict], other: str, sign: int) -> float:
    return float(np.mean([point["against"][other] == sign for point in points]))
