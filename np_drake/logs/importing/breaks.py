"""Where a log breaks: its clock is set, its recorder pauses, its position or attitude jumps, or its
format states a switch; and where its pose is frozen.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.finding import Finding, Kind, joined
from np_drake.logs.columns import GAP, LEAST_ROWS
from np_drake.logs.formats.format import Certainty, Recording, StatedBreak, Stream
from np_drake.logs.importing.alignment import LONGEST_BRIDGE, POSE, in_frames
from np_drake.logs.importing.laws import stretches
from np_drake.logs.importing.log_map import UNITS, LogMap, convert_quantity
from np_drake.logs.importing.signals import OPTIONAL, STATE, Signals

INPUTS = ("thrust", "torque", "throttle", "rotor_speed")
# gap of a signal from which a log is two [s]; own choice: below the windows of the conventions
PAUSE = 0.3
SLOW = 10.0  # intervals of a signal that are no pause [1]; own choice
LEAST = {  # jump of one interval; own choice
    "position": 0.1,  # [m]
    "velocity": 0.5,  # [m/s]
    "attitude": np.radians(10.0),  # [rad]
}
MOST = 0.02  # share of the intervals that jump from which the signal is a noisy one [1]; own choice
# jump over the largest change of the intervals around it [1]; own choice: motion has no such
ABRUPT = 8.0
FROZEN = "the pose repeats while the gyro turns"
STATED = 0.3  # share of both that is enough where the log itself states a reset [1]; own choice
AROUND = 8  # intervals before and after a jump with which it is compared [1]
MOST_NAMED = 5  # breaks that are named one by one
LASTS = 3  # samples after which a jump is still there, and no single bad sample [1]


@dc.dataclass(frozen=True)
class Break:
    """A part breaks off with the samples at `before` and another begins with those at `after`
    [s].

    pause: whether nothing but a pause of the recorder is known of it.
    """

    before: float
    after: float
    reason: str
    pause: bool = False


# turn by the gyro in which a pose that is alive does not repeat [rad]; own choice: some times what
# motion capture resolves
TURNED = 0.02
NOISY = 10.0  # the same over the usual disagreement of attitude and gyro from row to row [1]
DRIFT = 0.02  # of a gyro beside its bias [rad/s]; own choice: of a MEMS gyro that warms up


def without_frozen_poses(
    signals: Signals, log_map: LogMap
) -> tuple[Signals, list[Break], list[Finding]]:
    """Return the signals without rows that repeat a pose while the gyro turns, where they were, and
    the finding on them.

    The first pose behind them may be an old one as well, and is left out with its repeats.
    """
    frozen = _frozen_rows(signals, log_map)
    if not frozen.any():
        return signals, [], []
    out = dict(signals)
    t = signals["attitude"].t
    after = np.append(t, np.inf)
    spans = [Break(float(t[a - 1]), float(after[b]), FROZEN) for a, b in stretches(frozen).tolist()]
    for name in (n for n in POSE if n in signals):
        signal = signals[name]
        kept = np.ones(len(signal.t), bool)
        for span in spans:
            inside = (signal.t > span.before) & (signal.t < span.after)
            repeats = np.all(np.diff(signal.values[inside], axis=0) == 0, axis=1)
            kept[inside] = name != "attitude" and np.mean(repeats) <= 0.5
        out[name] = signal.at_rows(kept)
    seconds = sum(min(span.after, t[-1]) - span.before for span in spans)
    text = f"{frozen.sum()} rows, {seconds:.3g} s in {len(spans)} stretches, left out"
    return out, spans, [Finding(Kind.LEFT_OUT, FROZEN, text)]


def _frozen_rows(signals: Signals, log_map: LogMap) -> np.ndarray:
    """Return which rows (n,) of the attitude repeat while the gyro turns; none without a gyro."""
    if not {"attitude", "rates"} <= signals.keys():
        return np.zeros(0, bool)
    logged = signals["attitude"]
    x = in_frames(signals, log_map)
    t = logged.t
    turned = x["rates"].integral(t)
    interval = np.diff(t)[:, None]
    missed = np.diff(turned, axis=0) / interval - x["attitude"].rate.values
    bias = np.median(missed, axis=0)
    noise = float(np.median(np.linalg.norm((missed - bias) * interval, axis=1)))
    turned -= bias * (t - t[0])[:, None]
    new = logged.differs
    starts = np.flatnonzero(new)
    ends = np.append(starts[1:], len(t)) - 1
    lasts = t[np.minimum(ends + 1, len(t) - 1)] - t[starts]
    turns = np.maximum.reduceat(turned, starts) - np.minimum.reduceat(turned, starts)
    least = max(TURNED, NOISY * noise) + DRIFT * lasts
    frozen = (lasts > GAP * logged.step) & (np.linalg.norm(turns, axis=1) > least)
    # Where the gyro repeats as well, a whole row does.
    gyro = signals["rates"]
    moves = np.cumsum(gyro.differs)
    row = np.searchsorted(gyro.t, t, side="right") - 1
    frozen &= 2 * (moves[row[ends]] - moves[row[starts]]) > row[ends] - row[starts]
    pose = np.cumsum(new) - 1
    return (frozen[pose] & ~new) | np.append(False, frozen[:-1])[pose]


def find_breaks(
    signals: Signals,
    log_map: LogMap,
    stated: Sequence[StatedBreak],
    known: Sequence[Break] = (),
    frozen: Sequence[Break] = (),
) -> list[Break]:
    """Return where the log breaks, in time.

    Args:
        stated: breaks that the format states.
        frozen: where the pose was; no break where gyro and accelerometer bridge it.
    """
    longest = LONGEST_BRIDGE if "acceleration" in signals else 0.0
    bridged = [b for b in frozen if b.after - b.before <= longest]
    breaks = [*known, *(b for b in frozen if b not in bridged)]
    seen = list[Break]()
    place = next(
        signals[name] for name in ("position", "velocity", "acceleration") if name in signals
    )
    asked = [switch for switch in stated if switch.certainty is Certainty.IF_SHOWN]
    for t, reason, certainty in stated:
        k = int(np.searchsorted(place.t, t))
        if certainty is Certainty.ENDS:
            breaks.append(Break(t, np.inf, reason))
        elif certainty is Certainty.BREAKS and 0 < k < len(place.t):
            breaks.append(Break(float(place.t[k - 1]), float(place.t[k]), reason))
    for signal in (signals[name] for name in (*STATE, *INPUTS) if name in signals):
        for row in np.flatnonzero(np.diff(signal.t) > max(PAUSE, SLOW * signal.step)):
            before, after = signal.t[row : row + 2].tolist()
            seen.append(Break(before, after, f"a pause of {after - before:.3g} s", pause=True))
    for name in (n for n in ("position", "velocity") if n in signals):
        source = getattr(log_map, name)
        unit = UNITS[name].get(source.unit, 1.0) * abs(source.scale)
        seen += _jumps(signals[name].t, np.diff(signals[name].values, axis=0) * unit, name, asked)
    if "attitude" in signals:
        q = convert_quantity("attitude", signals["attitude"].values, log_map)
        seen += _jumps(
            signals["attitude"].t, attitude.turn_between(q[:-1], q[1:]), "attitude", asked
        )
    apart = (b for b in seen if not any(b.before < s.after > s.before < b.after for s in bridged))
    return _joined([*breaks, *apart])


def split(
    signals: Signals, breaks: Sequence[Break], origin: float = 0.0
) -> tuple[list[Signals], list[Finding]]:
    """Return the signals of every part, and the findings on breaks and on parts that are left out.

    Args:
        origin: from which times of the findings count [s].
    """
    edges = [-np.inf, *(edge for b in breaks for edge in (b.before, b.after)), np.inf]
    parts = [
        within(signals, start, stop) for start, stop in zip(edges[::2], edges[1::2], strict=True)
    ]
    kept = [not lacking for _, lacking in parts]
    findings = []
    for b, before, after in zip(breaks, kept[:-1], kept[1:], strict=True):
        side = "after" if before else "before"
        what = "split there" if before and after else f"what comes {side} it is left out"
        where = f"{b.reason} at {b.before - origin:.2f} s"
        findings.append(Finding(Kind.BREAK, where, what))
    if len(findings) > MOST_NAMED:
        last = f"the last at {breaks[-1].before - origin:.2f} s"
        text = f"{len(findings) - MOST_NAMED} more such breaks, {last}"
        findings[MOST_NAMED:] = [Finding(Kind.BREAK, "", text)]
    return [part for part, lacking in parts if not lacking], findings


def within(signals: Signals, start: float, stop: float) -> tuple[Signals, str]:
    """Return the signals between two times [s], and which of those that are needed has too few
    samples; empty: none.
    """
    part = {name: signal.between(start, stop) for name, signal in signals.items()}
    short = [
        n for n, signal in part.items() if len(signal.t) < (2 if n in OPTIONAL else LEAST_ROWS)
    ]
    lacking = next(
        (f"{name} has {len(part[name].t)}" for name in short if name not in OPTIONAL), ""
    )
    return {name: signal for name, signal in part.items() if name not in short}, lacking


def _jumps(
    t: np.ndarray, change: np.ndarray, name: str, asked: Sequence[StatedBreak]
) -> list[Break]:
    """Return where changes (n - 1, 3) between samples at t (n,) are out of all proportion to those
    around them.
    """
    size = np.linalg.norm(change, axis=1)
    count = len(change)
    if count < 4 * AROUND:
        return []
    breaks = []
    near = np.lib.stride_tricks.sliding_window_view(np.pad(size, AROUND), 2 * AROUND + 1)
    around = np.maximum(near[:, :AROUND].max(axis=1), near[:, AROUND + 1 :].max(axis=1))
    least = np.maximum(LEAST[name], ABRUPT * around)
    for k in np.flatnonzero(size > STATED * least).tolist():
        back = np.linalg.norm(change[k : k + LASTS].sum(axis=0)) < 0.5 * size[k]
        came = np.linalg.norm(change[max(k - LASTS + 1, 0) : k + 1].sum(axis=0)) < 0.5 * size[k]
        if back or came:
            continue
        near_enough = (s for s in asked if t[max(k - 1, 0)] <= s.t <= t[min(k + 2, count)])
        reason = next((switch.reason for switch in near_enough), "")
        if size[k] > (STATED if reason else 1.0) * least[k]:
            size_text = (
                f"{np.degrees(size[k]):.3g} deg"
                if name == "attitude"
                else f"{size[k]:.3g} {next(iter(UNITS[name]))}"
            )
            jump = f"the {name} jumps by {size_text}"
            what = f"{reason} ({name} by {size_text})" if reason else jump
            breaks.append(Break(float(t[k]), float(t[k + 1]), what))
    return breaks if len(breaks) < MOST * count else []


def _joined(breaks: Sequence[Break]) -> list[Break]:
    """Return the breaks in time, those that overlap as one, with the first reason that is more than
    a pause.
    """
    out: list[Break] = []
    for b in sorted(breaks, key=lambda b: b.before):
        if out and b.before < out[-1].after:
            known = b if out[-1].pause and not b.pause else out[-1]
            after = max(b.after, out[-1].after)
            out[-1] = dc.replace(known, before=out[-1].before, after=after)
        else:
            out.append(b)
    return out


LEAST_IDLE = 5  # samples of one time before a clock runs; own choice
# gap, in usual intervals, after samples of one time from which these are before the clock [1]; own
# choice
LONGER = 10.0


DENSE = 8  # intervals over which the rate of samples is compared [1]; own choice
# interval over the usual one from which samples of two times are merged [1]; half is expected
CLOSER = 0.7
# percentile of the interval that is the usual one, where others are of merged samples; own choice
SPARSE = 80.0
MOST_MERGED = 0.75  # share of a file that may be merged [1]; own choice
# Change over two samples over that over one, summed, below which samples alternate between two
# times [1]; own choice: a smooth signal has 2, white noise 1.
ALTERNATE = 0.75


def after_the_start(recording: Recording) -> tuple[Recording, list[Finding]]:
    """Return the recording without the rows that bear the first time while the clock does not run
    yet, and the findings on these.
    """
    streams = dict(recording.streams)
    findings = list[Finding]()
    for name, stream in recording.streams.items():
        distinct = np.flatnonzero(np.diff(stream.t) != 0)
        first = int(distinct[0]) + 1 if len(distinct) else 0
        if first < LEAST_IDLE or len(stream) - first < LEAST_ROWS:
            continue
        interval = np.diff(stream.t[first:])
        usual = float(np.median(interval[interval > 0])) if (interval > 0).any() else np.inf
        if stream.t[first] - stream.t[0] > LONGER * usual:
            streams[name] = _rows(stream, slice(first, None))
            text = (
                f"{first} rows at {stream.t[0]:.6g} s, before the clock runs from "
                f"{stream.t[first]:.6g} s on, left out"
            )
            findings.append(Finding(Kind.LEFT_OUT, name, text))
    return dc.replace(recording, streams=streams), joined(findings)


def without_merged_rows(recording: Recording) -> tuple[Recording, list[Break]]:
    """Return a recording without rows of two times that are merged, and where it breaks for that.

    They are where a clock is set back in a file that is sorted by time: samples are twice as dense
    as elsewhere, and alternate between two tracks.
    """
    breaks = []
    for stream in (s for s in recording.streams.values() if len(s) > 4 * DENSE and s.columns):
        t = stream.t
        interval = np.diff(t)
        mean = np.convolve(interval, np.ones(DENSE) / DENSE, mode="same")
        usual = float(np.percentile(mean, SPARSE))
        for start, stop in stretches((mean < CLOSER * usual) & np.all(interval >= 0)):
            if not DENSE <= stop - start < MOST_MERGED * len(interval):
                continue
            close = np.arange(max(start - DENSE, 0), min(stop + DENSE, len(interval)))
            close = close[interval[close] < CLOSER * usual]
            two_over_one = [
                np.abs(x[2:] - x[:-2]).sum() / np.abs(np.diff(x)).sum()
                for x in _rows(stream, slice(close[0], close[-1] + 2)).columns.values()
                if np.ptp(x) > 0
            ]
            if two_over_one and np.median(two_over_one) < ALTERNATE:
                before = max(close[0] - 1, 0)
                after = min(close[-1] + 2, len(t) - 1)
                reason = "the clock is set back, and rows of two times stand side by side"
                breaks.append(Break(float(t[before]), float(t[after]), reason))
    streams = dict(recording.streams)
    for b in breaks:
        streams = {n: _rows(s, (s.t <= b.before) | (s.t >= b.after)) for n, s in streams.items()}
    return dc.replace(recording, streams=streams), breaks


def _rows(stream: Stream, rows: slice | np.ndarray) -> Stream:
    return Stream(stream.t[rows], {name: column[rows] for name, column in stream.columns.items()})
