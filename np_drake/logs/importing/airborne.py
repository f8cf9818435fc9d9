"""Whether a log holds a flight: plausible ranges, and the part in which the vehicle is in the air."""

from collections.abc import Mapping

import numpy as np

from np_drake.logs.checks import STEP_RANGE
from np_drake.logs.errors import LogError
from np_drake.logs.importing.convert import GRAVITY
from np_drake.logs.importing.log_map import UNITS, LogMap
from np_drake.logs.units import FASTEST_ROTOR

MOVED = 0.05  # from where it rests before and after the flight [m]; own choice
STOPPED = 0.2  # share of the usual lift below which they carry no vehicle, even one that lost its load [1]; own choice
STANDS = 1.0  # time at rest between two flights from which they are apart [s]; own choice
RUNNING = 0.5  # share of the usual lift below which the rotors do not carry [1]; own choice


def airborne(t: np.ndarray, p: np.ndarray, lift: np.ndarray | None) -> slice:
    """Return the rows between take-off and landing; all rows where the log neither begins nor ends at rest.

    At rest the position stays within `MOVED` of that at the end of the log, and the rotors give less than `RUNNING` of
    their usual lift at that end.

    Args:
        t: (n,) [s].
        p: (n, 3) position in W [m].
        lift: (n,) of the rotors in any unit, None where it is not known.
    """
    moved_first = np.linalg.norm(p - p[0], axis=1) > MOVED
    moved_last = np.linalg.norm(p - p[-1], axis=1) > MOVED
    if not (moved_first.any() and moved_last.any()):
        return slice(0, len(t))
    start, stop = int(np.argmax(moved_first)), len(t) - int(np.argmax(moved_last[::-1]))
    if start >= stop:
        return slice(0, len(t))  # it drifts about one place
    usual = None if lift is None else float(np.median(lift[start:stop]))

    def rests(end: slice) -> bool:
        return usual is None or lift is None or float(np.median(lift[end])) < RUNNING * usual

    begins_still, ends_still = rests(slice(max(start // 2, 1))), rests(slice((stop + len(t)) // 2, None))
    return slice(start if begins_still else 0, stop if ends_still else len(t))


def standing(t: np.ndarray, p: np.ndarray, lift: np.ndarray | None) -> np.ndarray:
    """Return the rows (n,) at which the vehicle stands on the ground, as between a landing and the next take-off.

    For `STANDS` or longer the rotors give less than `RUNNING` of their usual lift, and yet it does not fall: something
    else carries. The estimate of position may drift where they give less than `STOPPED`.
    Rows within `MOVED` of the ends of these are among them.

    Args:
        t: (n,) [s].
        p: (n, 3) position in W [m].
        lift: (n,) of the rotors in any unit; without it no row is known to stand.
    """
    out = np.zeros(len(t), bool)
    if lift is None:
        return out
    high = float(np.percentile(lift, 95))
    share = lift / max(float(np.median(lift[lift >= RUNNING * high])), 1e-12)
    idle = share < RUNNING
    edges = np.flatnonzero(np.diff(np.concatenate([[False], idle, [False]]).astype(int)))
    for start, stop in edges.reshape(-1, 2):
        if t[stop - 1] - t[start] < STANDS or _falls(t[start:stop], p[start:stop, 2]):
            continue
        drifts = np.linalg.norm(p[start:stop] - p[start], axis=1).max() > MOVED
        if drifts and np.median(share[start:stop]) > STOPPED:
            continue
        before = np.flatnonzero(np.linalg.norm(p[:start] - p[start], axis=1) > MOVED)
        after = np.flatnonzero(np.linalg.norm(p[stop:] - p[stop - 1], axis=1) > MOVED)
        out[(before[-1] + 1 if before.size else 0) : (stop + after[0] if after.size else len(t))] = True
    return out


def _falls(t: np.ndarray, z: np.ndarray) -> bool:
    """Return whether heights z (n,) are those of a fall that nothing but the rotors, idle, delays."""
    return bool(2 * np.polyfit(t - t[0], z, 2)[0] < -(1 - RUNNING) * GRAVITY)


RANGES = {  # of nearly all values in flight
    "throttle": (-0.05, 1.5),  # [1]; own choice: trimmed and overdriven motors stay inside
    "hover_throttle": (0.02, 1.5),  # [1]; own choice
    "rotor_speed": (-np.inf, FASTEST_ROTOR),  # [rad/s]
    "voltage": (0.5, 1000.0),  # [V]; own choice: from one cell to what no vehicle has
}


def require_ranges(values: Mapping[str, np.ndarray], log_map: LogMap, path: str) -> None:
    """Check the inputs and the voltage of a log in SI units.

    Args:
        values: in SI, by quantity.
        log_map: with the units declared.
        path: of the log.
    Raises: LogError: if its values cannot be in the unit that the map declares.
    """
    for name, (least, most) in RANGES.items():
        if name not in values:
            continue
        middle, high = np.median(values[name]), np.percentile(values[name], 99.9)
        if least <= middle and high <= most:
            continue
        source = getattr(log_map, name)
        unit = source.unit or next(iter(UNITS[name]))
        wrong = f"above {most:g}" if high > most else f"below {least:g}"
        shown = high if high > most else middle
        raise LogError(
            f"{path}, {name} ({', '.join(source.columns)}): must not be {wrong} in flight; got {shown:.4g} with "
            f"unit: {unit}. Give its unit ({', '.join(UNITS[name])}) or scale in the map."
        )


def require_a_flight(log_map: LogMap, path: str) -> None:
    """Check that the map names what a flight log needs, before anything is read.

    Args:
        log_map: of the log.
        path: of the log.
    Raises: LogError: if it does not.
    """
    if not log_map.attitude:
        raise LogError(f"{path}: the map must name columns of attitude; a flight log needs it.")
    if not (log_map.position or log_map.velocity or log_map.acceleration):
        raise LogError(f"{path}: the map must name columns of position, velocity or acceleration; got none of them.")
    if not (log_map.thrust or log_map.rotor_speed or log_map.throttle):
        raise LogError(
            f"{path}: the map must name columns of thrust, rotor_speed or throttle; a flight log needs one of them."
        )


def require_a_step(t: np.ndarray, path: str) -> None:
    """Check that rows come at a rate with which a flight log is read again.

    Args:
        t: (n,) [s].
        path: of the log.
    Raises: LogError: if they do not.
    """
    step = float(np.median(np.diff(t))) if len(t) > 1 else np.inf
    if not STEP_RANGE[0] <= step <= STEP_RANGE[1]:
        raise LogError(
            f"{path}: rows must be {STEP_RANGE[0]:g} … {STEP_RANGE[1]:g} s apart; got {step:.4g}. Log at a higher "
            "rate, or give another --rate."
        )
