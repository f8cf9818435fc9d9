"""Time lags between signals of a log, with a standard deviation from parts of the flight."""

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.doctor.log_report import Lag
from np_drake.diagnosis.residuals import low_pass
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

LONGEST_LAG = 0.2  # lag that is looked for [s]; own choice
BAND = 10.0  # low-pass on both signals [Hz]; own choice: the same on both moves neither
PARTS = 10  # of a flight, each left out once for the deviation [1]; own choice
LEAST_PART = 0.5  # of a part [s]; own choice
# Below which no lag is told [1]; own choice: in a narrow band, other shifts fit as well.
LEAST_CORRELATION = 0.9
MOST_DEVIATION = 0.02  # above which no lag is told [s]; own choice
MOST_ROWS = 60_000  # of a flight that are used; own choice: the deviation is then far below a row


def lags(log: FlightLog, vehicle: Vehicle | None = None) -> tuple[Lag, ...]:
    """Return the lags between states, and between command and response, as far as the log tells them.

    Args:
        log: the flight log.
        vehicle: for the torque of measured rotor speed; None: that lag is left out.
    """
    log = log.rows(0, MOST_ROWS)
    dt = np.diff(log.t)[:, None]
    middle = 0.5 * (log.t[1:] + log.t[:-1])
    turn = attitude.rotation_vector(attitude.multiply(attitude.conjugate(log.q[:-1]), log.q[1:])) / dt
    pairs = []
    if "attitude" not in log.lacks:
        pairs.append(("attitude", "body rates", middle, turn, log.t, log.w))
    if not {"height", "velocity"}.intersection(log.lacks):
        pairs.append(("position", "velocity", middle, np.diff(log.p, axis=0) / dt, log.t, log.v))
    rate = np.diff(log.v, axis=0) / dt
    if log.a is not None and "velocity" not in log.lacks:
        pairs.append(("velocity", "acceleration", middle, rate, log.t, log.a))
    up = [0.0, 0.0, 9.81]
    lift = np.sum((rate + up) * attitude.body_z(_between(log.q)), axis=1)[:, None]
    held = log.t if log.input == "rotor_speed" else log.t + 0.5 * log.step  # a held command acts half a row later
    thrust = _thrust(log)
    if thrust is not None:
        pairs.append(("lift", "thrust", middle, lift, held, thrust))
    u = log.u[:, 1:]
    if np.isfinite(u).all() and (log.input != "rotor_speed" or vehicle is not None):
        pairs.append(("turning", "torque", middle, np.diff(log.w, axis=0) / dt, held, u))
    found = (_lag(*pair) for pair in pairs)
    return tuple(lag for lag in found if lag is not None)


def _between(q: np.ndarray) -> np.ndarray:
    near = q[1:] * np.sign(np.sum(q[1:] * q[:-1], axis=1, keepdims=True))
    middle = q[:-1] + near
    return middle / np.linalg.norm(middle, axis=1, keepdims=True)


def _thrust(log: FlightLog) -> np.ndarray | None:
    """Return what the thrust is in proportion to, (n, 1); None where the log has nothing of the kind."""
    if np.isfinite(log.u[:, 0]).all():
        return log.u[:, :1]
    if log.rotor is not None:
        return np.sum(log.rotor**2, axis=1, keepdims=True)
    return None if log.throttle is None else log.throttle.mean(axis=1, keepdims=True)


def _lag(late: str, early: str, t_y: np.ndarray, y: np.ndarray, t_x: np.ndarray, x: np.ndarray) -> Lag | None:
    """Return the lag of y (n, k) at t_y behind x (m, k) at t_x, axis by axis in proportion, of all axes together.

    The lag is where y is closest to gain times x plus a constant, over a grid and a parabola about its best. Its
    deviation is that of the jackknife over parts of the flight.
    """
    step = float(np.median(np.diff(t_x)))
    parts = min(PARTS, int((t_y[-1] - t_y[0] - 2 * LONGEST_LAG) / LEAST_PART))
    if parts < 3:
        return None
    t = np.arange(t_y[0] + LONGEST_LAG, t_y[-1] - LONGEST_LAG, step)
    y = low_pass(_at(t, t_y, y), step, BAND)
    fine = min(step, 0.005)
    shifts = fine * np.arange(-round(LONGEST_LAG / fine), round(LONGEST_LAG / fine) + 1)
    x = low_pass(x, step, BAND)
    sums = []  # by shift and part: moments of both
    cut = [slice(part[0], part[-1] + 1) for part in np.array_split(np.arange(len(t)), parts)]
    y = y - y.mean(axis=0)
    mean = x.mean(axis=0)
    for shift in shifts:
        moved = _at(t - shift, t_x, x) - mean
        sums.append([_moments(moved[part], y[part]) for part in cut])
    moments = np.array(sums)  # (shifts, parts, 6, k)
    best, correlation = _best(moments.sum(axis=1), shifts)
    if best is None or correlation < LEAST_CORRELATION:
        return None
    others = [_best(np.delete(moments, i, axis=1).sum(axis=1), shifts)[0] for i in range(parts)]
    if any(other is None for other in others):
        return None
    spread = np.array(others, float)
    deviation = float(np.sqrt((parts - 1) * np.mean((spread - spread.mean()) ** 2)))
    return Lag(late, early, best, deviation, correlation) if deviation < MOST_DEVIATION else None


def _at(at: np.ndarray, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(at, t, column) for column in x.T], axis=1)


def _moments(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    n = np.full(x.shape[1], float(len(x)))
    return np.stack([n, x.sum(0), y.sum(0), (x * x).sum(0), (x * y).sum(0), (y * y).sum(0)])


def _best(moments: np.ndarray, shifts: np.ndarray) -> tuple[float | None, float]:
    """Return the shift at which the loss is least, None at the ends of the grid, and the correlation there.

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
        return None, 0.0
    a, b, c = score[k - 1 : k + 2]
    bend = a - 2 * b + c
    part = 0.0 if bend >= 0 else 0.5 * (a - c) / bend
    return float(shifts[k] + part * (shifts[1] - shifts[0])), float(np.sqrt(score[k]))
