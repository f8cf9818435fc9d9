"""Table of the vehicles: errors of every controller on every track, and over the oracle's."""

from collections.abc import Sequence

from diagrams.batch.campaign import Record
from diagrams.batch.columns import Column, Line, grouped, spread, tabulate
from diagrams.batch.run import Table
from diagrams.robustness.cells import ERRORS, Cells, lost_line, summary
from diagrams.robustness.vehicles.fleet import ROWS, TRACKS, VEHICLES
from np_drake.files.number_text import NOTHING

ORACLE = "oracle"  # row that the others are divided by


def vehicle_table(records: Sequence[Record]) -> list[dict]:
    """Return one line a vehicle, track and row that flew.

    Returns: {"vehicle", "track", "row", what `summary` returns, "E_xy_ratio", "E_z_ratio": over the
    oracle's mean,
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
    cases = [record["case"] for record in records]
    heads = [f"{c['row']}, {c['vehicle']}, {c['track']}, seed {c['seed']}" for c in cases]
    said = (lost_line(record, head) for record, head in zip(records, heads, strict=True))
    return [line for line in said if line is not None]


def vehicles_printed(lines: list[dict], title: str) -> list[Table]:
    """Return a table for every vehicle, a block for every track; errors in cm.

    Args:
        lines: of `vehicle_table`.
    """

    def error(key: str):
        value = spread(key, 3)
        return lambda line: NOTHING if line[key] is None else value(line)

    columns: tuple[Column, ...] = (
        ("controller", "row"),
        ("E_xy [cm]", error("E_xy")),
        ("over oracle", _over("E_xy_ratio")),
        ("E_z [cm]", error("E_z")),
        ("over oracle", _over("E_z_ratio")),
        ("lost", lambda line: f"{line['lost']} of {line['flights']}"),
    )
    tables = []
    for vehicle in dict.fromkeys(line["vehicle"] for line in lines):
        mine = [line for line in lines if line["vehicle"] == vehicle]
        blocks: dict[str, list[tuple]] = {}
        for track in dict.fromkeys(line["track"] for line in mine):
            blocks[track] = tabulate(
                "", [line for line in mine if line["track"] == track], columns
            )[2]
        said = f"vehicle {vehicle}, mean and 95 % interval; {title}"
        tables.append(grouped(said, [header for header, _ in columns], blocks))
    return tables


def _over(key: str):
    """Return the cell of a ratio to the oracle's error."""

    def cell(line: Line) -> str:
        return NOTHING if line[key] is None else f"{line[key]:.1f}"

    return cell
