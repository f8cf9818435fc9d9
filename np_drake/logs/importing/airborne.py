"""Whether a log holds a flight: plausible ranges, and the part in which the vehicle is in the
air.
"""

from collections.abc import Callable, Mapping

import numpy as np

from np_drake.logs.checks import LEAST_ROWS
from np_drake.logs.errors import LogError
from np_drake.logs.importing.convert import GRAVITY
from np_drake.logs.importing.log_map import UNITS, LogMap
from np_drake.logs.units import FASTEST_ROTOR
from np_drake.logs.windows import stretches

MOVED = 0.05  # from where it rests before and after the flight [m]; own choice
# share of the usual lift below which they carry no vehicle, even one that lost its load [1]; own
# choice
STOPPED = 0.2
STANDS = 1.0  # time at rest between two flights from which they are apart [s]; own choice
RUNNING = 0.5  # share of the usual lift below which the rotors do not carry [1]; own choice


def usual_lift(lift: np.ndarray) -> float:
    """Return the lift of the rotors in flight, in its own unit, from that of all rows (n,)."""
    return max(float(np.median(lift[lift >= RUNNING * np.percentile(lift, 95)])), 1e-12)


def standing(t: np.ndarray, p: np.ndarray, lift: np.ndarray, usual: float = 0.0) -> np.ndarray:
    """Return the rows (n,) at which the vehicle stands on the ground: before, between and after
    flights.

    For `STANDS` or longer, or at an end of the log, the rotors give less than `RUNNING` of their
    usual lift, and yet it does not fall: something else carries. The estimate of position may drift
    where they give less than `STOPPED`. Rows within `MOVED` of the ends of these are among them.

    Args:
        t: (n,) [s].
        p: (n, 3) position in W [m].
        lift: (n,) of the rotors in any unit.
        usual: lift in flight, in that unit; 0: that of these rows.
    """
    out = np.zeros(len(t), bool)
    share = lift / (usual or usual_lift(lift))
    for start, stop in stretches(share < RUNNING):
        at_end = stop - start >= LEAST_ROWS and (start == 0 or stop == len(t))
        if not (at_end or t[stop - 1] - t[start] >= STANDS) or _falls(
            t[start:stop], p[start:stop, 2]
        ):
            continue
        drifts = np.linalg.norm(p[start:stop] - p[start], axis=1).max() > MOVED
        if drifts and np.median(share[start:stop]) > STOPPED:
            continue
        before = np.flatnonzero(np.linalg.norm(p[:start] - p[start], axis=1) > MOVED)
        after = np.flatnonzero(np.linalg.norm(p[stop:] - p[stop - 1], axis=1) > MOVED)
        out[
            (before[-1] + 1 if before.size else 0) : (stop + after[0] if after.size else len(t))
        ] = True
    return out


def standing_by_force(
    t: np.ndarray, force: np.ndarray, lift: np.ndarray, usual: float = 0.0
) -> np.ndarray:
    """Return the rows (n,) at which the vehicle stands on the ground, as `standing`, of a log
    without position.

    Args:
        t: (n,) [s].
        force: (n,) size of the specific force [m/s²]: that of the ground, as long as it does not
            fall.
        lift: (n,) of the rotors in any unit.
        usual: lift in flight, in that unit; 0: that of these rows.
    """
    out = np.zeros(len(t), bool)
    for start, stop in stretches(lift / (usual or usual_lift(lift)) < RUNNING):
        at_end = stop - start >= LEAST_ROWS and (start == 0 or stop == len(t))
        carried = np.median(force[start:stop]) > RUNNING * GRAVITY
        out[start:stop] = carried and (at_end or t[stop - 1] - t[start] >= STANDS)
    return out


def _falls(t: np.ndarray, z: np.ndarray) -> bool:
    """Return whether heights z (n,) are those of a fall that nothing but the rotors, idle,
    delays.
    """
    return bool(2 * np.polyfit(t - t[0], z, 2)[0] < -(1 - RUNNING) * GRAVITY)


RANGES = {  # of nearly all values in flight
    "throttle": (-0.05, 1.5),  # [1]; own choice: trimmed and overdriven motors stay inside
    "hover_throttle": (0.02, 1.5),  # [1]; own choice
    "rotor_speed": (-np.inf, FASTEST_ROTOR),  # [rad/s]
    "voltage": (0.5, 1000.0),  # [V]; own choice: from one cell to what no vehicle has
}


def require_ranges(values: Mapping[str, np.ndarray], log_map: LogMap, path: str) -> None:
    """Check the inputs and the voltage of a log in SI units.
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
            f"{path}, {name} ({', '.join(source.columns)}): must not be {wrong} in flight; "
            f"got {shown:.4g} with "
            f"unit: {unit}. Give its unit ({', '.join(UNITS[name])}) or scale in the map."
        )


def require_a_flight(log_map: LogMap, path: str, inputs: Callable[[], str] = str) -> None:
    """Check that the map names what a flight log needs, before anything is read.

    Args:
        inputs: returns which of its columns may be an input, for the message.
    Raises: LogError: if it does not.
    """
    if not (log_map.attitude or log_map.in_body):
        raise LogError(
            f"{path}: the map must name columns of attitude, or of rates and acceleration "
            f"in body axes, as a gyro and "
            "an accelerometer read them; a flight log needs these."
        )
    if not (log_map.position or log_map.velocity or log_map.acceleration):
        raise LogError(
            f"{path}: the map must name columns of position, velocity or acceleration; got "
            f"none of them."
        )
    if not (log_map.thrust or log_map.rotor_speed or log_map.throttle):
        raise LogError(
            (
                f"{path}: the map must name columns of thrust, rotor_speed or throttle; a "
                f"flight log needs one of them."
            )
            + inputs()
        )
