"""Columns of a flight log file, and their mapping to the fields of a FlightLog."""

import numpy as np

from np_drake.logs.flight_log import FlightLog
from np_drake.logs.table import Table

COLUMNS: dict[str, tuple[str, ...]] = {  # field of FlightLog: columns of the file
    "t": ("t",),
    "p": ("px", "py", "pz"),
    "q": ("qw", "qx", "qy", "qz"),
    "v": ("vx", "vy", "vz"),
    "w": ("wx", "wy", "wz"),
    "a": ("ax", "ay", "az"),
    "al": ("alx", "aly", "alz"),
    "u": ("thrust", "tx", "ty", "tz"),
    "rotor": ("rotor1", "rotor2", "rotor3", "rotor4"),
}
STATE = ("t", "p", "q", "v", "w")  # fields that every log has
OPTIONAL = ("a", "al", "u", "rotor")  # u: only where rotor speed and a vehicle stand in for it
# All columns, in the order of the format.
NAMES = tuple(name for group in COLUMNS.values() for name in group)


def present_fields(table: Table) -> list[str]:
    """Return the fields whose columns are present and not wholly empty.

    Raises: LogError: if there is no row, a column of the state is missing or empty, or a group is there in part.
    """
    if not len(table):
        raise table.error("must hold rows; it has a header and no rows. Export the flight again.")
    fields = []
    for field, names in COLUMNS.items():
        filled = [name for name in names if name in table.columns and not _empty(table.columns[name])]
        if len(filled) == len(names):
            fields.append(field)
        elif filled or field in STATE:
            name = next(name for name in names if name not in filled)
            state = "is empty" if name in table.columns else "is missing"
            raise table.error(
                f"{state}; a flight log needs {', '.join(names)}. The header has: "
                f"{_shorten(list(table.columns))}.",
                column=name,
            )
    return fields


def assemble(table: Table, fields: list[str], name: str) -> FlightLog:
    """Return the log in memory; fields that the file lacks are None, a missing u is NaN."""
    arrays: dict[str, np.ndarray | None] = {f: table.array(COLUMNS[f]) for f in fields}
    t = table.columns["t"]
    for field in OPTIONAL:
        arrays.setdefault(field, None)
    if arrays["u"] is None:
        arrays["u"] = np.full((len(t), 4), np.nan)
    q = table.array(COLUMNS["q"])
    arrays |= {"t": t, "q": q / np.linalg.norm(q, axis=1, keepdims=True)}
    log = FlightLog(**arrays, name=name)  # type: ignore[arg-type]
    extra = [column for column in table.columns if column not in NAMES]
    if extra:
        log.notes.append(f"columns not used: {_shorten(extra)}")
    return log


def disassemble(log: FlightLog) -> dict[str, np.ndarray]:
    """Return columns (n,) in the order of the format; a command that came from rotor speed is left out."""
    out: dict[str, np.ndarray] = {}
    for field, names in COLUMNS.items():
        value = getattr(log, field)
        if value is None or (field == "u" and log.input == "rotor_speed"):
            continue
        out |= dict(zip(names, np.reshape(value, (len(log), -1)).T, strict=True))
    return out


def _empty(column: np.ndarray) -> bool:
    return bool(np.all(np.isnan(column)))


def _shorten(names: list[str]) -> str:
    return ", ".join(names[:8]) + (", …" if len(names) > 8 else "")
