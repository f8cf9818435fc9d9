"""Table of numbers as a file holds it: columns, checks, gaps, and the flight log of it."""

import dataclasses as dc
import itertools
import re
from collections.abc import Iterator, Sequence

import numpy as np

from np_drake import attitude
from np_drake.finding import Finding, Kind
from np_drake.flight_log import COLUMNS as COLUMNS
from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError, place

Arrays = dict[str, np.ndarray]  # columns (n,) by name


@dc.dataclass
class Table:
    """Columns (n,) by name; an empty cell is NaN.

    path: of the file, for messages.
    unreadable: (row, column, text) of cells that hold no number (their value is NaN). ragged: rows
        with a wrong number of cells (all their values are NaN). header_lines: lines before the
        first row, 0 where the file has no lines.
    """

    path: str
    columns: Arrays
    unreadable: list[tuple[int, str, str]] = dc.field(default_factory=list)
    ragged: list[int] = dc.field(default_factory=list)
    header_lines: int = 1

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def with_columns(self, columns: Arrays) -> "Table":
        """Return a table of the same file with other columns."""
        return Table(self.path, columns, header_lines=self.header_lines)

    def rows(self, rows: slice | np.ndarray) -> "Table":
        """Return a table of some rows of the same file."""
        return self.with_columns({name: column[rows] for name, column in self.columns.items()})

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
                "Leave the row out.",
                row=self.ragged[0],
            )
        if self.unreadable:
            row, column, text = self.unreadable[0]
            raise self.error(
                f"must be a number; got {text[:40]!r}. Correct it, or leave the row out.",
                column=column,
                row=row,
            )


STATE = ("t", "p", "q", "v", "w")  # fields that every log has
DERIVED = ("p", "v", "w")  # of these, those that an import derives from the others
# What a log lacks of which these were integrated.
UNLOGGED = {"p": "height", "v": "velocity", "q": "attitude", "a": "attitude"}
FORCE = ("sx", "sy", "sz")  # columns of the specific force in B, of a log without attitude [m/s²]
GRAVITY = 9.81  # [m/s²]
THRUST = ("thrust",)  # of u, where torque is not logged
# Columns of u that a reader derives from the input, or that are not known.
UNSTATED = {
    "rotor_speed": COLUMNS["u"],
    "normalised": COLUMNS["u"],
    "thrust_only": COLUMNS["u"][1:],
}
FIELDS = COLUMNS | {"thrust": THRUST}
# All columns, in the order of the format.
NAMES = tuple(name for group in COLUMNS.values() for name in group)


LOOKS = {  # what a quantity is called, by field: its name in a map, and what its columns hold
    "t": ("time", r"time|stamp|^t_?(s|ms|us|ns)?$"),
    "q": ("attitude", r"quat|^q|\Wq\W|attitude|roll|pitch|yaw|euler|orient"),
    "p": (
        "position",
        r"pos|^p_?[xyz]|^(?!.*(gyr|acc|vel|mag))(.*\W)?[xyz]$|\blat|\blon|alt|north|east",
    ),
    "v": ("velocity", r"vel|^v_?[xyz]|speed"),
    "w": ("rates", r"gyr|^w_?[xyz]|omega_?[xyz]|(body|ang).*(rate|vel)"),
    "a": ("acceleration", r"acc|^a_?[xyz]|force"),
    "u": ("rotor_speed or throttle", r"(motor|rotor|throttle|pwm|esc|rpm|omega|actuator).*\d"),
}


def looking_like(names: Sequence[str], field: str) -> list[str]:
    """Return the names, without their streams, of columns that look like those of a field."""
    pattern = LOOKS.get(field, ("", "$^"))[1]
    return [n for n in names if re.search(pattern, n.rpartition("/")[2], re.IGNORECASE)]


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
            header = list(table.columns)
            alike_first = list(dict.fromkeys([*looking_like(header, field), *header]))
            raise table.error(
                f"{state}; a flight log needs {', '.join(names)}. The header has: "
                f"{shorten(alike_first)}.",
                column=name,
            )
    return fields


