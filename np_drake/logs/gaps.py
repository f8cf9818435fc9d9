"""Gaps and bad rows of a log: short gaps are bridged, long ones split it, a few bad rows are mended
if asked.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.files.number_text import percent
from np_drake.flight_log import FlightLog
from np_drake.logs.checks import GAP, LEAST_ROWS, NORM_TOLERANCE, is_figure, quaternion_norm
from np_drake.logs.columns import COLUMNS, FIELDS, Table

# gap that is bridged [s]; own choice: a flight's motion is known across it, its command is not
LONGEST = 0.1
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
    note = (
        f"{len(edges) - 2} gaps longer than {LONGEST:g} s (the longest {longest:.3g} s): "
        f"{len(kept)} parts"
    )
    if len(kept) < len(parts):
        note += f", {len(parts) - len(kept)} with fewer than {LEAST_ROWS} rows left out"
    return [table.with_columns({n: c[rows] for n, c in table.columns.items()}) for rows in kept], [
        note
    ]


def without_long_gaps(table: Table) -> Table:
    """Return the table, where no gap is longer than `LONGEST`.

    Raises: LogError: where one is.
    """
    interval = np.diff(table.columns["t"])
    if len(split_at_gaps(table)[0]) > 1:
        row = int(np.argmax(interval)) + 1
        raise table.error(
            f"must have no gap longer than {LONGEST:g} s; the one before this row lasts "
            f"{interval[row - 1]:.3g} s. "
            "Cut the log there.",
            column="t",
            row=row,
        )
    return table


def bridge_gaps(table: Table, fields: list[str]) -> tuple[Table, np.ndarray]:
    """Return the table with rows at the median interval inside every gap, and which rows (n,) these
    are.

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
    out = table.with_columns(new)
    _fill_cells(out, fields)
    return out, bridged


def _fill_cells(table: Table, fields: list[str]) -> np.ndarray:
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
    norm = np.where(touched, quaternion_norm(table), 1.0)
    for name in COLUMNS["q"]:
        table.columns[name] = table.columns[name] / norm
    return touched


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


LARGEST_SHARE = 0.02  # of the rows that may be dropped or changed
NORM_RANGE = (0.5, 2.0)  # a quaternion outside it is not normalised but interpolated [1]


def repair(table: Table, fields: list[str]) -> tuple[Table, list[str]]:
    """Drop rows out of time, interpolate bad cells and normalise quaternions.

    Every column is interpolated linearly, but a command is held.  Source: own choice.
    Returns: the repaired table (its rows are renumbered) and what was done, one line each.
    Raises:  LogError: if more than `LARGEST_SHARE` of the rows, or a run longer than `LONGEST`, is
        bad.
    """
    if len(table) < LEAST_ROWS:
        return table, []  # the check says so
    figures = {
        n: np.where(is_figure(table, n), column, np.nan) for n, column in table.columns.items()
    }
    kept, dropped = _in_time(table.with_columns(figures))
    normalised = _normalise(kept)
    for field in fields:
        for name in FIELDS[field]:
            _refuse_long_run(kept, name, np.isfinite(kept.columns[name]))
    counts = {
        "left out (time missing or not increasing)": dropped,
        "given a unit quaternion": normalised,
        "interpolated (no number in a cell)": int(_fill_cells(kept, fields).sum()),
    }
    bad = sum(counts.values())
    if bad > LARGEST_SHARE * len(table):
        raise table.error(
            f"can repair at most {LARGEST_SHARE:.0%} of the rows; {bad} of {len(table)} are bad. "
            "Record it again, or cut out a good part."
        )
    notes = [
        f"repaired: {count} of {len(table)} rows {what}" for what, count in counts.items() if count
    ]
    return kept, notes


def _in_time(table: Table) -> tuple[Table, int]:
    """Return the table of rows whose time is a number and later than every time before, and how
    many are left out.
    """
    t = np.where(np.isfinite(table.columns["t"]), table.columns["t"], -np.inf)
    before = np.concatenate([[-np.inf], np.maximum.accumulate(t)[:-1]])
    keep = t > before
    kept = table.with_columns({name: column[keep] for name, column in table.columns.items()})
    return kept, int(np.sum(~keep))


def _normalise(table: Table) -> int:
    """Divide quaternions by their norm, set those beyond repair to NaN, and return how many were
    normalised.
    """
    norm = quaternion_norm(table)
    off = np.abs(norm - 1) > NORM_TOLERANCE
    usable = (norm > NORM_RANGE[0]) & (norm < NORM_RANGE[1])
    for name in COLUMNS["q"]:
        column = table.columns[name] / np.where(off & usable, norm, 1.0)
        table.columns[name] = np.where(off & ~usable, np.nan, column)
    return int(np.sum(off & usable))


def _refuse_long_run(table: Table, name: str, good: np.ndarray) -> None:
    """Check that the column is not bad for longer than `LONGEST`; LogError if it is."""
    t = table.columns["t"]
    edge = np.flatnonzero(good)
    start = np.concatenate([[0], edge])
    stop = np.concatenate([edge, [len(t) - 1]])
    duration = np.where(stop - start > 1, t[stop] - t[start], 0.0)
    worst = int(np.argmax(duration))
    if good.any() and duration[worst] > LONGEST:
        raise table.error(
            f"can bridge at most {LONGEST} s; from here this column has no number for "
            f"{duration[worst]:.3g} s. Cut the log there.",
            column=name,
            row=int(start[worst]),
        )


def said_of_bridged(logs: Sequence[FlightLog]) -> list[str]:
    """Return one line on the rows that readers put into short gaps of flights; none where there are
    none.
    """
    counts = [int(log.bridged.sum()) for log in logs if log.bridged is not None]
    if not any(counts):
        return []
    share = sum(counts) / sum(map(len, logs))
    flights = f"{sum(map(bool, counts))} of {len(logs)} flights"
    return [
        f"{sum(counts)} rows ({percent(share)}) in gaps of up to {LONGEST:g} s of "
        f"{flights} were filled in; they do "
        "not count in the answer, and below 10 % nothing needs to be done."
    ]
