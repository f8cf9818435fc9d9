"""Alignment of signals of different rates and clocks to the rows of one flight log; what it lacks
of the motion is integrated from its gyro and accelerometer.
"""

import dataclasses as dc

import numpy as np
import scipy

from np_drake import attitude
from np_drake.finding import Finding, Kind
from np_drake.logs.columns import GAP, LOOKS, UNLOGGED
from np_drake.logs.errors import LogError
from np_drake.logs.importing.log_map import GRAVITY, LogMap, Source, convert_quantity
from np_drake.logs.importing.signals import FASTER, OPTIONAL, SLOWEST_ROTORS, STATE, Signal, Signals

FASTEST = 500.0  # rate of the rows unless another is asked for [Hz]; own choice
COMMANDS = ("thrust", "torque", "throttle")
POSE = ("position", "velocity", "attitude")  # of one instrument, as motion capture
# gap of a pose that gyro and accelerometer bridge [s]; own choice: 0.01 rad of tilt are 5 cm then
LONGEST_BRIDGE = 1.0
# window in which a position is differentiated where there is no velocity [s]; own choice
SMOOTH = 0.1
USUAL = 99.0  # percentile of the changes of slope that a line still bridges [1]; own choice

DERIVED = {  # what a log may lack, and where it comes from then
    "rates": "none in the log; differentiated from attitude",
    "velocity": f"none in the log; position differentiated over {SMOOTH} s",
}

G = np.array([0.0, 0.0, GRAVITY])


@dc.dataclass(frozen=True)
class Aligned:
    """Quantities as `convert` returns them, at common times t (n,) [s].

    filled: (n,) bool, rows that lie within a gap of a signal.
    findings: what was derived.
    torn: (n,) bool, of these, rows within a gap that no line bridges.
    """

    t: np.ndarray
    values: dict[str, np.ndarray]
    filled: np.ndarray
    findings: tuple[Finding, ...]
    torn: np.ndarray


def align(signals: Signals, log_map: LogMap, path: str = "log") -> Aligned:
    """Return the signals at common times, in SI units and our frames.

    Where all signals share their times these are kept. Elsewhere rows are evenly spaced. Attitude
    follows the body rates between its samples, velocity the accelerations, position the velocity;
    body rates and rotor speeds are averaged about a row, and rotor speed that is renewed more
    slowly than rows come is held. Commands, and the accelerations that follow them at once, are
    averaged over the interval after it: the specific force in body axes, which a command holds
    while the body turns.
    Raises: LogError: if the signals do not overlap.
    """
    t, width = _rows(signals, log_map, path)
    x = in_frames(signals, log_map)
    inertial = {"acceleration", "rates"} <= signals.keys()
    out = _state_at(t, width, x, inertial=inertial)
    out |= _accelerations_at(t, width, x, out["attitude"])
    for name in (n for n in ("rotor_speed", *OPTIONAL) if n in signals):
        out[name] = _reading_at(t, width, name, x[name])
    out |= {
        name: _command(x[name], command_meaning(signals[name], log_map), t)
        for name in COMMANDS
        if name in signals
    }
    # A position is a cubic that has its velocities: a line bridges it where it bridges these.
    x["position"] = Signal(x["position"].t, x["velocity"].linear(x["position"].t))
    filled, torn = np.zeros((2, len(t)), bool)
    for name in (n for n in (*STATE, *COMMANDS, "rotor_speed") if n in signals):
        signal = x[name]
        is_torn = _is_torn(signal)
        if inertial and name in POSE:
            is_torn &= np.diff(signal.t) > LONGEST_BRIDGE
        for k in np.flatnonzero(np.diff(signal.t) > GAP * signal.step):
            after = np.searchsorted(t, signal.t[k], side="right")
            inside = slice(after, np.searchsorted(t, signal.t[k + 1]))
            filled[inside] = True
            torn[inside] |= is_torn[k]
    findings = tuple(
        Finding(Kind.DETAIL, name, text) for name, text in DERIVED.items() if name not in signals
    )
    return Aligned(t, out, filled, findings, torn)