def assemble(table: Table, fields: list[str], name: str) -> FlightLog:
    """Return the log in memory; fields that the file lacks are None, what is missing of u is
    NaN.
    """
    arrays = {
        f: table.array(COLUMNS[f]) for f in fields if f not in ("throttles", "thrust", "bridged")
    }
    t = table.columns["t"]
    arrays.setdefault("u", np.full((len(t), 4), np.nan))
    if "thrust" in fields:
        arrays["u"] = np.column_stack([table.columns["thrust"], np.full((len(t), 3), np.nan)])
    if "throttles" in fields:
        arrays["throttle"] = table.array(COLUMNS["throttles"])
    if "voltage" in fields:
        arrays["voltage"] = arrays["voltage"][:, 0]
    q = table.array(COLUMNS["q"])
    arrays |= {"t": t, "q": attitude.normalised(q)}
    log = FlightLog(**arrays, name=name)  # type: ignore[arg-type]
    extra = [column for column in table.columns if column not in NAMES]
    if extra:
        log.findings.append(Finding(Kind.LEFT_OUT, "columns not used", shorten(extra)))
    return log


def disassemble(log: FlightLog) -> Arrays:
    """Return columns (n,) in the order of the format.

    What a reader derives again is left out: a command from rotor speed or throttle, a torque that
    is not known, states that were integrated. Without attitude the specific force stands for the
    acceleration.
    """
    left_out = {
        name for field, what in UNLOGGED.items() if what in log.lacks for name in COLUMNS[field]
    }
    left_out |= {*UNSTATED.get(log.input, ())}
    kept = {name: values for name, values in log.columns().items() if name not in left_out}
    if "attitude" in log.lacks and log.a is not None:
        kept |= dict(
            zip(FORCE, attitude.rotate_back(log.q, log.a + [0.0, 0.0, GRAVITY]).T, strict=True)
        )
    return kept


def shorten(names: Sequence[str]) -> str:
    """Return the first eight names, as a list."""
    return ", ".join(names[:8]) + (", …" if len(names) > 8 else "")


LEAST_ROWS = 20  # own choice: below it nothing can be filtered or differentiated
GAP = 2.5  # median intervals between two rows that count as a gap
NORM_TOLERANCE = 0.01  # of a quaternion [1]; rounding to two decimals stays inside
STEP_RANGE = (5e-5, 0.25)  # plausible sampling intervals [s]
LARGEST = 1e12  # largest cell, but for time, that is plausible in any unit; own choice


def check_table(table: Table, fields: list[str]) -> None:
    """Check the columns of the fields.
    Raises: LogError: at the first fault.
    """
    table.require_cells()
    count = np.sum(~_marked(table))
    if count < LEAST_ROWS:
        raise table.error(
            f"must have at least {LEAST_ROWS} rows, `bridged` ones apart; got {count}."
        )
    _check_finite(table, fields)
    _check_time(table)
    norms = np.linalg.norm(table.array(COLUMNS["q"]), axis=1)
    off = np.flatnonzero(np.abs(norms - 1) > NORM_TOLERANCE)
    if off.size:
        raise table.error(
            f"the quaternion's norm must be 1; got {norms[off[0]]:.4g}{_more(off)}. "
            "`np-drake import` normalises it.",
            column="qw",
            row=int(off[0]),
        )


def _check_finite(table: Table, fields: list[str]) -> None:
    names = [name for field in fields for name in FIELDS[field]]
    # Time may count nanoseconds, which its own check reports.
    most = [np.finfo(float).max if name == "t" else LARGEST for name in names]
    bad = np.argwhere(~(np.abs(table.array(tuple(names))) <= most))
    if bad.size:
        row, at = bad[0].tolist()
        given = table.columns[names[at]][row]
        must = f"below {LARGEST:g} in size" if np.isfinite(given) else "finite"
        raise table.error(
            f"must be {must}; got {given}{_more(np.unique(bad[:, 0]))}. `np-drake import` leaves "
            "such rows out.",
            column=names[at],
            row=row,
        )


def _check_time(table: Table) -> None:
    """Check that time increases, at a plausible rate."""
    t = table.columns["t"]
    interval = np.diff(t)
    back = np.flatnonzero(interval <= 0)
    if back.size:
        row = int(back[0]) + 1
        raise table.error(
            f"time must increase; got {t[row]:.9g} s after {t[row - 1]:.9g} s{_more(back)}. "
            "Sort the rows; `np-drake import` leaves a few out.",
            column="t",
            row=row,
        )
    step = float(np.median(interval))
    if not STEP_RANGE[0] <= step <= STEP_RANGE[1]:
        raise table.error(
            f"rows must be {STEP_RANGE[0]:g} … {STEP_RANGE[1]:g} s apart; got {step:.4g}. "
            "Is time in seconds (not ms, µs or ns)?",
            column="t",
        )


