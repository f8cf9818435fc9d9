"""Signals of a recording: the columns of each quantity with their times, cleaned of what is no
sample, and their values at other times.
"""

import dataclasses as dc
from collections.abc import Mapping
from functools import cached_property

import numpy as np
import scipy

from np_drake import attitude
from np_drake.checks import require
from np_drake.finding import Finding, Kind
from np_drake.logs.columns import GAP, LARGEST, LEAST_ROWS
from np_drake.logs.errors import LogError, place
from np_drake.logs.formats.format import Recording, Stream, find_column
from np_drake.logs.importing.laws import stretches
from np_drake.logs.importing.log_map import UNITS, LogMap, Source, convert_quantity

# Rate of rotor speed, of the throttle of each motor, and of torque, below which they are no input:
# what turns the vehicle is faster. Source: own choice.
SLOWEST_ROTORS = 20.0  # [Hz]
# share of rows equal to the row before, from which a signal's rate is slower [1]; own choice
REPEATED = 0.3
# ratio of sampling rates from which a rate fills in a state, or readings are averaged [1]; own
# choice
FASTER = 1.5


@dc.dataclass(frozen=True)
class Signal:
    """One quantity as logged: t (n,) [s], strictly increasing, and values (n, k) in the units of
    the file.

    tick: to which its times are rounded, where that is coarse [s].
    Its methods take times `at` (m,) [s].
    """

    t: np.ndarray
    values: np.ndarray
    tick: float = 0.0

    @property
    def step(self) -> float:
        """Median sampling interval [s]."""
        return float(np.median(np.diff(self.t)))

    @property
    def differs(self) -> np.ndarray:
        """Whether a sample differs from the one before, (n,); the first does."""
        return np.any(np.diff(self.values, axis=0, prepend=np.nan) != 0, axis=1)

    @cached_property
    def _new(self) -> np.ndarray:
        """Whether a sample differs from the one before, (n,); all, unless many repeat."""
        new = self.differs
        return (
            new if LEAST_ROWS <= new.sum() <= (1 - REPEATED) * len(new) else np.ones(len(new), bool)
        )

    @property
    def renewal(self) -> float:
        """Median interval at which the values change [s]: that of the samples, unless many
        repeat.
        """
        return float(np.median(np.diff(self.t[self._new])))

    @property
    def renewed(self) -> "Signal":
        """The samples at which the values change, where many repeat.

        A signal that rests keeps one wherever it has not changed for two usual intervals of change:
        its rest is no gap.
        """
        rows = np.arange(len(self.t))
        new = self._new
        usual = max(1, round(float(np.median(np.diff(rows[new])))))
        since = rows - np.maximum.accumulate(np.where(new, rows, 0))
        keep = new | ((since > 0) & (since % (2 * usual) == 0))
        return self if keep.all() else self.at_rows(keep)

    @property
    def rate(self) -> "Signal":
        """Mean rate of change between samples, in their middle (n - 1, 3); of an attitude its body
        rates.
        """
        x = self.values
        change = attitude.turn_between(x[:-1], x[1:]) if x.shape[1] == 4 else np.diff(x, axis=0)
        return Signal(0.5 * (self.t[1:] + self.t[:-1]), change / np.diff(self.t)[:, None])

    def between(self, start: float, stop: float) -> "Signal":
        """Return the samples from `start` to `stop` [s]."""
        return self.at_rows((self.t >= start) & (self.t <= stop))

    def at_rows(self, rows: np.ndarray) -> "Signal":
        """Return the samples at chosen rows."""
        return dc.replace(self, t=self.t[rows], values=self.values[rows])

    def linear(self, at: np.ndarray) -> np.ndarray:
        """Return the values by linear interpolation, (m, k); the ends are held."""
        return np.stack([np.interp(at, self.t, column) for column in self.values.T], axis=1)

    @cached_property
    def sum_linear(self) -> np.ndarray:
        """Integral up to each sample, (n, k), linear between samples."""
        return scipy.integrate.cumulative_trapezoid(self.values, self.t, axis=0, initial=0.0)

    @property
    def sum_held(self) -> np.ndarray:
        """Integral up to each sample, (n, k), of a signal that each sample holds until the next."""
        steps = self.values[:-1] * np.diff(self.t)[:, None]
        return np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])

    def integral(self, at: np.ndarray) -> np.ndarray:
        """Return the integral from the first sample, (m, k): linear between samples and constant
        beyond them.
        """
        t = self.t
        x = self.values
        i = self.before(at)
        inside = np.clip(at, t[0], t[-1])
        gone = (inside - t[i])[:, None]
        slope = (x[i + 1] - x[i]) / (t[i + 1] - t[i])[:, None]
        out = self.sum_linear[i] + (x[i] + 0.5 * slope * gone) * gone
        before = np.minimum(at - t[0], 0.0)
        after = np.maximum(at - t[-1], 0.0)
        return out + before[:, None] * x[0] + after[:, None] * x[-1]

    def integrated(self, rate: "Signal", at: np.ndarray) -> np.ndarray:
        """Return a state (m, k) that follows its rate between samples, and meets the next sample.

        What the integral misses of the next sample is spread evenly over the interval.

        Args:
            at: (m,) [s].
        """
        return self.linear(at) + self._bulge(rate, at)

    def turned(self, rate: "Signal | None", at: np.ndarray) -> np.ndarray:
        """Return attitudes (m, 4) that follow the body rates between samples, and meet the next
        sample.

        Without body rates that are denser, there or on the whole, they turn evenly. Turns within
        one interval of samples are taken as small: their order is neglected.

        Args:
            rate: body rates; None: not known.
            at: (m,) [s].
        """
        i = self.before(at)
        q = self.values
        step = attitude.turn_between(q[:-1], q[1:])
        turn = self._share(i, at) * step[i]
        if rate is not None:
            turn += self._bulge(rate, at) * self.within_wide(rate, i)
        out = attitude.multiply(q[i], attitude.from_rotation_vector(turn))
        return attitude.normalised(out)

    def _bulge(self, rate: "Signal", at: np.ndarray) -> np.ndarray:
        """Return what the integral of a rate adds to a line between samples, (m, k)."""
        i = self.before(at)
        total = rate.integral(self.t)
        return rate.integral(at) - (total[i] + self._share(i, at) * (total[i + 1] - total[i]))

    def within_wide(self, rate: "Signal", i: np.ndarray) -> np.ndarray:
        """Return which intervals i (m,) of samples hold several of a rate, or are gaps that do,
        (m, 1).
        """
        gap = np.diff(self.t)[i] > max(GAP * self.step, FASTER * rate.step)
        return (gap | (rate.step * FASTER < self.step))[:, None]

    def averaged(self, at: np.ndarray, width: float) -> np.ndarray:
        """Return the mean about each time, (m, k); linear where the samples are no denser.

        Args:
            at: (m,) [s].
            width: of the mean [s].
        """
        if len(self.t) < 2 or width < FASTER * self.step:
            return self.linear(at)
        return (self.integral(at + 0.5 * width) - self.integral(at - 0.5 * width)) / width

    def stepwise(self, at: np.ndarray) -> np.ndarray:
        """Return the mean of a held command over each interval between the times, (m, k).

        Each row is held from its time until the next; the first also before, the last also after.
        The last row of the result is the command held at the last time.
        """
        t = self.t
        x = self.values
        edges = np.concatenate([[0.0], np.cumsum(np.diff(t))])
        i = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 1)
        at_edge = self.sum_held[i] + x[i] * ((at - t[0]) - edges[i])[:, None]
        mean = np.diff(at_edge, axis=0) / np.diff(at)[:, None]
        exact = np.isin(at[:-1], t) & (
            np.searchsorted(t, at[1:]) - np.searchsorted(t, at[:-1]) <= 1
        )
        mean[exact] = x[i[:-1]][exact]  # no rounding where one command fills the interval
        return np.concatenate([mean, x[i[-1:]]])

    def before(self, at: np.ndarray) -> np.ndarray:
        """Return the interval of samples that holds each time, (m,)."""
        return np.clip(np.searchsorted(self.t, at, side="right") - 1, 0, len(self.t) - 2)

    def _share(self, i: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Return the share of intervals i (m,) that has passed, (m, 1) [1]."""
        return np.clip((at - self.t[i]) / (self.t[i + 1] - self.t[i]), 0.0, 1.0)[:, None]


Signals = Mapping[str, Signal]  # by quantity


def clock_of(signals: Signals) -> Signal:
    """Return the signal whose times are those of a log: its attitude, or else its body rates."""
    return signals["attitude" if "attitude" in signals else "rates"]


LEAST_NORM = 1e-3  # of a quaternion that is one, of whatever length [1]; own choice
# of which a few samples are as good as none
OPTIONAL = "voltage", "hover_throttle", "commanded_rates"
STATE = ("position", "velocity", "attitude", "rates", "acceleration", "angular_acceleration")
# Of a battery that carries a vehicle [V]; own choice: a lithium cell is empty at 2.5 V, and sags.
LEAST_VOLTAGE = 2.0
MOST_DEAD = 0.5  # share of readings below it from which none is a battery's [1]; own choice


def gather(recording: Recording, log_map: LogMap) -> tuple[Signals, list[Finding]]:
    """Return the signals of the quantities that the map names, and what was left out.
    Raises: LogError: if a column is missing, or a quantity has hardly any sample.
    """
    signals: dict[str, Signal] = {}
    findings: list[Finding] = []
    ticks: dict[float, list[str]] = {}
    for name, source in log_map.sources():
        signal = _assembled(recording, source)
        if name == "voltage":
            signal, dead = _without_dead_readings(signal, log_map)
            findings += dead
            if dead and not len(signal.t):
                continue
        signal, reasons = _cleaned(
            signal, quaternion=name == "attitude" and len(source.columns) == 4
        )
        if reasons:
            findings.append(Finding(_omission(name), name, f"rows left out: {reasons}"))
        if signal.tick:
            ticks.setdefault(signal.tick, []).append(name)
        renewed = signal.renewed if name in STATE and len(signal.t) >= LEAST_ROWS else signal
        if len(renewed.t) < len(signal.t):
            share = len(renewed.t) / len(signal.t)
            signal = renewed
            text = (
                f"rows repeat; taken as a signal of {1 / signal.step:.4g} Hz "
                f"({share:.0%} of the rows)"
            )
            findings.append(Finding(Kind.DETAIL, name, text))
        if len(signal.t) < LEAST_ROWS:
            if name in OPTIONAL or (name == "rotor_speed" and log_map.throttle):
                text = f"only {len(signal.t)} samples; left out"
                findings.append(Finding(_omission(name), name, text))
                continue
            why = f" ({reasons})" if reasons else ""
            why += "; print its times with all digits" if "time" in reasons else ""
            raise LogError(
                f"{recording.path}, {name}: must have at least {LEAST_ROWS} samples; got "
                f"{len(signal.t)} in "
                f"{', '.join(source.columns)}{why}."
            )
        signals[name] = signal
    if "rotor_speed" in signals:
        findings += _without_dropouts(signals, log_map, recording.path)
    for tick, names in ticks.items():
        coarse = tick > LONG_TICK
        head = "the clock runs in ticks of" if coarse else "times are rounded to"
        where = f"{head} {1e3 * tick:.3g} ms"
        text = f"{', '.join(names)}; taken as an uncertainty of time"
        findings.append(Finding(Kind.COARSE_CLOCK if coarse else Kind.DETAIL, where, text))
    return signals, findings


def _without_dead_readings(signal: Signal, log_map: LogMap) -> tuple[Signal, list[Finding]]:
    """Return a voltage without readings on which nothing flies, none of it where these are most,
    and the finding on them.
    """
    dead = convert_quantity("voltage", signal.values, log_map)[:, 0] < LEAST_VOLTAGE
    if not dead.any():
        return signal, []
    most = dead.sum() > MOST_DEAD * len(dead)
    text = (
        f"{dead.sum()} of {len(dead)} readings are below {LEAST_VOLTAGE:g} V, on which nothing "
        f"flies (no power module, or another unit); {'all' if most else 'these'} left out"
    )
    kept = np.zeros_like(dead) if most else ~dead
    return signal.at_rows(kept), [Finding(Kind.LOST, "voltage", text)]


def _omission(name: str) -> Kind:
    """Return the kind of a finding on readings of a quantity that are left out."""
    return Kind.LOST if name in ("voltage", "rotor_speed") else Kind.LEFT_OUT


def _assembled(recording: Recording, source: Source) -> Signal:
    """Return the columns of a source; those of other streams are interpolated at the times of the
    first.
    """
    places = [find_column(recording.contents, name, recording.path) for name in source.columns]
    t = recording.streams[places[0][0]].t
    columns = []
    for stream, column in places:
        source_stream = recording.streams[stream]
        values = np.asarray(source_stream.columns[column], float)
        if stream != places[0][0]:
            order = np.argsort(source_stream.t, kind="stable")
            values = (
                np.interp(t, source_stream.t[order], values[order])
                if len(source_stream)
                else np.full(len(t), np.nan)
            )
        columns.append(values)
    return Signal(np.asarray(t, float) - (source.late or 0.0), np.stack(columns, axis=1))


def _cleaned(signal: Signal, *, quaternion: bool) -> tuple[Signal, str]:
    """Return the samples that are numbers and later than all before, and what is left out; empty:
    nothing.

    A quaternion of zeros is none: estimators write it before they have started.
    """
    good = np.isfinite(signal.t) & np.all(np.abs(signal.values) <= LARGEST, axis=1)
    zero = good & (np.linalg.norm(np.where(good[:, None], signal.values, 0.0), axis=1) < LEAST_NORM)
    zero &= quaternion
    kept = signal.at_rows(good & ~zero)
    later = np.diff(np.maximum.accumulate(kept.t), prepend=-np.inf) > 0
    cleaned = kept.at_rows(later)
    counts = {
        "no number": np.sum(~good),
        "a quaternion of zeros": np.sum(zero),
        "time not increasing": np.sum(~later),
    }
    reasons = ", ".join(f"{count} with {reason}" for reason, count in counts.items() if count)
    tick = coarse_tick(cleaned.t, int(np.sum(~later)))
    return dc.replace(cleaned, tick=tick), reasons


def with_map_time(recording: Recording, log_map: LogMap) -> Recording:
    """Return the recording with the times of one stream from the column that the map's `time` names
    [s].

    Other streams, and all where the map names none, keep the times of their format.
    Raises: LogError: if there is no such column, or a stream with rows has no time at all.
    """
    streams = dict(recording.streams)
    if source := log_map.time:
        name, column = find_column(recording.contents, source.columns[0], recording.path)
        factor = source.scale * UNITS["time"][source.unit or "s"]
        stream = streams[name]
        streams[name] = Stream(
            np.asarray(stream.columns[column], float) * factor - (source.late or 0.0),
            stream.columns,
        )
    for name, stream in streams.items():
        require(
            not len(stream) or not np.all(np.isnan(stream.t)),
            f"{recording.path}, stream {name}: must have a time column; name it as "
            f"time in the map: "
            "time: {columns: [NAME], unit: s}.",
            LogError,
        )
    return dc.replace(recording, streams=streams)


def require_stated_units(recording: Recording, log_map: LogMap) -> None:
    """Check that the map's units are those that the file states, where it states one of that
    quantity.
    Raises: LogError: at the first column whose unit is another.
    """
    for name, source in log_map.sources():
        declared = source.unit_of(name)
        for column in source.columns:
            _, own_name = find_column(recording.contents, column, recording.path)
            stated = recording.units.get(own_name, declared)
            # A scale may be that of the unit, or a gain in the unit that the file states.
            factors = np.multiply(UNITS[name][declared], [1.0, abs(source.scale)])
            require(
                stated not in UNITS[name] or np.isclose(UNITS[name][stated], factors).any(),
                f"{place(recording.path, column=own_name)}: is in {stated} by the file, in "
                f"{declared} by the map; "
                f"write {name}: {{unit: {stated}}}, without a scale, in the map.",
                LogError,
            )


DROPOUTS = "readings of no rotor in flight (0, where an ESC drops out)"
MOST_MISSING = 0.1  # share of rows from which rotor speed is no input [1]; own choice
LONGEST_ZERO = 0.1  # in which no rotor stops and turns again [s]; own choice
# speed over the median beyond which a reading is none: sixteen times its thrust [1]; own choice
GLITCH = 4.0
CARRIES = 0.7  # speed over the usual from which a rotor carries: half of its thrust [1]; own choice
# speed over the usual below which it stands: a sixteenth of its thrust [1]; own choice
STOPS = 0.25
FINE = 0.75  # tick over the usual interval above which it is that interval [1]; own choice
RESOLUTION = 1e-6  # in which ticks are looked for: usual clocks count microseconds [s]
CLOCK_SET = 1e6  # interval, beyond which the clock was set [s]
FEWEST = 0.2  # share of samples of one time from which it is the clock's tick [1]; own choice
LONG_TICK = 5e-3  # beyond which a tick stands against an answer [s]; own choice: of a motor's lag
# commands that are known between their rows, however slow
STATED_TIMINGS = "held_after", "held_before", "averaged"
COARSE = 5e-4  # shorter ticks are lost in what is known of commands [s]; own choice


def _without_dropouts(signals: dict[str, Signal], log_map: LogMap, path: str) -> list[Finding]:
    """Take readings that no rotor has out of the rotor speeds, or these where much is missing and
    throttle or thrust takes their place. Return the finding on it, or none.
    Raises: LogError: if too few are left, and nothing takes their place.
    """
    speeds = signals["rotor_speed"]
    level = None
    name = next((name for name in ("thrust", "throttle") if name in signals), "")
    if name:
        level = np.interp(
            speeds.t,
            signals[name].t,
            np.abs(convert_quantity(name, signals[name].values, log_map).mean(axis=1)),
        )
    mended, bridged, lost = without_zeros(speeds, level)
    rows = lost.any(axis=1)
    if name and rows.mean() > MOST_MISSING:
        del signals["rotor_speed"]
        text = f"{DROPOUTS} in {rows.mean():.0%} of the rows; left out"
        return [Finding(Kind.LOST, "rotor_speed", text)]
    require(
        np.sum(~rows) >= LEAST_ROWS,
        f"{path}, rotor_speed: must be that of turning rotors; {DROPOUTS} in {rows.mean():.0%} of "
        "the rows. Log throttle as well.",
        LogError,
    )
    signals["rotor_speed"] = dc.replace(speeds, values=mended).at_rows(np.flatnonzero(~rows))
    counts = ", ".join(
        f"{count} {what}"
        for what, count in {"readings bridged": bridged.sum(), "rows left out": rows.sum()}.items()
        if count
    )
    kind = Kind.LOST if rows.any() else Kind.BRIDGED
    return [Finding(kind, "rotor_speed", f"{DROPOUTS}: {counts}")] if counts else []


def without_zeros(
    speeds: Signal, level: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rotor speeds (n, k) with those interpolated that no rotor has, and which (n, k) were
    missing shortly, and which for long.

    A rotor does not stop, or turn `GLITCH` times as fast as it usually does, and turn again within
    `LONGEST_ZERO`; for longer not where the vehicle flies: another rotor or the command carries. It
    slows down before it stops, and may have stopped where it stands to the end (`stopped_rotor`).

    Args:
        level: (n,) throttle or thrust, in any unit.
    """
    values = speeds.values.copy()
    bridged, lost = np.zeros((2, *values.shape), bool)
    share, carried = _shares(values)
    flies = np.max(share, axis=1) > CARRIES
    if level is not None:
        flies |= level > 0.5 * np.median(level[level >= 0.5 * np.percentile(level, 95)])
    for column, short, long in zip(values.T, bridged.T, lost.T, strict=True):
        usual = float(np.median(column[column > 0])) if (column > 0).any() else np.inf
        for start, stop in stretches((column == 0) | (column > GLITCH * usual)):
            around = [column[k] for k in (start - 1, stop) if 0 <= k < len(column)]
            if min(around, default=np.inf) < STOPS * usual:  # it slows down
                continue
            inside = len(around) == 2
            before = speeds.t[max(start - 1, 0)]
            after = speeds.t[min(stop, len(column) - 1)]
            brief = after - before <= max(LONGEST_ZERO, 2.5 * speeds.step)
            may_stop = stop == len(column) and start > 0 and carried[start:].any()
            short[start:stop] = brief and inside
            long[start:stop] = (
                not (brief and inside)
                and (brief or not may_stop)
                and np.mean(flies[start:stop]) > 0.5
            )
        good = ~(short | long)
        if good.any():
            column[~good] = np.interp(speeds.t[~good], speeds.t[good], column[good])
    return values, bridged, lost


def stopped_rotor(speeds: Signal) -> tuple[float, int] | None:
    """Return since when [s] which rotor, from 1, stands to the end while the others carry; None:
    none does.

    Args:
        own: rotor speeds, in any unit.
    """
    share, carried = _shares(speeds.values)
    if not carried.any():
        return None
    stop = int(np.flatnonzero(carried)[-1]) + 1
    stops = []
    for number, column in enumerate(share[:stop].T, start=1):
        first = int(np.max(np.flatnonzero(column > STOPS), initial=-1)) + 1
        turning = np.flatnonzero(column[:first] > CARRIES)
        if len(turning) and speeds.t[stop - 1] - speeds.t[min(first, stop - 1)] > LONGEST_ZERO:
            stops.append((float(speeds.t[turning[-1]]), number))
    return min(stops, default=None)


def _shares(speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rotor speeds over the usual of each (n, k), and the rows (n,) at which most carry."""
    fast = CARRIES * np.percentile(speeds, 95, axis=0)
    usual = np.nanmedian(np.where(speeds >= fast, speeds, np.nan), axis=0)
    share = speeds / np.where(usual > 0, usual, np.inf)
    return share, np.median(share, axis=1) > CARRIES


def coarse_tick(t: np.ndarray, repeats: int = 0) -> float:
    """Return the tick to which times (n,) are rounded, where it is coarse [s]; 0: it is not.

    Args:
        repeats: samples left out as they bear the time of another; of many the tick is longer than
            the interval of the samples.
    """
    interval = np.diff(t)
    counts = np.round(np.minimum(interval, CLOCK_SET) / RESOLUTION).astype(np.int64)
    tick = int(np.gcd.reduce(counts)) * RESOLUTION
    if tick < COARSE:
        return 0.0
    return tick if repeats > FEWEST * len(t) or tick < FINE * float(np.median(interval)) else 0.0


def usable_inputs(signals: Signals, log_map: LogMap) -> tuple[dict[str, Signal], list[Finding]]:
    """Return the signals without inputs slower than the motion that they should explain, and the
    findings on these.

    Rotor speed or torque below `SLOWEST_ROTORS` is left out where something else tells thrust, and
    an acceleration, in which vibrations alias, where velocity tells it. A throttle of each motor,
    and rotor speed alone, become their collective.
    """
    out = dict(signals)
    findings = []
    lifting = [name for name in ("thrust", "throttle", "rotor_speed") if name in out]
    replaced = {
        "acceleration": {"attitude", "velocity"} <= out.keys(),
        "rotor_speed": len(lifting) > 1,
        "torque": True,
        "throttle": False,
    }
    for name in (n for n in replaced if n in out and is_slow(n, out[n], log_map)):
        slow = f"{name} at {1 / out[name].renewal:.3g} Hz is slower than what turns the vehicle"
        if replaced[name]:
            del out[name]
            findings.append(Finding(Kind.LEFT_OUT, "", f"{slow}; left out"))
        elif name in lifting:
            text = "its collective thrust alone is taken, and torque is not told"
            findings.append(Finding(Kind.INPUT, slow, text))
    return out, findings


def is_slow(name: str, signal: Signal, log_map: LogMap) -> bool:
    """Return whether an input of several columns is slower than what turns the vehicle, and not
    known between its rows.
    """
    return (
        signal.values.shape[1] > 1
        and 1 / signal.renewal < SLOWEST_ROTORS
        and (name == "rotor_speed" or log_map.command not in STATED_TIMINGS)
    )
