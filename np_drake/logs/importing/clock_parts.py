"""Parts of a recording between steps of its clock: set back, or not yet running at the start."""

import dataclasses as dc
import itertools
from collections.abc import Iterator

import numpy as np

from np_drake.logs.checks import LEAST_ROWS
from np_drake.logs.formats.format import Recording, Stream
from np_drake.logs.importing.breaks import Break
from np_drake.logs.windows import stretches

LEAST_STEP = 5  # samples by which a clock is set back; fewer are late messages; own choice
MOST_STEPS = 20  # in one recording; more are rows out of order; own choice
# share of samples earlier than the one before from which these are in no order [1]; own choice
MOST_LATE = 0.1
SET = 1e6  # gap, in usual intervals, by which a clock was set [1]: hours at 100 Hz; own choice
# gap, in usual intervals, after samples of one time from which these are before the clock [1]; own
# choice
LONGER = 10.0
AROUND = 8  # intervals over which the rate of samples is compared [1]; own choice
# interval over the usual one from which samples of two times are merged [1]; half is expected
CLOSER = 0.7
# percentile of the interval that is the usual one, where others are of merged samples; own choice
SPARSE = 80.0
LONGEST = 0.75  # share of a file that may be merged [1]; own choice
# Change over two samples over that over one, summed, below which samples alternate between two
# times [1]; own choice: a smooth signal has 2, white noise 1.
ALTERNATE = 0.75
MERGED = "the clock is set back, and rows of two times stand side by side"


def clock_parts(recording: Recording) -> tuple[list[Recording], list[str]]:
    """Return the parts between which the clock is set, in the order of the file, and one line on
    each step.

    It is set back, or forward by hours. Rows before it runs, which all bear its first time, are
    left out.
    """
    running, said = _after_the_start(recording)
    parts = []
    for piece in _parts_of_clocks(running, said):
        parts += _parts_in_order(piece, said)
    return parts, said


def set_back(t: np.ndarray) -> list[int]:
    """Return the rows at which the clock that stamps t (n,) is set back, for `LEAST_STEP` rows or
    more.
    """
    found: list[int] = []
    steps = np.flatnonzero(np.diff(t) < 0) + 1
    if len(steps) > MOST_LATE * len(t):
        return []  # rows in no order
    latest, since = np.maximum.accumulate(t), 0
    for k in steps.tolist():
        after, ahead = t[k : k + LEAST_STEP], latest[k - 1 - since]
        ordered = len(after) == LEAST_STEP and np.all(after < ahead) and np.all(np.diff(after) >= 0)
        if ordered and t[k - 1] == ahead and np.all(t[max(k - 3, 0) : k] > t[k]):
            found.append(k)
            if len(found) > MOST_STEPS:
                return []
            latest, since = np.maximum.accumulate(t[k:]), k
    return found


def overlap(before: np.ndarray, after: np.ndarray) -> bool:
    """Return whether times (n,) and (m,) run over the same stretch: a clock was set back; blocks
    out of order do not.
    """
    inside = (after > before.min()) & (after < before.max())
    return bool(inside.sum() >= LEAST_STEP)


def _after_the_start(recording: Recording) -> tuple[Recording, list[str]]:
    """Return the recording without the rows that bear the first time while the clock does not run
    yet.
    """
    streams = dict(recording.streams)
    said: dict[str, list[str]] = {}
    for name, stream in recording.streams.items():
        distinct = np.flatnonzero(np.diff(stream.t) != 0)
        first = int(distinct[0]) + 1 if len(distinct) else 0
        if first < LEAST_STEP or len(stream) - first < LEAST_ROWS:
            continue
        interval = np.diff(stream.t[first:])
        usual = float(np.median(interval[interval > 0])) if (interval > 0).any() else np.inf
        if stream.t[first] - stream.t[0] > LONGER * usual:
            streams[name] = _rows(stream, slice(first, None))
            text = (
                f"{first} rows at {stream.t[0]:.6g} s, before the clock runs from "
                f"{stream.t[first]:.6g} s on, left out"
            )
            said.setdefault(text, []).append(name)
    lines = [f"{', '.join(names)}: {text}" for text, names in said.items()]
    return dc.replace(recording, streams=streams), lines