def _state_at(t: np.ndarray, width: float, x: Signals, *, inertial: bool) -> dict[str, np.ndarray]:
    """Return attitude, rates, velocity and position at t (n,) [s].

    Args:
        width: over which readings are averaged [s].
        x: signals in our frames.
        inertial: whether a gyro and an accelerometer bridge gaps of the position.
    """
    q = x["attitude"]
    rates = x["rates"]
    p = x["position"]
    v = x["velocity"]
    out = {"attitude": q.turned(rates, t), "rates": rates.averaged(t, width)}
    out["velocity"] = v.linear(t)
    if a := x.get("acceleration"):
        dense = v.within_wide(a, v.before(t))
        out["velocity"] = np.where(dense, v.integrated(a, t), out["velocity"])
    # Between samples a cubic that has their velocities.
    between = scipy.interpolate.CubicHermiteSpline(p.t, p.values, v.linear(p.t))
    out["position"] = p.values if np.array_equal(p.t, t) else between(np.clip(t, p.t[0], p.t[-1]))
    if inertial:
        gap = (np.diff(p.t) > GAP * p.step)[p.before(t)][:, None]
        integral = p.integrated(Signal(t, out["velocity"]), t)
        out["position"] = np.where(gap, integral, out["position"])
    return out


def _accelerations_at(
    t: np.ndarray, width: float, x: Signals, q: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the accelerations that a log has at t (n,) [s], with attitude q (n, 4)."""
    out = {}
    a = x.get("acceleration")
    if a is not None and np.array_equal(a.t, t):
        out["acceleration"] = a.values
    elif a is not None:
        turned = x["attitude"].turned(x["rates"], a.t)
        specific = Signal(a.t, attitude.rotate_back(turned, a.values + G))
        out["acceleration"] = attitude.rotate(q, _averaged_after(specific, t, width)) - G
    if "angular_acceleration" in x:
        out["angular_acceleration"] = _averaged_after(x["angular_acceleration"], t, width)
    return out


def _reading_at(t: np.ndarray, width: float, name: str, signal: Signal) -> np.ndarray:
    """Return a reading that is no state (n, k) at t (n,) [s]."""
    speed = name == "rotor_speed"
    if speed and signal.renewal * SLOWEST_ROTORS > 1:  # of which the collective alone is taken
        return signal.renewed.linear(t)
    steps = name == "commanded_rates" or (speed and signal.renewal > FASTER * width > 0)
    return signal.stepwise(t) if steps else signal.averaged(t, width)


def _is_torn(signal: Signal) -> np.ndarray:
    """Return over which intervals (n - 1,) a line may miss more than over `GAP` usual ones in
    nearly all of the flight.

    It misses an eighth of the interval times the change of slope, as of a parabola. What a line
    bridges thus follows from the rate of a signal and from the motion around the interval.
    """
    interval = np.diff(signal.t)
    slope = np.diff(signal.values, axis=0) / interval[:, None]
    bend = np.pad(np.linalg.norm(np.diff(slope, axis=0), axis=1), 1)
    missed = interval * (bend[:-1] + bend[1:])
    return missed > GAP**2 * signal.step * np.percentile(bend[1:-1], USUAL)


def in_frames(signals: Signals, log_map: LogMap) -> dict[str, Signal]:
    """Return signals in our frames at their own times; body rates and velocity also where they have
    to be derived.
    """
    q = _attitude(signals, log_map)
    x = {"attitude": q, "rates": _rates(signals, log_map, q)}
    x |= {
        name: Signal(
            signal.t, convert_quantity(name, signal.values, log_map, q.turned(x["rates"], signal.t))
        )
        for name, signal in signals.items()
        if name not in x
    }
    if "velocity" not in x and "position" in x:
        x["velocity"] = _differentiated(x["position"])
    return x


def _attitude(signals: Signals, log_map: LogMap) -> Signal:
    logged = signals["attitude"]
    q = convert_quantity("attitude", logged.values, log_map)
    return Signal(logged.t, attitude.one_hemisphere(q, q[0]))


def common_rows(signals: Signals, rate: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return evenly spaced times (n,) and the nearest sample of every signal (n, k) at each, as
    logged.

    Args:
        rate: of the rows [Hz].
    """
    start, stop = _overlap(signals)
    t = np.arange(start, stop, 1.0 / rate)
    out = {}
    for name, signal in signals.items():
        after = np.clip(np.searchsorted(signal.t, t), 1, len(signal.t) - 1)
        out[name] = signal.values[
            np.where(t - signal.t[after - 1] < signal.t[after] - t, after - 1, after)
        ]
    return t, out


def _overlap(signals: Signals) -> tuple[float, float]:
    needed = [s for name, s in signals.items() if name not in OPTIONAL]
    return max(float(s.t[0]) for s in needed), min(float(s.t[-1]) for s in needed)


def _rows(signals: Signals, log_map: LogMap, path: str) -> tuple[np.ndarray, float]:
    """Return the times of the rows, and the width over which readings are averaged (0: rows are the
    samples).
    """
    start, stop = _overlap(signals)
    if not stop > start:
        spans = ", ".join(f"{n} {s.t[0]:.4g} … {s.t[-1]:.4g} s" for n, s in signals.items())
        raise LogError(f"{path}: the signals must overlap in time; got {spans}.")
    times = signals["attitude"].t
    if log_map.rate == 0 and all(
        len(s.t) == len(times) and np.array_equal(s.t, times) for s in signals.values()
    ):
        return times, 0.0
    fast = [
        s.step
        for name, s in signals.items()
        if name in ("rates", "acceleration", "attitude", *COMMANDS)
    ]
    rate = log_map.rate or min(FASTEST, 1.0 / min(fast))
    count = int((stop - start) * rate + 1e-6)
    return start + np.arange(count + 1) / rate, 1.0 / rate


def _averaged_after(signal: Signal, at: np.ndarray, width: float) -> np.ndarray:
    """Return the mean of a signal over `width` [s] after each of `at` (m,); linear where samples
    are no denser.
    """
    return signal.averaged(at + 0.5 * width * (width >= FASTER * signal.step), width)


def _rates(signals: Signals, log_map: LogMap, q: Signal) -> Signal:
    if "rates" not in signals:
        return q.rate
    gyro = signals["rates"]
    near = attitude.normalised(q.linear(gyro.t))
    return Signal(gyro.t, convert_quantity("rates", gyro.values, log_map, near))


def _differentiated(p: Signal) -> Signal:
    """Return the velocity of a position by local parabolas, none of which reaches over a gap."""
    length = max(5, 2 * round(0.5 * SMOOTH / p.step) + 1)
    edges = np.flatnonzero(np.diff(p.t) > GAP * p.step) + 1
    times = []
    slopes = []
    for piece in np.split(p.t, edges):
        t = piece[0] + p.step * np.arange(int((piece[-1] - piece[0]) / p.step + 1e-6) + 1)
        if len(t) > length:
            # Slope of the parabola that fits the window best (Savitzky and Golay).
            slopes.append(
                scipy.signal.savgol_filter(p.linear(t), length, 2, deriv=1, delta=p.step, axis=0)
            )
            times.append(t)
    if not times:
        return Signal(p.t, np.gradient(p.values, p.t, axis=0))
    return Signal(np.concatenate(times), np.concatenate(slopes))


def command_meaning(signal: Signal, log_map: LogMap) -> str:
    """Return what the rows of a command mean: one that is logged slowly, without a word on it,
    changes in between.
    """
    slow = signal.step * SLOWEST_ROTORS > 1
    return "sampled" if slow and log_map.command == "unknown" else log_map.command


def _command(signal: Signal, timing: str, t: np.ndarray) -> np.ndarray:
    """Return the mean of a command over the interval after each row, by what its rows mean."""
    if timing == "held_before":
        signal = Signal(signal.t, np.concatenate([signal.values[1:], signal.values[-1:]]))
    if timing == "sampled":
        mean = np.diff(signal.integral(t), axis=0) / np.diff(t)[:, None]
        return np.concatenate([mean, signal.linear(t[-1:])])
    return signal.stepwise(t)


LACKS = {LOOKS[field][0]: UNLOGGED[field] for field in "pv"}  # by quantity
# Below which the mean specific force is vertical: no flight accelerates one way for ten seconds
# [Hz]; own choice.
LEVEL = 0.05
AVERAGE_STEP = 0.05  # between two values of that mean [s]
FINEST = 0.002  # between two attitudes: body rates that are denser are averaged [s]


def with_whole_motion(
    signals: Signals, log_map: LogMap
) -> tuple[dict[str, Signal], LogMap, tuple[str, ...], list[Finding]]:
    """Return signals and map with attitude and position, and what the log lacks, with a finding on
    each.

    Without attitude it is that of the body rates, from yaw zero, kept level by the accelerometer;
    position and velocity in the world then say nothing of the body and are left out. Without
    position it is the integral of the velocity, from the origin; without both, velocity is that of
    the acceleration, from rest. A velocity that a position tells is left to `align`.
    """
    complete = dict(signals)
    lacks = []
    findings = []
    if "attitude" not in complete:
        meaningless = [name for name in LACKS if complete.pop(name, None) is not None]
        complete["attitude"] = _levelled(complete, log_map)
        log_map = dc.replace(
            log_map, attitude=Source(["integral of rates"] * 4, world="enu", body="flu")
        )
        lacks.append("attitude")
        text = (
            f"none in the log; rates integrated, levelled by the accelerometer below {LEVEL:g} Hz, "
            "and what acts through attitude cannot be told"
        )
        findings.append(Finding(Kind.DERIVED, "attitude", text))
        text = "left out; without attitude it says nothing of the body"
        findings += [Finding(Kind.DERIVED, name, text) for name in meaningless]
    for name, rate in (("velocity", "acceleration"), ("position", "velocity")):
        if "position" in complete or name in complete:
            continue
        complete[name] = _integral(complete, rate, log_map)
        source = Source([f"integral of {rate}"] * 3, axes="world", world="enu")
        log_map = dc.replace(log_map, **{name: source})  # type: ignore[arg-type]
        lacks.append(LACKS[name])
        text = f"none in the log; {rate} integrated, and what acts through {name} cannot be told"
        findings.append(Finding(Kind.DERIVED, name, text))
    return complete, log_map, tuple(lacks), findings


def _levelled(signals: Signals, log_map: LogMap) -> Signal:
    """Return the attitude (n, 4) from body rates and specific force, at the times of the rates or
    every `FINEST`.

    Turned to W by the gyro alone, the mean specific force is vertical but for the gyro's drift,
    which is taken out. Nothing is said of yaw. Source: complementary filter, run in both
    directions.
    """
    gyro = signals["rates"]
    force = signals["acceleration"]
    rates = Signal(gyro.t, convert_quantity("rates", gyro.values, log_map))
    at = gyro.t if gyro.step * FASTER > FINEST else np.arange(gyro.t[0], gyro.t[-1], FINEST)
    carried = Signal(
        at, attitude.integrated(at, np.array([1.0, 0.0, 0.0, 0.0]), rates.averaged(at, FINEST))
    )
    specific = convert_quantity("acceleration", force.values, log_map) + G
    seen = Signal(force.t, attitude.rotate(carried.turned(None, force.t), specific))
    t = np.arange(gyro.t[0], gyro.t[-1] + AVERAGE_STEP, AVERAGE_STEP)
    sos = scipy.signal.butter(2, 2 * LEVEL * AVERAGE_STEP, output="sos")
    # Mirrored ends: what the vehicle does in its last instant is no mean.
    mirrored = {"padtype": "even", "padlen": min(len(t) - 1, int(1 / (LEVEL * AVERAGE_STEP)))}
    up = scipy.signal.sosfiltfilt(sos, seen.averaged(t, AVERAGE_STEP), axis=0, **mirrored)
    up = Signal(t, up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-9)).linear(at)
    across = np.cross(up, [0.0, 0.0, 1.0])
    size = np.linalg.norm(across, axis=1, keepdims=True)
    turn = across * np.arctan2(size, up[:, 2:]) / np.maximum(size, 1e-12)
    return Signal(at, attitude.multiply(attitude.from_rotation_vector(turn), carried.values))


def _integral(signals: Signals, rate: str, log_map: LogMap) -> Signal:
    """Return the integral of a vector in W at its own times, from zero."""
    signal = signals[rate]
    q = attitude.normalised(_attitude(signals, log_map).linear(signal.t))
    vector = Signal(signal.t, convert_quantity(rate, signal.values, log_map, q))
    # An acceleration that is held is constant from its row to the next, as the thrust.
    held = rate == "acceleration" and log_map.command == "held_after"
    return Signal(signal.t, vector.sum_held if held else vector.sum_linear)
