"""Tables: CSV with any delimiter and Parquet, one stream whose columns only their user's map can
tell; and flights of the Neural-Fly data set (O'Connell et al. 2022), CSV at 50 Hz.

A cell may hold a list of numbers, or a list of lists: its numbers are columns `name[0]`, `name[1]`,
… row by row.
Of Neural-Fly, W is z up. The attitude `q` is x, y, z, w from body to W, the body's z axis along the
thrust. The rates `w` are in axes of W, not of the body: where the vehicle leans against the wind
they differ, and the derivative of `q` agrees in W only. `T_sp` is the normalised collective thrust
command, `hover_throttle` the one that hovers, by battery voltage; thrust grows with about the 1.3th
power of their quotient about hover. `pwm` [us] is that of the four motors.
"""

from pathlib import Path
from typing import Any

import numpy as np

from np_drake.finding import Finding
from np_drake.logs.columns import COLUMNS, FORCE, THRUST
from np_drake.logs.formats import parquet_file, text_table
from np_drake.logs.formats.format import (
    Contents,
    Format,
    Progress,
    Recording,
    Stream,
    Wanted,
    indexed,
)
from np_drake.logs.formats.text_table import first_lines, split_header, stated_units
from np_drake.logs.importing.log_map import UNITS, LogMap, Source

STREAM = "table"
TEXTS = (".csv", ".csv.gz", ".txt", ".txt.gz", ".tsv", ".tsv.gz")
PARQUET = ".parquet"
# Names of a time column, the first that is found, and its unit.
TIMES = {
    name: unit
    for unit, names in {
        "s": "t, time, timestamp, Time, Timestamp, T, t_s, time_s, timestamp_s",
        "ms": "t_ms, time_ms, timestamp_ms, TimeMS",
        "us": "t_us, time_us, timestamp_us, TimeUS",
        "ns": "t_ns, time_ns, timestamp_ns, TimeNS",
    }.items()
    for name in names.split(", ")
}


# Our own columns: field of the map, group of columns, how they are meant; the first that is there.
OUR_COLUMNS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("attitude", "q", {}),
    ("position", "p", {}),
    ("velocity", "v", {"axes": "world"}),
    ("rates", "w", {"axes": "body"}),
    ("acceleration", "a", {"axes": "world", "kind": "acceleration"}),
    ("acceleration", "force", {"axes": "body", "kind": "specific_force"}),
    ("angular_acceleration", "al", {"axes": "body"}),
    ("thrust", "thrust", {}),
    ("torque", "torque", {}),
    ("rotor_speed", "rotor", {}),
    ("throttle", "throttles", {}),
    ("throttle", "throttle", {}),
    ("voltage", "voltage", {}),
)


def recognises(path: Path, start: bytes) -> bool:
    """Return whether the name is that of a table, and the first line, of a text, has several
    columns.
    """
    if path.name.lower().endswith(PARQUET):
        return True
    if not path.name.lower().endswith(TEXTS):
        return False
    line = first_lines(start)[0]
    return bool(line) and "\x00" not in line and len(split_header(line)) > 1


def contents(path: Path) -> Contents:
    """Return the columns, from the header and the first row.

    Raises: LogError: if the file is no table; OSError: if it cannot be opened.
    """
    names = (
        parquet_file.column_names(path) if is_parquet(path) else text_table.read_layout(path).names
    )
    return {STREAM: tuple(names)}


def default_map(contents: Contents) -> LogMap | None:
    """Return the map of our own columns (docs/reference/flight-log.md).

    None without time, and attitude with one of position, velocity and acceleration, or body rates
    with specific force; what else the state lacks, an import derives.
    """
    names = set(contents.get(STREAM, ()))
    groups = {**COLUMNS, "force": FORCE, "thrust": THRUST, "torque": COLUMNS["u"][1:]}
    here = {field: list(group) for field, group in groups.items() if names.issuperset(group)}
    posed = "q" in here and {"p", "v", "a"} & here.keys()
    if "t" not in here or not (posed or {"w", "force"} <= here.keys()):
        return None
    log_map = LogMap(format=STREAM, command="held_after", time=Source(["t"]))
    for name, field, how in OUR_COLUMNS:
        columns = here.get(field)
        if columns and not getattr(log_map, name):
            setattr(log_map, name, Source(columns, **how))
    return log_map.check()


def read(path: Path, wanted: Wanted, progress: Progress) -> Recording:
    """Return the wanted columns as one stream, its times from the first of `TIMES` that is there.

    Without such a column all times are NaN: `with_map_time` takes them from the column that the map
    names.

    Args:
        progress: called with the share that is read [1].
    Raises: LogError: one line with file, row and column, on a damaged file or a wanted cell that is
        no number.
    """
    known = contents(path)[STREAM]
    names = list(wanted.get(STREAM, ()))
    time = next((name for name in TIMES if name in known), None)
    needed = list(dict.fromkeys([*names, *([time] if time else [])])) or list(known[:1])
    if is_parquet(path):
        columns = parquet_file.read_columns(path, needed)
        findings = list[Finding]()
        units = stated_units(known)
        progress(1.0)
    else:
        columns, findings = text_table.read_columns(path, needed, progress)
        units = {**stated_units(known), **text_table.read_layout(path).units}
    length = len(next(iter(columns.values()), ()))
    t = columns[time] * UNITS["time"][TIMES[time]] if time else np.full(length, np.nan)
    clock = f"column {time} [{TIMES[time]}]" if time else "none of the known names"
    return Recording(
        str(path),
        {STREAM: Stream(t, {name: columns[name] for name in names})},
        {"clock": clock},
        tuple(findings),
        units=units,
    )


def is_parquet(path: Path) -> bool:
    """Return whether the file is read as Parquet, by its name."""
    return path.name.lower().endswith(PARQUET)


# Columns of every file of Neural-Fly.
NEURAL_FLY_HEADER = ("t", "p", "v", "q", "R", "w", "T_sp", "q_sp", "hover_throttle", "fa", "pwm")


def _is_neural_fly(path: Path, start: bytes) -> bool:
    """Return whether the header has the columns of the data set."""
    return recognises(path, start) and set(NEURAL_FLY_HEADER) <= set(
        split_header(first_lines(start)[0])
    )


def _neural_fly_map(contents: Contents) -> LogMap | None:
    """Return the map of the data set; None if a column is not there.

    The rows are a thinned record of a faster loop: a command is a sample of one that changes in
    between.
    """
    log_map = LogMap(
        format="neural_fly",
        world="enu",
        body="flu",
        command="sampled",
        time=Source(["t"]),
        position=Source(indexed("p", 3)),
        velocity=Source(indexed("v", 3), axes="world"),
        attitude=Source(indexed("q", 4), order="xyzw", direction="body_to_world"),
        rates=Source(indexed("w", 3), axes="world"),
        throttle=Source(indexed("T_sp", 1)),
        hover_throttle=Source(indexed("hover_throttle", 1)),
    ).check()
    return log_map if set(log_map.names()) <= set(contents.get(STREAM, ())) else None


TABLE = Format(STREAM, "CSV or Parquet table with a map", recognises, contents, default_map, read)
NEURAL_FLY = Format(
    "neural_fly", "Neural-Fly data set, CSV", _is_neural_fly, contents, _neural_fly_map, read
)