def _parts_of_clocks(recording: Recording, said: list[str]) -> list[Recording]:
    """Return the parts on clocks that are hours apart, as those of a simulator and of the wall."""
    gaps = sorted(gap for stream in recording.streams.values() for gap in _hours(stream.t))
    if not gaps:
        return [recording]
    edges = [-np.inf, *(0.5 * (start + stop) for start, stop in gaps), np.inf]
    spans = [(a, b) for a, b in itertools.pairwise(sorted(set(edges)))]
    cut = [
        {n: _rows(s, (s.t > a) & (s.t <= b)) for n, s in recording.streams.items()}
        for a, b in spans
    ]
    # A stream of its own may be slow, as that of a battery's voltage.
    whole = [streams for streams in cut if any(len(s) >= LEAST_ROWS for s in streams.values())]
    if len(whole) > 1:
        start, stop = gaps[0]
        said.append(f"the clock is set between {start:.6g} s and {stop:.6g} s: split there")
    return [dc.replace(recording, streams=streams) for streams in whole] or [recording]


def _hours(t: np.ndarray) -> Iterator[tuple[float, float]]:
    """Yield the ends of the gaps in time, in whatever order samples come, that no recorder sits
    through.
    """
    later = np.unique(t[np.isfinite(t)])
    interval = np.diff(later)
    for k in (
        np.flatnonzero(interval > SET * np.median(interval))[:MOST_STEPS] if len(interval) else ()
    ):
        yield float(later[k]), float(later[k + 1])


def _parts_in_order(recording: Recording, said: list[str]) -> list[Recording]:
    """Return the parts of a recording whose rows are in the order in which they came."""
    steps = {name: set_back(stream.t) for name, stream in recording.streams.items() if len(stream)}
    counts = {len(found) for found in steps.values()} - {0}
    if len(counts) != 1 or max(counts) > MOST_STEPS:
        return [recording]
    (count,) = counts
    stepping = {
        name: [0, *found, len(recording.streams[name])] for name, found in steps.items() if found
    }
    name, edges = next(iter(stepping.items()))
    t = recording.streams[name].t
    for k in edges[1:-1]:
        said.append(
            f"the clock is set back by {t[k - 1] - t[k]:.3g} s at {t[k - 1]:.6g} s: split there"
        )
    parts = []
    for i in range(count + 1):
        spans = [recording.streams[n].t[e[i] : e[i + 1]] for n, e in stepping.items()]
        start, stop = min(s.min() for s in spans), max(s.max() for s in spans)
        streams = {}
        for n, stream in recording.streams.items():
            inside = (stream.t >= start) & (
                stream.t <= stop
            )  # of a stream too slow to show the step
            streams[n] = _rows(
                stream, slice(stepping[n][i], stepping[n][i + 1]) if n in stepping else inside
            )
        parts.append(dc.replace(recording, streams=streams))
    return parts


def without_merged_rows(recording: Recording) -> tuple[Recording, list[Break]]:
    """Return a recording without rows of two times that are merged, and where it breaks for that.

    They are where a clock is set back in a file that is sorted by time: samples are twice as dense
    as elsewhere, and alternate between two tracks.
    """
    found = []
    for stream in (s for s in recording.streams.values() if len(s) > 4 * AROUND and s.columns):
        t, interval = stream.t, np.diff(stream.t)
        mean = np.convolve(interval, np.ones(AROUND) / AROUND, mode="same")
        usual = float(np.percentile(mean, SPARSE))
        for start, stop in stretches(mean < CLOSER * usual) if np.all(interval >= 0) else ():
            if not AROUND <= stop - start < LONGEST * len(interval):
                continue
            close = np.arange(max(start - AROUND, 0), min(stop + AROUND, len(interval)))
            close = close[interval[close] < CLOSER * usual]
            inside = [column[close[0] : close[-1] + 2] for column in stream.columns.values()]
            two_over_one = [
                np.abs(x[2:] - x[:-2]).sum() / np.abs(np.diff(x)).sum()
                for x in inside
                if np.ptp(x) > 0
            ]
            if two_over_one and np.median(two_over_one) < ALTERNATE:
                before, after = max(close[0] - 1, 0), min(close[-1] + 2, len(t) - 1)
                found.append(Break(float(t[before]), float(t[after]), MERGED))
    streams = dict(recording.streams)
    for b in found:
        streams = {n: _rows(s, (s.t <= b.before) | (s.t >= b.after)) for n, s in streams.items()}
    return dc.replace(recording, streams=streams), found


def _rows(stream: Stream, rows: slice | np.ndarray) -> Stream:
    return Stream(stream.t[rows], {name: column[rows] for name, column in stream.columns.items()})
