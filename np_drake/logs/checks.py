"""Checks of a table that is to become a flight log; the first fault is raised, with its place and
its remedy.
"""

import numpy as np

from np_drake.logs.columns import COLUMNS, FIELDS, Table

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
    if len(table) < LEAST_ROWS:
        raise table.error(f"must have at least {LEAST_ROWS} rows; got {len(table)}.")
    _check_finite(table, fields)
    _check_time(table)
    off = np.flatnonzero(np.abs(quaternion_norm(table) - 1) > NORM_TOLERANCE)
    if off.size:
        norm = quaternion_norm(table)[off[0]]
        raise table.error(
            (
                f"the quaternion's norm must be 1; got {norm:.4g}{_more(off)}. Use --repair to "
                f"normalise a few rows."
            ),
            column="qw",
            row=int(off[0]),
        )


def _check_finite(table: Table, fields: list[str]) -> None:
    names = [name for field in fields for name in FIELDS[field]]
    bad = ~np.stack([is_figure(table, name) for name in names], axis=1)
    rows = np.flatnonzero(bad.any(axis=1))
    if rows.size:
        row = int(rows[0])
        name = names[int(np.flatnonzero(bad[row])[0])]
        given = table.columns[name][row]
        must = f"below {LARGEST:g} in size" if np.isfinite(given) else "finite"
        raise table.error(
            f"must be {must}; got {given}{_more(rows)}. Use --repair to interpolate a few rows.",
            column=name,
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
            "Sort the rows, or use --repair to leave a few out.",
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


def is_figure(table: Table, name: str) -> np.ndarray:
    """Return whether each cell of a column is a usable number, (n,).

    It must be finite and, but for time, small enough to be squared; time may count nanoseconds,
    which the check of time reports.
    """
    column = table.columns[name]
    return np.isfinite(column) if name == "t" else np.abs(column) <= LARGEST


def quaternion_norm(table: Table) -> np.ndarray:
    """Return the norm of q, (n,) [1]."""
    return np.linalg.norm(table.array(COLUMNS["q"]), axis=1)


def _more(rows: np.ndarray) -> str:
    return f" (and {len(rows) - 1} rows more)" if len(rows) > 1 else ""
