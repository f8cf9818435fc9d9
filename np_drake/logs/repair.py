"""Repair of a log with a few bad rows, with notes of what was done; more than a few are refused."""

import numpy as np

from np_drake import attitude
from np_drake.logs.checks import GAP, LEAST_ROWS, NORM_TOLERANCE, is_figure, quaternion_norm
from np_drake.logs.columns import COLUMNS
from np_drake.logs.table import Table

LARGEST_SHARE = 0.02  # of the rows that may be dropped, inserted or changed
LONGEST_RUN = 0.1  # of time that may be bridged [s]
NORM_RANGE = (0.5, 2.0)  # a quaternion outside it is not normalised but interpolated [1]


def repair(table: Table, fields: list[str]) -> tuple[Table, list[str]]:
    """Drop rows out of time, bridge short gaps, interpolate bad cells and normalise quaternions.

    Every column is interpolated linearly, but a command is held.  Source: own choice.
    Returns: the repaired table (its rows are renumbered) and what was done, one line each.
    Raises:  LogError: if more than `LARGEST_SHARE` of the rows, or a run longer than `LONGEST_RUN`, is bad.
    """
    if len(table) < LEAST_ROWS:
        return table, []  # the check says so
    kept, dropped = _in_time(_figures(table))
    bridged, inserted = _bridge_gaps(kept)
    normalised = _normalise(bridged)
    filled = _fill(bridged, fields)
    counts = {
        "left out (time missing or not increasing)": dropped,
        "inserted in gaps": inserted,
        "given a unit quaternion": normalised,
        "interpolated (no number in a cell)": filled - inserted,
    }
    bad = sum(counts.values())
    if bad > LARGEST_SHARE * len(table):
        raise table.error(
            f"can repair at most {LARGEST_SHARE:.0%} of the rows; {bad} of {len(table)} are bad. "
            "Record it again, or cut out a good part."
        )
    notes = [f"repaired: {count} of {len(table)} rows {what}" for what, count in counts.items() if count]
    return bridged, notes


def _figures(table: Table) -> Table:
    """Return the table with NaN in every cell that holds no usable number."""
    columns = table.columns.items()
    return _replaced(
        table, {name: np.where(is_figure(table, name), column, np.nan) for name, column in columns}
    )


def _in_time(table: Table) -> tuple[Table, int]:
    """Return the table of rows whose time is a number and later than every time before, and how many are left out."""
    t = np.where(np.isfinite(table.columns["t"]), table.columns["t"], -np.inf)
    before = np.concatenate([[-np.inf], np.maximum.accumulate(t)[:-1]])
    keep = t > before
    kept = _replaced(table, {name: column[keep] for name, column in table.columns.items()})
    return kept, int(np.sum(~keep))


def _bridge_gaps(table: Table) -> tuple[Table, int]:
    """Return the table with rows of NaN at the median interval inside every gap, and how many."""
    t = table.columns["t"]
    interval = np.diff(t)
    step = float(np.median(interval)) if len(t) > 1 else 1.0
    gaps = np.flatnonzero(interval > GAP * step)
    if gaps.size and interval[gaps].max() > LONGEST_RUN:
        row = int(gaps[np.argmax(interval[gaps])]) + 1
        raise table.error(
            f"can bridge at most {LONGEST_RUN} s; the gap before this row lasts {interval[row - 1]:.3g} s. "
            "Cut the log there.",
            column="t",
            row=row,
        )
    fills = [np.linspace(t[k], t[k + 1], round(interval[k] / step) + 1)[1:-1] for k in gaps]
    where = np.repeat(gaps + 1, [len(fill) for fill in fills])
    new = {name: np.insert(column, where, np.nan) for name, column in table.columns.items()}
    new["t"] = np.insert(t, where, np.concatenate([[], *fills]))
    return _replaced(table, new), len(where)


def _normalise(table: Table) -> int:
    """Divide quaternions by their norm, set those beyond repair to NaN, and return how many were normalised."""
    norm = quaternion_norm(table)
    off = np.abs(norm - 1) > NORM_TOLERANCE
    usable = (norm > NORM_RANGE[0]) & (norm < NORM_RANGE[1])
    for name in COLUMNS["q"]:
        column = table.columns[name] / np.where(off & usable, norm, 1.0)
        table.columns[name] = np.where(off & ~usable, np.nan, column)
    return int(np.sum(off & usable))


def _fill(table: Table, fields: list[str]) -> int:
    """Interpolate what is not finite, in place, and return in how many rows."""
    t = table.columns["t"]
    touched = np.zeros(len(t), bool)
    _one_hemisphere(table)
    for field in fields:
        for name in COLUMNS[field]:
            column = table.columns[name]
            good = np.isfinite(column)
            if good.all() or not good.any():
                continue
            _refuse_long_run(table, name, good)
            touched |= ~good
            if field == "u":
                last = np.maximum.accumulate(np.where(good, np.arange(len(t)), 0))
                column = np.where(good, column, column[last])
                good = np.isfinite(column)
            table.columns[name] = np.interp(t, t[good], column[good])
    _unit_quaternions(table, touched)
    return int(touched.sum())


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


def _refuse_long_run(table: Table, name: str, good: np.ndarray) -> None:
    """Check that the column is not bad for longer than `LONGEST_RUN`.

    Raises: LogError: if it is.
    """
    t = table.columns["t"]
    edge = np.flatnonzero(good)
    start = np.concatenate([[0], edge])
    stop = np.concatenate([edge, [len(t) - 1]])
    duration = np.where(stop - start > 1, t[stop] - t[start], 0.0)
    worst = int(np.argmax(duration))
    if duration[worst] > LONGEST_RUN:
        raise table.error(
            f"can bridge at most {LONGEST_RUN} s; from here this column has no number for "
            f"{duration[worst]:.3g} s. Cut the log there.",
            column=name,
            row=int(start[worst]),
        )


def _replaced(table: Table, columns: dict[str, np.ndarray]) -> Table:
    return Table(table.path, columns, header_lines=table.header_lines)
