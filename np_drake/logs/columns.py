"""Table of numbers as a file holds it, and the mapping of its columns to the fields of a
FlightLog.
"""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.flight_log import COLUMNS as COLUMNS
from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError, place


@dc.dataclass
class Table:
    """Columns (n,) by name; an empty cell is NaN.

    path: of the file, for messages.
    unreadable: (row, column, text) of cells that hold no number (their value is NaN). ragged: rows
        with a wrong number of cells (all their values are NaN). header_lines: lines before the
        first row, 0 where the file has no lines.
    """

    path: str
    columns: dict[str, np.ndarray]  # name -> (n,)
    unreadable: list[tuple[int, str, str]] = dc.field(default_factory=list)
    ragged: list[int] = dc.field(default_factory=list)
    header_lines: int = 1

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def with_columns(self, columns: dict[str, np.ndarray]) -> "Table":
        """Return a table of the same file with other columns."""
        return Table(self.path, columns, header_lines=self.header_lines)

    def array(self, names: tuple[str, ...]) -> np.ndarray:
        """Return the named columns, (n, len(names))."""
        return np.stack([self.columns[name] for name in names], axis=1)

    def error(self, what: str, *, column: str | None = None, row: int | None = None) -> LogError:
        """Return a LogError about one place of this file.

        Args:
            row: counts from 0.
        """
        where = place(self.path, column=column, row=row, header_lines=self.header_lines)
        return LogError(f"{where}: {what}")

    def require_cells(self) -> None:
        """Check that every cell is a number and every row is complete.

        Raises: LogError: at the first cell that is not a number, or row of a wrong length.
        """
        if self.ragged:
            raise self.error(
                f"must have {len(self.columns)} cells as the header does; the file may be cut off. "
                "Use --repair to leave the row out.",
                row=self.ragged[0],
            )
        if self.unreadable:
            row, column, text = self.unreadable[0]
            raise self.error(
                f"must be a number; got {text[:40]!r}. Use --repair to interpolate.",
                column=column,
                row=row,
            )


STATE = ("t", "p", "q", "v", "w")  # fields that every log has
DERIVED = ("p", "v", "w")  # of these, those that an import derives from the others
# What a log lacks of which these were integrated.
UNLOGGED = {"p": "height", "v": "velocity", "q": "attitude", "a": "attitude"}
FORCE = ("sx", "sy", "sz")  # columns of the specific force in B, of a log without attitude [m/s²]
GRAVITY = 9.81  # [m/s²]
OPTIONAL = ("a", "al", "rotor", "throttle", "voltage", "commanded_rates")
THRUST = ("thrust",)  # of u, where torque is not logged
FIELDS = COLUMNS | {"thrust": THRUST}
# All columns, in the order of the format.
NAMES = tuple(name for group in COLUMNS.values() for name in group)


def present_fields(table: Table) -> list[str]:
    """Return the fields whose columns are present and not wholly empty.

    Raises: LogError: if there is no row, a column of the state is missing or empty, or a group is
    there in part.
    """
    if not len(table):
        raise table.error("must hold rows; it has a header and no rows. Export the flight again.")
    fields = []
    for field, names in COLUMNS.items():
        filled = [
            name
            for name in names
            if name in table.columns and not np.isnan(table.columns[name]).all()
        ]
        if len(filled) == len(names):
            fields.append(field)
        elif field == "u" and tuple(filled) == THRUST:
            fields.append("thrust")
        elif filled or field in STATE:
            name = next(name for name in names if name not in filled)
            state = "is empty" if name in table.columns else "is missing"
            raise table.error(
                (
                    f"{state}; a flight log needs {', '.join(names)}. The header has: "
                    f"{_shorten(list(table.columns))}."
                ),
                column=name,
            )
    return fields


def assemble(table: Table, fields: list[str], name: str) -> FlightLog:
    """Return the log in memory; fields that the file lacks are None, what is missing of u is
    NaN.
    """
    arrays: dict[str, np.ndarray | None] = dict.fromkeys(OPTIONAL)
    arrays |= {f: table.array(COLUMNS[f]) for f in fields if f not in ("throttles", "thrust")}
    t = table.columns["t"]
    arrays.setdefault("u", np.full((len(t), 4), np.nan))
    if "thrust" in fields:
        arrays["u"] = np.column_stack([table.columns["thrust"], np.full((len(t), 3), np.nan)])
    if "throttles" in fields:
        arrays["throttle"] = table.array(COLUMNS["throttles"])
    if arrays["voltage"] is not None:
        arrays["voltage"] = arrays["voltage"][:, 0]
    q = table.array(COLUMNS["q"])
    arrays |= {"t": t, "q": q / np.linalg.norm(q, axis=1, keepdims=True)}
    log = FlightLog(**arrays, name=name)  # type: ignore[arg-type]
    extra = [column for column in table.columns if column not in NAMES]
    if extra:
        log.notes.append(f"columns not used: {_shorten(extra)}")
    return log


def disassemble(log: FlightLog) -> dict[str, np.ndarray]:
    """Return columns (n,) in the order of the format.

    What a reader derives again is left out: a command from rotor speed or throttle, a torque that
    is not known, states that were integrated. Without attitude the specific force stands for the
    acceleration.
    """
    out = log.columns()
    left_out = {
        name for field, what in UNLOGGED.items() if what in log.lacks for name in COLUMNS[field]
    }
    if log.input in ("rotor_speed", "normalised"):
        left_out |= {*COLUMNS["u"]}
    if log.input == "thrust_only":
        left_out |= {*COLUMNS["u"]} - {*THRUST}
    kept = {name: values for name, values in out.items() if name not in left_out}
    if "attitude" in log.lacks and log.a is not None:
        force = attitude.rotate_back(log.q, log.a + [0.0, 0.0, GRAVITY])
        kept |= dict(zip(FORCE, force.T, strict=True))
    return kept


def _shorten(names: list[str]) -> str:
    return ", ".join(names[:8]) + (", …" if len(names) > 8 else "")
