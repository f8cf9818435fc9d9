"""Time lags between signals of a log, with a standard deviation from parts of the flight."""

import dataclasses as dc

import numpy as np
from scipy import signal as filters

from np_drake import attitude
from np_drake.logs.importing.convert import GRAVITY
from np_drake.logs.importing.interpolation import Signal, Signals

LONGEST_LAG = 0.2  # lag that is looked for [s]; own choice
BAND = 10.0  # low-pass on both signals [Hz]; own choice: the same on both moves neither
FINEST = 0.005  # between two shifts, and between two rows [s]; own choice: short against 1 / BAND
PARTS = 10  # of a flight, each left out once for the deviation [1]; own choice
LEAST_PART = 0.5  # of a part [s]; own choice
# Below which no lag is told [1]; own choice: in a narrow band, other shifts fit as well.
LEAST_CORRELATION = 0.9
MOST_DEVIATION = 0.02  # above which no lag is told [s]; own choice
MOST_ROWS = 60_000  # of a flight; own choice: the deviation is then far below a row
_G = np.array([0.0, 0.0, GRAVITY])
HEALTHY = (
    0.015  # lag that filters of a healthy estimator have [s]; own choice: 10 ms at most in 8 real campaigns
)
SURE = 8.0  # standard deviations from which a lag is no chance [1]; own choice
BETTER = 3.0  # factor by which signals disagree less without it [1]; as of another convention of a log


@dc.dataclass(frozen=True)
class Lag:
    """Time by which `late` runs behind `early` [s], its standard deviation, and the correlation at it [1].

    mends: factor by which the two disagree less without the lag, of variances [1].
    """

    late: str
    early: str
    seconds: float
    deviation: float
    correlation: float
    mends: float

    @property
    def stands_out(self) -> bool:
        """Whether it is none of a healthy log, beyond doubt."""
        return abs(self.seconds) > max(HEALTHY, SURE * self.deviation) and self.mends > BETTER

    def __str__(self) -> str:
        return f"{self.late} {1e3 * self.seconds:+.1f} ± {1e3 * self.deviation:.1f} ms after {self.early}"


def state_lags(x: Signals) -> list[Lag]:
    """Return how late the attitude is against the body rates, velocity against acceleration, position against velocity.

    Args:
        x: what the log has of these, in our frames; acceleration: dv/dt in W, turned there by this attitude.
    """
    found, a = [], x.get("acceleration")
    if (q := x.get("attitude")) is not None:
        turn = attitude.rotation_vector(attitude.multiply(attitude.conjugate(q.values[:-1]), q.values[1:]))
        found.append(lag("attitude", "body rates", _rate(q.t, turn), x["rates"]))
        if a is not None and (late := moved_by(found[0])):
            force = attitude.rotate_back(q.turned(None, a.t), a.values + _G)
            a = Signal(a.t, attitude.rotate(q.turned(None, a.t + late), force) - _G)
    for state, rate, own in (("velocity", "acceleration", a), ("position", "velocity", x.get("velocity"))):
        if state in x and own is not None:
            found.append(lag(state, rate, _rate(x[state].t, np.diff(x[state].values, axis=0)), own))
    return [one for one in found if one is not None]


def moved_by(found: Lag | None) -> float:
    """Return the time by which a signal is to be moved forward [s]: its lag, where that stands out."""
    return found.seconds if found is not None and found.stands_out else 0.0


def _rate(t: np.ndarray, change: np.ndarray) -> Signal:
    """Return the rate of a change (n - 1, k) over each interval, in its middle."""
    return Signal(0.5 * (t[1:] + t[:-1]), change / np.diff(t)[:, None])


def lag(late: str, early: str, y: Signal, x: Signal) -> Lag | None:
    """Return the lag of y behind x, axis by axis in proportion, of all axes together; None where it is not told.

    The lag is where y is closest to gain times x plus a constant, over a grid and a parabola about its best. Its
    deviation is that of the jackknife over parts of the flight.
    """
    start, stop = max(x.t[0], y.t[0] + LONGEST_LAG), min(x.t[-1], y.t[-1] - LONGEST_LAG)
    parts = min(PARTS, int((stop - start) / LEAST_PART))
    if parts < 3:
        return None
    step = max(x.step, FINEST, (stop - start) / MOST_ROWS)
    t = np.arange(start, stop, step)
    own = low_pass(y.linear(t), step)
    around = np.arange(start - LONGEST_LAG, stop + LONGEST_LAG, step)
    other = Signal(around, low_pass(x.averaged(around, step), step))
    cut = [slice(part[0], part[-1] + 1) for part in np.array_split(np.arange(len(t)), parts)]
    own, mean = own - own.mean(axis=0), other.values.mean(axis=0)
    shifts = FINEST * np.arange(-round(LONGEST_LAG / FINEST), round(LONGEST_LAG / FINEST) + 1)
    sums = []  # by shift and part: moments of both
    for shift in shifts:
        moved = other.linear(t - shift) - mean
        sums.append([_moments(moved[part], own[part]) for part in cut])
    moments = np.array(sums)  # (shifts, parts, 6, k)
    best, score = _best(moments.sum(axis=1), shifts)
    if best is None or score.max() < LEAST_CORRELATION**2:
        return None
    others = [_best(np.delete(moments, i, axis=1).sum(axis=1), shifts)[0] for i in range(parts)]
    if any(other is None for other in others):
        return None
    spread = np.array(others, float)
    deviation = float(np.sqrt((parts - 1) * np.mean((spread - spread.mean()) ** 2)))
    mends = float((1 - score[len(shifts) // 2]) / max(1 - score.max(), 1e-9))
    return Lag(late, early, best, deviation, score.max() ** 0.5, mends) if deviation < MOST_DEVIATION else None


def low_pass(values: np.ndarray, step: float) -> np.ndarray:
    """Apply a zero-phase second-order Butterworth low-pass at `BAND`; rows that are slower stay."""
    if step * BAND >= 0.45:
        return values
    padding = min(len(values) - 1, int(2 / (BAND * step)))
    return filters.sosfiltfilt(filters.butter(2, 2 * BAND * step, output="sos"), values, axis=0, padlen=padding)


def _moments(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    n = np.full(x.shape[1], float(len(x)))
    return np.stack([n, x.sum(0), y.sum(0), (x * x).sum(0), (x * y).sum(0), (y * y).sum(0)])


def _best(moments: np.ndarray, shifts: np.ndarray) -> tuple[float | None, np.ndarray]:
    """Return the shift at which the loss is least, None at the ends of the grid, and the squared correlations.

    The loss of an axis is relative to what it moves; axes count by their share of the explained part.
    """
    n, sx, sy, sxx, sxy, syy = np.moveaxis(moments, 1, 0)
    xx, xy, yy = sxx - sx**2 / n, sxy - sx * sy / n, syy - sy**2 / n
    good = yy > 1e-12
    share = np.where(good, np.maximum(xy, 0) ** 2 / np.maximum(xx, 1e-12), 0.0)  # explained of yy, by shift and axis
    r2 = share / np.maximum(yy, 1e-12)
    weight = r2.max(axis=0) / np.maximum(1 - r2.max(axis=0), 1e-3)
    score = r2 @ weight / max(float(weight.sum()), 1e-12)
    k = int(np.argmax(score))
    if k in (0, len(shifts) - 1) or score[k] <= 0:
        return None, score
    a, b, c = score[k - 1 : k + 2]
    bend = a - 2 * b + c
    part = 0.0 if bend >= 0 else 0.5 * (a - c) / bend
    return float(shifts[k] + part * (shifts[1] - shifts[0])), score
