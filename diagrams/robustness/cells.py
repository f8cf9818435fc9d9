"""Cells of the robustness sweep: the flights of a controller at one setting, and two controllers
compared there.
"""

from collections.abc import Sequence

import numpy as np

from diagrams.batch.campaign import Record
from diagrams.robustness.axes import Setting
from np_drake.metrics import half_width

ERRORS = ("E_xy", "E_z")  # keys of the errors [m]
GROWTHS = ("growth", "swing_growth")  # keys of growth over the steady window [1]
Key = tuple[str, frozenset]  # of a cell: row and setting


class Cells:
    """Records by row and setting, in the order of their seeds."""

    def __init__(self, records: Sequence[Record]):
        self._records: dict[Key, list[Record]] = {}
        self.rows = list(dict.fromkeys(record["case"]["row"] for record in records))
        for record in sorted(records, key=lambda record: record["case"]["seed"]):
            case = record["case"]
            setting = {
                name: value for name, value in case.items() if name not in ("row", "model", "seed")
            }
            self._records.setdefault((case["row"], frozenset(setting.items())), []).append(record)

    def flights(self, row: str, setting: Setting) -> list[Record]:
        """Return the records of a cell, one a seed.

        Args:
            setting: all of a case but row, model and seed.
        """
        return self._records.get((row, frozenset(setting.items())), [])


def lost(record: Record) -> bool:
    """Return whether the vehicle was lost, or the flight has no result."""
    return "result" not in record or record["result"]["lost_at"] is not None


def lost_line(record: Record, head: str) -> str | None:
    """Return a line on a lost or failed flight; None on any other."""
    result = record.get("result")
    if result is None:
        return f"{head}: failed: {record['error']}"
    if result["lost_at"] is None:
        return None
    return (
        f"{head}: lost at {result['lost_at']:.2f} s; a rotor at its limit in "
        f"{100 * result['at_limit']:.0f} % of the "
        "periods"
    )


def summary(records: Sequence[Record]) -> dict:
    """Return means and 95 % intervals (Student) of a cell over its seeds.

    Returns: {"flights", "lost": lost or failed flights, "E_xy", "E_z" [m], their half intervals
    "E_xy_ci95",
        "E_z_ci95" (NaN of one seed), "growth", "swing_growth" [1]: None where one is lost,
        "spread": largest relative deviation of a seed's E_xy from the mean [1], "solve_failures",
        "at_limit" [1]}.
    """
    results = [record["result"] for record in records if "result" in record]
    count = sum(map(lost, records))
    line: dict = {"flights": len(records), "lost": count}
    for key in (*ERRORS, *GROWTHS):
        values = [result[key] for result in results]
        whole = bool(values) and not count and None not in values
        line[key] = float(np.mean(values)) if whole else None
        if key in ERRORS:
            line[f"{key}_ci95"] = half_width(np.array(values)) if whole else None
    e_xy = np.array([result["E_xy"] for result in results], float)
    line["spread"] = (
        None if line["E_xy"] is None else float(np.max(np.abs(e_xy / line["E_xy"] - 1.0)))
    )
    line["solve_failures"] = sum(result["solve_failures"] for result in results)
    line["at_limit"] = max((result["at_limit"] for result in results), default=0.0)
    return line


def compare(mine: Sequence[Record], theirs: Sequence[Record]) -> int:
    """Return −1 where E_xy of `mine` is below that of `theirs`, 1 where it is above, 0 where
    neither shows.

    It shows where the 95 % interval (Student) of the mean difference of equal seeds excludes zero;
    fewer lost flights take precedence. One seed shows nothing but a loss.
    """
    lost_mine, lost_theirs = sum(map(lost, mine)), sum(map(lost, theirs))
    if lost_mine != lost_theirs or lost_mine:
        return int(np.sign(lost_mine - lost_theirs))
    others = {record["case"]["seed"]: record["result"]["E_xy"] for record in theirs}
    pairs = [
        (r["result"]["E_xy"], others[r["case"]["seed"]])
        for r in mine
        if r["case"]["seed"] in others
    ]
    difference = np.array([a - b for a, b in pairs])
    if len(difference) < 2 or not abs(difference.mean()) > half_width(difference):
        return 0
    return int(np.sign(difference.mean()))
