"""Table of the vehicles: errors of every controller on every track, and over the oracle's."""

from collections.abc import Sequence

from diagrams.batch.campaign import Record
from diagrams.robustness.cells import ERRORS, Cells, summary
from diagrams.robustness.vehicles.fleet import TRACKS, VEHICLES
from diagrams.robustness.vehicles.study import ROWS

ORACLE = "oracle"  # row that the others are divided by


def vehicle_table(records: Sequence[Record]) -> list[dict]:
    """Return one line a vehicle, track and row that flew.

    Returns: {"vehicle", "track", "row", what `summary` returns, "E_xy_ratio", "E_z_ratio": over the oracle's mean,
        None where either is lost or did not fly [1]}.
    """
    cells, lines = Cells(records), []
    for vehicle in VEHICLES:
        for track in TRACKS:
            place = {"vehicle": vehicle, "track": track}
            base = _summary(cells, ORACLE, place)
            for row in ROWS:
                if line := _summary(cells, row.name, place):
                    ratios = {f"{key}_ratio": _ratio(line, base, key) for key in ERRORS}
                    lines.append({**place, "row": row.name, **line, **ratios})
    return lines


def _summary(cells: Cells, row: str, place: dict) -> dict | None:
    flights = cells.flights(row, place)
    return summary(flights) if flights else None


def _ratio(line: dict, base: dict | None, key: str) -> float | None:
    if base is None or line[key] is None or base[key] is None:
        return None
    return line[key] / base[key]


def lost_flights(records: Sequence[Record]) -> list[str]:
    """Return a line on each lost or failed flight."""
    said = []
    for record in records:
        case, result = record["case"], record.get("result")
        head = f"{case['row']}, {case['vehicle']}, {case['track']}, seed {case['seed']}: "
        if result is None:
            said.append(f"{head}failed: {record['error']}")
        elif result["lost_at"] is not None:
            said.append(
                f"{head}lost at {result['lost_at']:.2f} s; a rotor at its limit in {100 * result['at_limit']:.0f} % of "
                f"the periods"
            )
    return said
