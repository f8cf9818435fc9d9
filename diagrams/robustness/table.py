"""Tables of the robustness sweep: errors along every axis, and the range in which a controller
beats nominal.
"""

from collections.abc import Sequence

import numpy as np

from diagrams.batch.campaign import Case, Record
from diagrams.robustness.axes import BASE, FLOWN, Axis
from diagrams.robustness.cells import ERRORS, Cells, lost_line, summary
from diagrams.robustness.robustness import ROWS

NOMINAL = "nominal"  # row that the others are compared with
Interval = tuple[float, float]


def _along(cells: Cells, axis: Axis, row: str) -> list[dict]:
    """Return one line a value of the axis: {"value", and what `summary` returns}."""
    return [
        {"value": value, **summary(cells.flights(row, BASE | {axis.name: value}))}
        for value in axis.values
    ]


def robustness_table(records: Sequence[Record], axes: Sequence[Axis] = FLOWN) -> list[dict]:
    """Return one line an axis and row that flew: `points`, a `summary` a value, and `better`,
    intervals by error.
    """
    cells, lines = Cells(records), []
    flown = [row.name for row in ROWS if row.name in cells.rows]
    for axis in axes:
        base = _along(cells, axis, NOMINAL)
        for row in flown:
            points = _along(cells, axis, row)
            better = {key: better_than(points, base, key) for key in ERRORS}
            lines.append({"axis": axis.name, "row": row, "points": points, "better": better})
    return lines


def better_than(points: Sequence[dict], base: Sequence[dict], key: str) -> list[Interval]:
    """Return the intervals of the axis in which the error `key` is below that of `base`.

    Between values the logarithm of the ratio is interpolated linearly. No line leads to or from a
    lost flight: it is never better, and where only `base` is lost, `points` is.

    Args:
        points: of a controller, by value of the axis.
        base: of the controller that it is compared with, at the same values.
    """
    values = [point["value"] for point in points]
    ratio = [_log_ratio(point[key], other[key]) for point, other in zip(points, base, strict=True)]
    found: list[Interval] = []
    for i, r in enumerate(ratio):
        if not r < 0:
            continue
        high = _edge(values, ratio, i, i + 1)
        if found and ratio[i - 1] < 0:
            found[-1] = (found[-1][0], high)
        else:
            found.append((_edge(values, ratio, i, i - 1), high))
    return found


def _log_ratio(error: float | None, base: float | None) -> float:
    """Return the log ratio, infinite where the flight is lost and minus infinite where only the
    base is.
    """
    if error is None:
        return np.inf
    return float(np.log(error / base)) if base is not None else -np.inf


def _edge(values: list[float], ratio: list[float], inside: int, outside: int) -> float:
    """Return where the line from `inside`, which is better, to its neighbour meets zero; else the
    point itself.
    """
    if not 0 <= outside < len(values) or not np.isfinite([ratio[inside], ratio[outside]]).all():
        return values[inside]
    if ratio[outside] < 0:
        return values[inside]
    return float(np.interp(0.0, [ratio[inside], ratio[outside]], [values[inside], values[outside]]))


def lost_lines(records: Sequence[Record]) -> list[str]:
    """Return a line on each lost or failed flight: when, and what the rotors did before."""
    said = []
    for record in records:
        case, result = record["case"], record.get("result")
        line = lost_line(record, f"{case['row']}, {_off_base(case)}, seed {case['seed']}")
        if line is not None and result is not None:
            line += f", {100 * result['at_limit_last']:.0f} % of the last second; {_angles(result)}"
        said += [] if line is None else [line]
    return said


def _off_base(case: Case) -> str:
    """Return the quantities of a case that are off their base."""
    off = [
        f"{axis.title} {axis.says(case[axis.name])}"
        for axis in FLOWN
        if case[axis.name] != axis.base
    ]
    return ", ".join(off) or "base"


def axes_of(lines: Sequence[dict]) -> list[Axis]:
    """Return the axes that occur in the lines of `robustness_table`."""
    return [axis for axis in FLOWN if any(line["axis"] == axis.name for line in lines)]


def extremes(records: Sequence[Record], axes: Sequence[Axis]) -> list[str]:
    """Return, for each axis, a line on the flight that came nearest to a rotor's limit."""
    said = []
    for axis in axes:
        off = BASE.keys() - {axis.name}
        mine = [r for r in records if "result" in r and all(r["case"][k] == BASE[k] for k in off)]
        if mine:
            most = max(mine, key=lambda record: record["result"]["thrust"])
            case, result = most["case"], most["result"]
            said.append(
                f"{axis.title}: the largest rotor command is {100 * result['thrust']:.0f} "
                f"% of its limit "
                f"({case['row']}, {axis.says(case[axis.name])}, seed {case['seed']}); "
                f"{_angles(result)}"
            )
    return said


def _angles(result: dict) -> str:
    swing = "" if result["swing"] is None else f", tether up to {np.degrees(result['swing']):.0f}°"
    return f"tilt up to {np.degrees(result['tilt']):.0f}°{swing}"
