"""Repair of a log with a few bad rows, with notes of what was done; more than a few are refused."""

import numpy as np

from np_drake.logs.checks import LEAST_ROWS, NORM_TOLERANCE, is_figure, quaternion_norm
from np_drake.logs.columns import COLUMNS, FIELDS, Table
from np_drake.logs.gaps import LONGEST as LONGEST_RUN
from np_drake.logs.gaps import fill_cells, replaced

LARGEST_SHARE = 0.02  # of the rows that may be dropped or changed
NORM_RANGE = (0.5, 2.0)  # a quaternion outside it is not normalised but interpolated [1]


def repair(table: Table, fields: list[str]) -> tuple[Table, list[str]]:
    """Drop rows out of time, interpolate bad cells and normalise quaternions.

    Every column is interpolated linearly, but a command is held.  Source: own choice.
    Returns: the repaired table (its rows are renumbered) and what was done, one line each.
    Raises:  LogError: if more than `LARGEST_SHARE` of the rows, or a run longer than `LONGEST_RUN`, is bad.
    """
    if len(table) < LEAST_ROWS:
        return table, []  # the check says so
    kept, dropped = _in_time(_figures(table))
    normalised = _normalise(kept)
    for field in fields:
        for name in FIELDS[field]:
            _refuse_long_run(kept, name, np.isfinite(kept.columns[name]))
    counts = {
        "left out (time missing or not increasing)": dropped,
        "given a unit quaternion": normalised,
        "interpolated (no number in a cell)": int(fill_cells(kept, fields).sum()),
    }
    bad = sum(counts.values())
    if bad > LARGEST_SHARE * len(table):
        raise table.error(
            f"can repair at most {LARGEST_SHARE:.0%} of the rows; {bad} of {len(table)} are bad. "
            "Record it again, or cut out a good part."
        )
    notes = [f"repaired: {count} of {len(table)} rows {what}" for what, count in counts.items() if count]
    return kept, notes


def _figures(table: Table) -> Table:
    """Return the table with NaN in every cell that holds no usable number."""
    columns = table.columns.items()
    return replaced(
        table, {name: np.where(is_figure(table, name), column, np.nan) for name, column in columns}
    )


def _in_time(table: Table) -> tuple[Table, int]:
    """Return the table of rows whose time is a number and later than every time before, and how many are left out."""
    t = np.where(np.isfinite(table.columns["t"]), table.columns["t"], -np.inf)
    before = np.concatenate([[-np.inf], np.maximum.accumulate(t)[:-1]])
    keep = t > before
    kept = replaced(table, {name: column[keep] for name, column in table.columns.items()})
    return kept, int(np.sum(~keep))


def _normalise(table: Table) -> int:
    """Divide quaternions by their norm, set those beyond repair to NaN, and return how many were normalised."""
    norm = quaternion_norm(table)
    off = np.abs(norm - 1) > NORM_TOLERANCE
    usable = (norm > NORM_RANGE[0]) & (norm < NORM_RANGE[1])
    for name in COLUMNS["q"]:
        column = table.columns[name] / np.where(off & usable, norm, 1.0)
        table.columns[name] = np.where(off & ~usable, np.nan, column)
    return int(np.sum(off & usable))


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
    if good.any() and duration[worst] > LONGEST_RUN:
        raise table.error(
            f"can bridge at most {LONGEST_RUN} s; from here this column has no number for "
            f"{duration[worst]:.3g} s. Cut the log there.",
            column=name,
            row=int(start[worst]),
        )
