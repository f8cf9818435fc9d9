"""Clocks of a log: how late a signal is behind another, and a state moved against its commands."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.files.number_text import fixed
from np_drake.finding import Finding, Kind
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.alignment import G, in_frames
from np_drake.logs.importing.log_map import LogMap
from np_drake.logs.importing.signals import Signal, Signals


def shift_state(log: FlightLog, offset: float) -> FlightLog:
    """Return the log with its state columns of row t taken from t + offset; u and rotor stay.

    The state columns are p, q, v, w, a, al. They are linear between rows, q normalised after it
    (its chord: an error of third order in the turn of a row); accelerations that jump with a
    command are smeared over one row. Rows whose t + offset lies outside the log are dropped.
    Source: effect `clock_offset`; undo it with the opposite sign.

    Args:
        offset: by which its state is later than its commands [s].
    Raises: ValueError: if fewer than two rows are left.
    """
    wanted = log.t + offset
    kept = np.flatnonzero((wanted >= log.t[0] - 1e-9) & (wanted <= log.t[-1] + 1e-9))
    if len(kept) < 2:
        raise ValueError(
            f"shift_state: offset must be shorter than {log.name}, "
            f"{log.t[-1] - log.t[0]:.4g} s; got {offset:g} s."
        )
    out = log.rows(int(kept[0]), int(kept[-1]) + 1)
    for name in ("p", "q", "v", "w", "a", "al"):
        value = getattr(log, name)
        if value is not None:
            value = attitude.one_hemisphere(value, value[0]) if name == "q" else value
            moved = Signal(log.t, value).linear(wanted[kept])
            norm = np.linalg.norm(moved, axis=1, keepdims=True) if name == "q" else 1.0
            setattr(out, name, moved / norm)
    text = f"state columns shifted by {offset:g} s against the commands"
    out.findings.append(Finding(Kind.CLOCK, "", text))
    return out


LONGEST_LAG = 0.2  # lag that is looked for [s]; own choice
# of the mean about each row of both signals [s]; own choice: the same on both moves neither
WIDTH = 0.08
FINEST = 0.005  # between two shifts, and between two rows [s]; own choice
SHIFTS = FINEST * np.arange(-round(LONGEST_LAG / FINEST), round(LONGEST_LAG / FINEST) + 1)
PARTS = 10  # of a flight, each left out once for the deviation [1]; own choice
LEAST_PART = 0.5  # of a part [s]; own choice
# Below which no lag is told [1]; own choice: in a narrow band, other shifts fit as well.
LEAST_CORRELATION = 0.9
MOST_DEVIATION = 0.02  # above which no lag is told [s]; own choice
MOST_ROWS = 60_000  # of a flight; own choice: the deviation is then far below a row
# lag that filters of a healthy estimator have [s]; own choice: 12 ms at most in real campaigns
HEALTHY = 0.015
SURE = 8.0  # standard deviations from which a lag is no chance [1]; own choice
# factor by which signals disagree less without it [1]; own choice: 1.6 at most in these
BETTER = 2.0
STATES = (  # state, its rate of change, and the name of that
    ("attitude", "rates", "body rates"),
    ("velocity", "acceleration", "acceleration"),
    ("position", "velocity", "velocity"),
)


@dc.dataclass(frozen=True)
class Lag:
    """Time by which `late` runs behind `early` [s], and its standard deviation [s].

    mends: factor by which the two disagree less without the lag, of variances [1].
    """

    late: str
    early: str
    seconds: float
    deviation: float
    mends: float = 1.0

    @property
    def beyond_doubt(self) -> float:
        """The lag where no healthy log has it and no chance makes it, else 0 [s]."""
        clear = abs(self.seconds) > max(HEALTHY, SURE * self.deviation) and self.mends > BETTER
        return self.seconds if clear else 0.0

    def __str__(self) -> str:
        value = (
            f"{'+' if self.seconds > 0 else ''}{fixed(1e3 * self.seconds, 1)} ± "
            f"{fixed(1e3 * self.deviation, 1)} ms"
        )
        return f"{self.late} {value} after {self.early}"


def state_lags(x: Signals) -> dict[str, Lag]:
    """Return the lags of attitude, velocity and position behind their rates of change, where they
    are told.

    Args:
        x: what the log has of these, in our frames; acceleration: dv/dt in W, turned there by this
            attitude.
    """
    lags: dict[str, Lag] = {}
    for state, rate, early in STATES:
        if state not in x or rate not in x:
            continue
        other = x[rate]
        if (
            rate == "acceleration"
            and "attitude" in lags
            and (late := lags["attitude"].beyond_doubt)
        ):
            force = attitude.rotate_back(x["attitude"].turned(None, other.t), other.values + G)
            other = Signal(
                other.t, attitude.rotate(x["attitude"].turned(None, other.t + late), force) - G
            )
        if lag := lag_of(state, early, x[state].rate, other):
            lags[state] = lag
    return lags


def lag_of(late: str, early: str, y: Signal, x: Signal) -> Lag | None:
    """Return the lag of y behind x, axis by axis in proportion, of all axes together; None where it
    is not told.

    The lag is where y is closest to gain times x plus a constant, over a grid and a parabola about
    its best. Its deviation is that of the jackknife over parts of the flight.

    Args:
        y: (n, k).
        x: (m, k).
    """
    start = max(y.t[0], x.t[0]) + LONGEST_LAG
    stop = min(y.t[-1], x.t[-1]) - LONGEST_LAG
    parts = min(PARTS, int((stop - start) / LEAST_PART))
    if parts < 3:
        return None
    t = np.arange(start, stop, max(FINEST, x.step, (stop - start) / MOST_ROWS))
    around = np.arange(start - LONGEST_LAG, stop + LONGEST_LAG, t[1] - t[0])
    response = y.averaged(t, WIDTH)
    other = Signal(around, x.averaged(around, WIDTH))
    response = response - response.mean(axis=0)
    other = dc.replace(other, values=other.values - other.values.mean(axis=0))
    moved = (other.linear(t - shift) for shift in SHIFTS)
    cuts = np.linspace(0, len(t), parts, endpoint=False).astype(int)
    # Moments of both by shift, moment, part and axis.
    moments = np.array(
        [
            [
                np.add.reduceat(z, cuts)
                for z in (response**0, z, response, z * z, z * response, response * response)
            ]
            for z in moved
        ]
    )
    best, score = _best(moments.sum(axis=2))
    others = [_best(np.delete(moments, i, axis=2).sum(axis=2))[0] for i in range(parts)]
    deviation = float(np.std(others) * np.sqrt(parts - 1))
    if not (
        deviation < MOST_DEVIATION and abs(best) < SHIFTS[-2] and score.max() > LEAST_CORRELATION**2
    ):
        return None
    mends = (1 - score[len(SHIFTS) // 2]) / max(1 - score.max(), 1e-9)
    return Lag(late, early, best, deviation, float(mends))


def _best(moments: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the shift at which the loss is least, by a parabola, and the squared correlation by
    shift.

    The loss of an axis is relative to what it moves; axes count by their share of the explained
    part.
    """
    n, sx, sy, sxx, sxy, syy = np.moveaxis(moments, 1, 0)
    xx = sxx - sx**2 / n
    xy = sxy - sx * sy / n
    yy = syy - sy**2 / n
    r2 = np.maximum(xy, 0) ** 2 / (np.maximum(xx, 1e-12) * np.maximum(yy, 1e-12))
    weight = r2.max(axis=0) / np.maximum(1 - r2.max(axis=0), 1e-3)
    score = r2 @ weight / max(float(weight.sum()), 1e-12)
    k = np.clip(np.argmax(score), 1, len(SHIFTS) - 2)
    a, b, c = score[k - 1 : k + 2]
    return float(SHIFTS[k] + FINEST * 0.5 * (a - c) / min(a - 2 * b + c, -1e-15)), score


