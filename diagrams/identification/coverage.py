"""Tables of the identification of simulated vehicles: intervals, errors, and what was asked of
them.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from diagrams.batch.run import Table
from diagrams.identification.simulated import INPUTS
from diagrams.identification.vehicle_case import SHARE, TIME
from diagrams.studies.columns import tabulate
from np_drake.files.number_text import NOTHING

SCALES = ("thrust coefficient", "logged thrust, true over logged")
ASKED: tuple[tuple[str, tuple[str, ...], float, str], ...] = (
    ("thrust coefficient, mass ratio", SCALES, 1.0, SHARE),
    ("centre of mass", ("centre of mass x", "centre of mass y"), 1.0, "mm per 10 cm arm"),
    ("inertia roll, pitch", ("inertia xx", "inertia yy"), 5.0, SHARE),
    ("motor lag", ("time constant up", "time constant down"), 3.0, TIME),
    ("delay", ("transport delay",), 3.0, TIME),
)
ALIKE = {  # quantities of one kind, by the line that holds them
    "inertia xx, yy": ("inertia xx", "inertia yy"),
    "inertia xz, yz": ("inertia xz", "inertia yz"),
    "centre of mass x, y": ("centre of mass x", "centre of mass y"),
    "gains of the rotors": tuple(f"gain of rotor {i}" for i in (1, 2, 3, 4)),
    "IMU x, y, z": ("IMU x", "IMU y", "IMU z"),
    "IMU tilt x, y": ("IMU tilt x", "IMU tilt y"),
    "time constants up, down": ("time constant up", "time constant down"),
}
LINE_OF = {name: line for line, names in ALIKE.items() for name in names}
COVERED = (0.90, 0.98)  # share of 95 % intervals that was asked to hold the truth
QUICK = 5.0  # processor time of an identification that was asked for [s]
Result = dict[str, Any]


def quantity_lines(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Return a line for every kind of quantity: how often told, share of intervals with the truth,
    median errors.

    Errors are medians over the vehicles of which the quantity is told. `count`: vehicles times
    quantities of the kind.

    Args: results: of `VehicleCase`.
    """
    rows = [q for result in results for q in result["quantities"]]
    lines = []
    for name in dict.fromkeys(LINE_OF.get(q["name"], q["name"]) for q in rows):
        own = [q for q in rows if LINE_OF.get(q["name"], q["name"]) == name]
        told = [q for q in own if q["told"]]
        line = {
            "name": name,
            "unit": own[0]["unit"],
            "air": own[0]["air"],
            "count": len(own),
            "told": len(told),
        }
        line["within"] = _mean([q["within"] for q in told])
        line |= {
            key: _median([q[key] for q in told]) for key in ("error", "prior_error", "plain_error")
        }
        lines.append(line)
    return lines


