"""Gaps of a log: short ones are bridged, long ones split the flight."""

import itertools

import numpy as np

from np_drake import attitude
from np_drake.logs.checks import GAP, LEAST_ROWS, quaternion_norm
from np_drake.logs.columns import COLUMNS, FIELDS, Table

LONGEST = 0.1  # gap that is bridged [s]; own choice: a flight's motion is known across it, its command is not
HELD = ("u", "throttle", "throttles", "thrust")  # fields that are held, not interpolated


def split_at_gaps(table: Table) -> tuple[list[Table], list[str]]:
    """Return the parts of a table between gaps longer than `LONGEST`, and one line that says so.

    Parts of fewer than `LEAST_ROWS` rows are left out, unless no other is there.
    """
    t = table.columns["t"]
    edges = np.concatenate([[0], np.flatnonzero(np.diff(t) > LONGEST + 1e-9) + 1, [len(t)]])
    if len(edges) == 2 or _usual(t) > LONGEST / GAP:
        return [table], []
    parts = [slice(int(i), int(j)) for i, j in itertools.pairwise(edges)]
    kept = [rows for rows in parts if rows.stop - rows.start >= LEAST_ROWS]
    if not kept:
        return [table], []
    longest = float(np.diff(t).max())
    note = f"{len(edges) - 2} gaps longer than {LONGEST:g} s (the longest {longest:.3g} s): {len(kept)} parts"
    if len(kept) < len(parts):
        note += f", {len(parts) - len(kept)} with fewer than {LEAST_ROWS} rows left out"
    return [replaced(table, {n: c[rows] for n, c in table.columns.items()}) for rows in kept], [note]


def without_long_gaps(table: Table) -> Table:
    """Return the table, where no gap is longer than `LONGEST`.

    Raises: LogError: where one is.
    """
    interval = np.diff(table.columns["t"])
    if len(split_at_gaps(table)[0]) > 1:
        row = int(np.argmax(interval)) + 1
        raise table.error(
            f"must have no gap longer than {LONGEST:g} s; the one before this row lasts {interval[row - 1]:.3g} s. "
            "Cut the log there.",
            column="t",
            row=row,
        )
    return table


def bridge_gaps(table: Table, fields: list[str]) -> tuple[Table, np.ndarray]:
    """Return the table with rows at the median interval inside every gap, and which rows (n,) these are.

    Every column is interpolated linearly, but a command is held.
    """
    t = table.columns["t"]
    interval, step = np.diff(t), _usual(t)
    gaps = np.flatnonzero(interval > GAP * step)
    if not gaps.size:
        return table, np.zeros(len(t), bool)
    fills = [np.linspace(t[k], t[k + 1], round(interval[k] / step) + 1)[1:-1] for k in gaps]
    where = np.repeat(gaps + 1, [len(fill) for fill in fills])
    new = {name: np.insert(column, where, np.nan) for name, column in table.columns.items()}
    new["t"] = np.insert(t, where, np.concatenate(fills))
    bridged = np.insert(np.zeros(len(t), bool), where, True)
    out = replaced(table, new)
    fill_cells(out, fields)
    return out, bridged


def fill_cells(table: Table, fields: list[str]) -> np.ndarray:
    """Interpolate what is not finite, in place, and return in which rows (n,)."""
    t = table.columns["t"]
    touched = np.zeros(len(t), bool)
    _one_hemisphere(table)
    for field in fields:
        for name in FIELDS[field]:
            column = table.columns[name]
            good = np.isfinite(column)
            if good.all() or not good.any():
                continue
            touched |= ~good
            if field in HELD:
                last = np.maximum.accumulate(np.where(good, np.arange(len(t)), 0))
                column = np.where(good, column, column[last])
                good = np.isfinite(column)
            table.columns[name] = np.interp(t, t[good], column[good])
    _unit_quaternions(table, touched)
    return touched


def replaced(table: Table, columns: dict[str, np.ndarray]) -> Table:
    """Return a table of the same file with other columns."""
    return Table(table.path, columns, header_lines=table.header_lines)


def _usual(t: np.ndarray) -> float:
    return float(np.median(np.diff(t))) if len(t) > 1 else 1.0


def _one_hemisphere(table: Table) -> None:
    """Flip signs of quaternions so that neighbours are near, as interpolation needs."""
    q = table.array(COLUMNS["q"])
    rows = np.flatnonzero(np.all(np.isfinite(q), axis=1))
    if len(rows) == 0:
        return
    q[rows] = attitude.one_hemisphere(q[rows], q[rows[0]])
    for name, column in zip(COLUMNS["q"], q.T, strict=True):
        table.columns[name] = column


def _unit_quaternions(table: Table, rows: np.ndarray) -> None:
    norm = np.where(rows, quaternion_norm(table), 1.0)
    for name in COLUMNS["q"]:
        table.columns[name] = table.columns[name] / norm
