"""Tables: CSV with any delimiter and Parquet, one stream whose columns only their user's map can
tell.

A cell may hold a list of numbers, or a list of lists: its numbers are columns `name[0]`, `name[1]`,
… row by row.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from np_drake.logs.columns import COLUMNS, FORCE
from np_drake.logs.errors import LogError
from np_drake.logs.formats import parquet_file, table_text
from np_drake.logs.formats.format import Contents, Format, Progress, Recording, Stream
from np_drake.logs.formats.table_units import stated_units
from np_drake.logs.importing.log_map import UNITS, LogMap, Source

STREAM = "table"
TEXTS = (".csv", ".csv.gz", ".txt", ".txt.gz", ".tsv", ".tsv.gz")
PARQUET = ".parquet"
# Names of a time column, the first that is found, and its unit.
TIMES = {
    **dict.fromkeys(
        ("t", "time", "timestamp", "Time", "Timestamp", "T", "t_s", "time_s", "timestamp_s"), "s"
    ),
    **dict.fromkeys(("t_ms", "time_ms", "timestamp_ms", "TimeMS"), "ms"),
    **dict.fromkeys(("t_us", "time_us", "timestamp_us", "TimeUS"), "us"),
    **dict.fromkeys(("t_ns", "time_ns", "timestamp_ns", "TimeNS"), "ns"),
}


def recognises(path: Path, start: bytes) -> bool:
    """Return whether the name is that of a table, and the first line, of a text, has several
    columns.
    """
    if path.name.lower().endswith(PARQUET):
        return True
    if not path.name.lower().endswith(TEXTS):
        return False
    line = first_line(start)
    return bool(line) and "\x00" not in line and len(table_text.split_header(line)) > 1


def first_line(start: bytes) -> str:
    """Return the header of a text table from its first bytes, which may be compressed; empty if
    they are no gzip.
    """
    return next(iter(table_text.first_lines(start)), "")


def contents(path: Path) -> Contents:
    """Return the columns, from the header and the first row.

    Raises: LogError: if the file is no table; OSError: if it cannot be opened.
    """
    names = (
        parquet_file.column_names(path) if is_parquet(path) else table_text.read_layout(path).names
    )
    return {STREAM: tuple(names)}


def default_map(contents: Contents) -> LogMap | None:
    """Return the map of our own columns (docs/reference/flight-log.md).

    None without time, and attitude with one of position, velocity and acceleration, or body rates
    with specific force; what else the state lacks, an import derives.
    """
    names = set(contents.get(STREAM, ()))
    here = {field: list(group) for field, group in COLUMNS.items() if names.issuperset(group)}
    posed = "q" in here and {"p", "v", "a"} & here.keys()
    if "t" not in here or not (posed or ("w" in here and names.issuperset(FORCE))):
        return None
    log_map = LogMap(format=STREAM, command="held_after", time=Source(["t"]))
    if "q" in here:
        log_map.attitude = Source(here["q"])
    if "p" in here:
        log_map.position = Source(here["p"])
    if "v" in here:
        log_map.velocity = Source(here["v"], axes="world")
    if "w" in here:
        log_map.rates = Source(here["w"], axes="body")
    if "a" in here:
        log_map.acceleration = Source(here["a"], axes="world", kind="acceleration")
    elif names.issuperset(FORCE):
        log_map.acceleration = Source(list(FORCE), axes="body", kind="specific_force")
    if "al" in here:
        log_map.angular_acceleration = Source(here["al"], axes="body")
    if "u" in here:
        log_map.thrust, log_map.torque = Source(here["u"][:1]), Source(here["u"][1:])
    elif "thrust" in names:
        log_map.thrust = Source(["thrust"])
    if "rotor" in here:
        log_map.rotor_speed = Source(here["rotor"])
    if throttle := here.get("throttles", here.get("throttle")):
        log_map.throttle = Source(throttle)
    if "voltage" in here:
        log_map.voltage = Source(here["voltage"])
    return log_map.check()


def read(path: Path, wanted: Mapping[str, list[str]], progress: Progress) -> Recording:
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
    lacking = [name for name in names if name not in known]
    if lacking:
        raise LogError(
            f"{path}, column {lacking[0]}: is missing; the header has {', '.join(known[:8])}, …."
        )
    time = next((name for name in TIMES if name in known), None)
    needed = list(dict.fromkeys([*names, *([time] if time else [])])) or list(known[:1])
    if is_parquet(path):
        columns, notes = parquet_file.read_columns(path, needed, progress)
        units = stated_units(known)
    else:
        columns, notes = table_text.read_columns(path, needed, progress)
        units = {**stated_units(known), **table_text.read_layout(path).units}
    length = len(next(iter(columns.values()), ()))
    t = columns[time] * UNITS["time"][TIMES[time]] if time else np.full(length, np.nan)
    clock = f"column {time} [{TIMES[time]}]" if time else "none of the known names"
    stream = Stream(t, {name: columns[name] for name in names})
    return Recording(str(path), {STREAM: stream}, {"clock": clock}, tuple(notes), units=units)


def is_parquet(path: Path) -> bool:
    """Return whether the file is read as Parquet, by its name."""
    return path.name.lower().endswith(PARQUET)


TABLE = Format(STREAM, "CSV or Parquet table with a map", recognises, contents, default_map, read)