def pooled_lines(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Return a line for all vehicles and for those of each input: shares of intervals with the
    truth, and cost.

    Args: results: of `VehicleCase`, each with its "kind".
    """
    lines = []
    for kind in ("all", *INPUTS):
        own = [r for r in results if kind in ("all", r["kind"])]
        if not own:
            continue
        line: dict[str, Any] = {
            "input": kind,
            "vehicles": len(own),
            "refused": sum(r["refused"] for r in own),
        }
        for air, key in ((False, "vehicle"), (True, "air")):
            line[key], line[f"{key}_ci95"], line[f"{key}_told"] = _covered(own, air)
        line["processor_time"] = _median([r["processor_time"] for r in own])
        lines.append(line)
    return lines


def asked_lines(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Return a line for every figure that was asked for: the bound, and what was seen.

    Args: results: of `VehicleCase`, each with its "kind".
    """
    pooled = pooled_lines(results)[0]
    rows = [q for result in results for q in result["quantities"]]
    share = f"{100 * COVERED[0]:.0f} to {100 * COVERED[1]:.0f} %"
    lines = [
        {
            "figure": f"95 % interval holds the truth, {of}",
            "asked": share,
            "seen": _percent(pooled[key]),
            "met": pooled[key] is not None and COVERED[0] <= pooled[key] <= COVERED[1],
        }
        for key, of in (("vehicle", "quantities of the vehicle file"), ("air", "drag and lift"))
    ]
    for figure, names, bound, unit in ASKED:
        own = [q for q in rows if q["name"] in names]
        told, every = (
            _median([q["error"] for q in own if q["told"]]),
            _median([q["error"] for q in own]),
        )
        seen = (
            NOTHING if every is None else f"{_number(told)} (all vehicles {_number(every)}) {unit}"
        )
        met = told is not None and told <= bound
        lines.append(
            {
                "figure": f"{figure}, median error",
                "asked": f"≤ {bound:g} {unit}",
                "seen": seen,
                "met": met,
            }
        )
    spent = pooled["processor_time"]
    lines.append(
        {
            "figure": "processor time, median",
            "asked": f"≤ {QUICK:g} s",
            "seen": f"{spent:.1f} s",
            "met": spent <= QUICK,
        }
    )
    return lines


def printed(results: Sequence[Result], title: str) -> list[Table]:
    """Return the tables.

    Args:
        results: of `VehicleCase`, each with its "kind".
    """

    def number(key: str) -> Callable[[dict[str, Any]], str]:
        return lambda line: _number(line[key])

    def share(key: str) -> Callable[[dict[str, Any]], str]:
        return lambda line: f"{_percent(line[key], line[f'{key}_ci95'])} of {line[f'{key}_told']}"

    asked = tabulate(
        f"asked and seen; {title}",
        asked_lines(results),
        [
            ("figure", "figure"),
            ("asked", "asked"),
            ("seen", "seen"),
            ("met", lambda line: "yes" if line["met"] else "no"),
        ],
    )
    pooled = tabulate(
        "truth inside its 95 % interval",
        pooled_lines(results),
        [
            ("input", "input"),
            ("vehicles", "vehicles"),
            ("vehicle file", share("vehicle")),
            ("drag and lift", share("air")),
            ("draws not flyable", "refused"),
            ("processor time [s]", lambda line: f"{line['processor_time']:.1f}"),
        ],
    )
    each = tabulate(
        "a quantity: where it is told, truth inside its interval, and median error",
        quantity_lines(results),
        [
            ("quantity", "name"),
            ("told", lambda line: f"{line['told']} of {line['count']}"),
            ("inside", lambda line: _percent(line["within"])),
            ("error", number("error")),
            ("prior alone", number("prior_error")),
            ("least squares", number("plain_error")),
            ("unit", "unit"),
        ],
    )
    return [asked, pooled, each]


def _covered(results: Sequence[Result], air: bool) -> tuple[float | None, float | None, int]:
    """Return the share of intervals with the truth, half its 95 % interval by vehicles, and the
    number of intervals.
    """
    counts = [
        [q["within"] for q in r["quantities"] if q["told"] and q["air"] == air] for r in results
    ]
    inside, told = (
        np.array([sum(c) for c in counts], float),
        np.array([len(c) for c in counts], float),
    )
    if not told.sum():
        return None, None, 0
    share = float(inside.sum() / told.sum())
    if len(results) < 2:
        return share, None, int(told.sum())
    # Intervals of one vehicle err together: variance of a ratio of sums over vehicles.
    n = len(results)
    half = 1.96 * float(np.sqrt(n / (n - 1) * np.sum((inside - share * told) ** 2)) / told.sum())
    return share, half, int(told.sum())


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _median(values: Sequence[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return float(np.median(known)) if known else None


def _percent(share: float | None, half: float | None = None) -> str:
    if share is None:
        return NOTHING
    return f"{100 * share:.1f}" + ("" if half is None else f" ± {100 * half:.1f}") + " %"


def _number(value: float | None) -> str:
    return NOTHING if value is None else f"{value:.2g}"