def on_one_clock(
    parts: list[Signals], longest: Signals, log_map: LogMap
) -> tuple[list[Signals], LogMap, list[Finding]]:
    """Return the parts of a log and its map without lags that are beyond doubt, and the
    finding on these.

    Velocity goes with an attitude that is late, as of one motion capture, where its own lag is not
    told or nearer to that than to none, and position with velocity. What the map says of a
    quantity's `late`, also 0, holds.
    """
    if "attitude" not in longest:
        return parts, log_map, []
    lags = state_lags(in_frames(longest, log_map))
    late = {name: lag.beyond_doubt for name, lag in lags.items()}
    turned = late.get("attitude", 0.0) * (log_map.attitude.late is None)
    moved = lags.get("velocity")
    if moved is None or abs(moved.seconds - turned) < (
        HEALTHY if late["velocity"] else abs(moved.seconds)
    ):
        late["velocity"] = turned
    late["position"] = late.get("position", 0.0) + late["velocity"]
    late = {
        n: round(by, 4)
        for n, by in late.items()
        if by and n in longest and getattr(log_map, n).late is None
    }
    if not late:
        return parts, log_map, []
    parts = [
        {n: dc.replace(signal, t=signal.t - late.get(n, 0.0)) for n, signal in signals.items()}
        for signals in parts
    ]
    log_map = dc.replace(
        log_map, **{n: dc.replace(getattr(log_map, n), late=by) for n, by in late.items()}
    )
    seen = ", ".join(str(lag) for lag in lags.values() if lag.beyond_doubt)
    stated = ", ".join(f"{name}: {{late: {by:g}}}" for name, by in late.items())
    text = f"taken out, as by {stated} in a map; late: 0 keeps it"
    return parts, log_map, [Finding(Kind.CLOCK, seen, text)]
