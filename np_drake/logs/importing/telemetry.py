"""Telemetry made plain: readings of zero, ticks of a coarse clock, and inputs that are slower than
the motion.
"""

import dataclasses as dc

import numpy as np

from np_drake.logs.gaps import LONGEST as LONGEST_GAP
from np_drake.logs.importing.interpolation import REPEATED, SLOWEST_ROTORS, Signal, Signals
from np_drake.logs.importing.log_map import LogMap
from np_drake.logs.windows import stretches

LONGEST_ZERO = (
    0.1  # time for which a rotor that turns before and after cannot have stood [s]; own choice
)
# speed over the median beyond which a reading is none: sixteen times its thrust [1]; own choice
GLITCH = 4.0
FINE = 0.75  # tick over the usual interval above which it is that interval [1]; own choice
RESOLUTION = 1e-6  # in which ticks are looked for: usual clocks count microseconds [s]
LONGEST = 1e6  # interval, beyond which the clock was set [s]
HELD = (
    "held_after",
    "held_before",
    "averaged",
)  # commands that are known between their rows, however slow
# change of a slope over the slope, from the digits of a text, in a straight line [1]; own choice
LINE = 1e-4
COARSE = 5e-4  # shorter ticks are lost in what is known of commands [s]; own choice


def without_zeros(own: Signal) -> tuple[Signal, int]:
    """Return rotor speeds without readings that no rotor has, which are interpolated, and how many
    they are.

    A rotor does not stop, or turn `GLITCH` times as fast as it usually does, and turn again within
    `LONGEST_ZERO`.
    """
    values, count = own.values.copy(), 0
    for column in values.T:
        bad = np.zeros(len(column), bool)
        usual = float(np.median(column[column > 0])) if (column > 0).any() else np.inf
        for start, stop in stretches((column == 0) | (column > GLITCH * usual)):
            inside = start > 0 and stop < len(column)
            bad[start:stop] = inside and own.t[min(stop, len(own.t) - 1)] - own.t[start - 1] <= max(
                LONGEST_ZERO, 2.5 * own.step
            )
        if bad.any():
            column[bad] = np.interp(own.t[bad], own.t[~bad], column[~bad])
            count += int(bad.sum())
    return dc.replace(own, values=values), count


def without_lines(own: Signal) -> tuple[Signal, float]:
    """Return a sensor's signal without what lies on straight lines for longer than a bridged gap,
    and its time [s].

    A sensor has noise: such rows are no readings, but drawn between or beyond them by who wrote the
    log.
    """
    change = np.diff(own.values, axis=0) / np.diff(own.t)[:, None]
    steep = np.abs(change).max(axis=1, initial=0.0)
    straight = np.all(np.abs(np.diff(change, axis=0)) <= LINE * steep[1:, None], axis=1) & (
        steep[1:] > 0
    )
    kept, drawn = np.ones(len(own.t), bool), 0.0
    for start, stop in stretches(straight):  # rows start to stop + 1 lie on a line
        if own.t[stop + 1] - own.t[start] > LONGEST_GAP:
            kept[start + 1 : stop + 1 + (stop + 2 == len(own.t))] = False
            drawn += float(own.t[stop + 1] - own.t[start])
    return (dc.replace(own, t=own.t[kept], values=own.values[kept]) if drawn else own), drawn


def spread_ticks(t: np.ndarray) -> tuple[np.ndarray, float]:
    """Return times (n,) with samples of one tick spread evenly up to the next, and the tick [s]; 0:
    no coarse clock.

    Args:
        t: (n,) not decreasing [s].
    """
    interval = np.diff(t)
    later = interval[interval > 0]
    if not len(later):
        return t, 0.0
    usual = float(np.median(later))
    tick = (
        int(np.gcd.reduce(np.round(np.minimum(later, LONGEST) / RESOLUTION).astype(np.int64)))
        * RESOLUTION
    )
    if tick < COARSE:
        return t, 0.0
    if np.mean(interval == 0) < REPEATED:
        return t, tick if tick < FINE * usual else 0.0
    first = np.concatenate([[0], np.flatnonzero(interval > 0) + 1])
    count = np.diff(np.concatenate([first, [len(t)]]))
    place = np.arange(len(t)) - np.repeat(first, count)
    return t + tick * place / np.repeat(count, count), tick


def usable_inputs(signals: Signals, log_map: LogMap) -> tuple[dict[str, Signal], list[str]]:
    """Return the signals without inputs slower than the motion that they should explain, and a line
    on each.

    Rotor speed or torque below `SLOWEST_ROTORS` is left out where something else tells thrust. A
    throttle of each motor, and rotor speed alone, become their collective.
    """
    out, said = dict(signals), []
    lifting = [name for name in ("thrust", "throttle", "rotor_speed") if name in out]
    for name in ("rotor_speed", "torque", "throttle"):
        if (
            name not in out
            or out[name].values.shape[1] == 1
            or not is_slow(name, out[name], log_map)
        ):
            continue
        slow = f"{name} at {1 / out[name].renewal:.3g} Hz is slower than what turns the vehicle"
        if name == "torque" or (name == "rotor_speed" and len(lifting) > 1):
            del out[name]
            said.append(f"{slow}; left out")
        else:
            said.append(f"{slow}: its collective thrust alone is taken, and torque is not told")
    return out, said


def is_slow(name: str, own: Signal, log_map: LogMap) -> bool:
    """Return whether an input is slower than what turns the vehicle, and not known between its
    rows.
    """
    return 1 / own.renewal < SLOWEST_ROTORS and (
        name == "rotor_speed" or log_map.command not in HELD
    )


def collective(values: np.ndarray) -> np.ndarray:
    """Return the throttle (n, 1) at which all rotors together lift as those of (n, k): thrust goes
    with its square.
    """
    return np.sqrt(np.mean(np.square(values), axis=1, keepdims=True))