def _more(rows: np.ndarray) -> str:
    return f" (and {len(rows) - 1} rows more)" if len(rows) > 1 else ""


# gap that is bridged [s]; own choice: a flight's motion is known across it, its command is not
LONGEST_GAP = 0.1
STEPWISE = ("u", "throttle", "throttles", "thrust")  # fields that are held, not interpolated


def split_at_gaps(table: Table) -> tuple[list[Table], list[Finding]]:
    """Return the parts of a table between long gaps, and the finding on these.

    Parts of fewer than `LEAST_ROWS` rows are left out, unless no other is there.
    """
    t = table.columns["t"]
    edges = np.concatenate([[0], np.flatnonzero(np.diff(t) > LONGEST_GAP + 1e-9) + 1, [len(t)]])
    parts = [slice(int(i), int(j)) for i, j in itertools.pairwise(edges)]
    kept = [rows for rows in parts if rows.stop - rows.start >= LEAST_ROWS]
    if len(parts) == 1 or not kept or _usual(t) > LONGEST_GAP / GAP:
        return [table], []
    short = len(parts) - len(kept)
    longest = f"{np.diff(t).max():.3g} s"
    where = f"{len(parts) - 1} gaps longer than {LONGEST_GAP:g} s (the longest {longest})"
    text = f"{len(kept)} parts"
    if short:
        text += f", {short} with fewer than {LEAST_ROWS} rows left out"
    return [table.rows(rows) for rows in kept], [Finding(Kind.BREAK, where, text)]


def flights_between_gaps(
    table: Table, fields: list[str], name: str, stated: Sequence[Finding] = ()
) -> Iterator[FlightLog]:
    """Yield the parts of a table between long gaps as flights, whose short gaps are bridged.

    Args:
        stated: findings of all parts, behind that on the gaps.
    """
    parts, split = split_at_gaps(table)
    for number, part in enumerate(parts, start=1):
        filled, bridged = bridge_gaps(part, fields)
        log = assemble(filled, fields, name if len(parts) == 1 else f"{name} part {number}")
        log.findings[:0] = [*split, *stated]
        log.bridged = bridged if bridged.any() else None
        yield log


def bridge_gaps(table: Table, fields: list[str]) -> tuple[Table, np.ndarray]:
    """Return the table with rows at the median interval inside every gap, and which rows (n,) these
    are, and those that its writer had marked.

    Every column of the fields is interpolated linearly, but a command is held.
    """
    t = table.columns["t"]
    interval = np.diff(t)
    step = _usual(t)
    gaps = np.flatnonzero(interval > GAP * step)
    if not gaps.size:
        return table, _marked(table)
    fills = [np.linspace(t[k], t[k + 1], round(interval[k] / step) + 1)[1:-1] for k in gaps]
    where = np.repeat(gaps + 1, [len(fill) for fill in fills])
    bridged = np.insert(np.zeros(len(t), bool), where, True)
    q = table.array(COLUMNS["q"])
    known = table.columns | dict(zip(COLUMNS["q"], attitude.one_hemisphere(q, q[0]).T, strict=True))
    new = {name: np.insert(column, where, np.nan) for name, column in known.items()}
    new["t"][bridged] = np.concatenate(fills)
    for field in fields:
        for name in FIELDS[field]:
            before = known[name][where - 1]
            between = np.interp(new["t"][bridged], t, known[name])
            new[name][bridged] = before if field in STEPWISE else between
    norm = np.where(bridged, np.linalg.norm([new[name] for name in COLUMNS["q"]], axis=0), 1.0)
    new |= {name: new[name] / norm for name in COLUMNS["q"]}
    return table.with_columns(new), bridged | np.insert(_marked(table), where, True)


def _marked(table: Table) -> np.ndarray:
    """Return which rows (n,) their writer had put into gaps."""
    return table.columns.get("bridged", np.zeros(len(table))) > 0


def _usual(t: np.ndarray) -> float:
    return float(np.median(np.diff(t))) if len(t) > 1 else 1.0
