"""One part of a log, between its breaks: conventions, the stretch that fits them, rows, and the
flights in it.
"""

import dataclasses as dc
from collections.abc import Mapping

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.logs.checks import LEAST_ROWS
from np_drake.logs.errors import LogError
from np_drake.logs.gaps import LONGEST as LONGEST_GAP
from np_drake.logs.importing.airborne import require_ranges, standing, standing_by_force
from np_drake.logs.importing.alignment import COMMANDS, Aligned, align, command_meaning
from np_drake.logs.importing.conventions import Verdict
from np_drake.logs.importing.convert import GRAVITY, convert_quantity
from np_drake.logs.importing.crash import WRECK, end_of_flight, fits_until
from np_drake.logs.importing.dead_reckoning import with_whole_motion
from np_drake.logs.importing.interpolation import FASTER, Signals
from np_drake.logs.importing.log_map import LogMap
from np_drake.logs.importing.telemetry import collective, is_slow

# Below which rotors stand [rad/s, N, 1]; own choice.
IDLE = {"rotor_speed": 10.0, "thrust": 0.0, "throttle": 0.05}
# deviation of the time at which a row's command acts, over the interval of the command [1]
UNCERTAIN = {
    "held_after": 0.0,
    "held_before": 0.0,
    "averaged": 0.5,  # its middle; 0 where accelerations are averaged over it as well
    "sampled": 12**-0.5,  # somewhere in the interval
    "unknown": 0.5,  # an interval early or late
}
TICK = 12**-0.5  # deviation of a time that is rounded, over the tick [1]


@dc.dataclass(frozen=True)
class Part:
    """What was made of one part.

    carried: whether the vehicle flies at all.   ground: (n,) bool, on the ground.
    timing: deviation of the time at which a row's command acts [s].   said: one line each.
    """

    signals: Signals
    verdict: Verdict
    aligned: Aligned
    carried: bool
    ground: np.ndarray
    flights: tuple[FlightLog, ...]
    timing: float
    said: tuple[str, ...]


def import_part(
    signals: Signals,
    log_map: LogMap,
    verdict: Verdict,
    path: str,
    *,
    origin: float,
    usual: float = 0.0,
) -> Part:
    """Return the flights of one part, in SI units and our frames.

    Args:
        origin: first time of the log [s].
        usual: lift in the flights of the longest part, as of `lift_of`; 0: not known.
    Raises: LogError: if its signals do not overlap, are in another unit, or are those of a wreck.
    """
    carried = flies(signals, log_map)
    signals, log_map, lacks, derived = with_whole_motion(signals, log_map)
    aligned = align(signals, log_map, path)
    aligned = dc.replace(aligned, notes=(*derived, *aligned.notes))
    ground = np.zeros(len(aligned.t), bool)
    said: list[str] = []
    if carried:
        require_ranges(aligned.values, log_map, path)
        x, lift = aligned.values, lift_of(aligned.values)
        motion = (x["position"], x["velocity"], x["attitude"])
        end, why = end_of_flight(aligned.t, *motion, lift, moves="velocity" not in lacks)
        if end < LEAST_ROWS:
            raise LogError(f"{path}: {WRECK}")
        if why:
            said.append(fits_until(aligned.t[end - 1] - origin, why))
        aligned = aligned.until(end)
        if "height" in lacks and "acceleration" in x:
            force = np.linalg.norm(x["acceleration"][:end] + [0.0, 0.0, GRAVITY], axis=1)
            ground = standing_by_force(aligned.t, force, lift[:end], usual)
        else:
            ground = standing(aligned.t, aligned.values["position"], lift[:end], usual)
    flights = _flights(_with_collective(aligned, signals, log_map), ground, log_map)
    flights = [
        dc.replace(flight, lacks=lacks, notes=[*flight.notes, *derived]) for flight in flights
    ]
    timing = _timing(signals, log_map)
    return Part(signals, verdict, aligned, carried, ground, tuple(flights), timing, tuple(said))


def flies(signals: Signals, log_map: LogMap) -> bool:
    """Return whether the vehicle moves sideways at all and the rotors ever turn; True where the log
    does not tell.
    """
    told = next(name for name in ("position", "velocity", "acceleration") if name in signals)
    across = np.ptp(signals[told].values, axis=0)
    if not np.any(across[:2] > 0):
        return False
    for name, least in IDLE.items():
        if name in signals:
            values = convert_quantity(name, signals[name].values, log_map)
            size = np.abs(values.mean(axis=1))  # the check of conventions asks for the sign
            return float(np.percentile(size, 90)) > least
    return True


def lift_of(values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return what stands for the lift of the rotors (n,), in any unit."""
    if "rotor_speed" in values:
        return np.sum(values["rotor_speed"] ** 2, axis=1)
    return values["thrust" if "thrust" in values else "throttle"].mean(axis=1)


def _with_collective(aligned: Aligned, signals: Signals, log_map: LogMap) -> Aligned:
    """Return the rows with the collective of the rotors as throttle where they are more than four,
    or logged slowly.
    """
    values = dict(aligned.values)
    for name in (n for n in ("rotor_speed", "throttle") if n in values):
        count = values[name].shape[1]
        if count == 1 or (count == 4 and not is_slow(name, signals[name], log_map)):
            continue
        one = collective(values.pop(name))
        if name == "rotor_speed":  # of no scale, as a throttle is
            one = one / max(float(np.percentile(one, 99)), 1e-9)
        if "thrust" not in values:
            values.setdefault("throttle", one)
    return dc.replace(aligned, values=values)


def _flights(aligned: Aligned, ground: np.ndarray, log_map: LogMap) -> list[FlightLog]:
    """Return the flights, split at long gaps; rows in gaps and on the `ground` are left out."""
    chosen = np.flatnonzero(~aligned.filled & ~ground)
    if not len(chosen):
        return []
    breaks = np.flatnonzero(np.diff(aligned.t[chosen]) > LONGEST_GAP + 1e-9) + 1
    parts = [part for part in np.split(chosen, breaks) if len(part) >= LEAST_ROWS]
    return [_flight(aligned, part, log_map) for part in parts]


def _flight(aligned: Aligned, rows: np.ndarray, log_map: LogMap) -> FlightLog:
    x = {key: value[rows] for key, value in aligned.values.items()}
    t = aligned.t[rows]
    u, throttle, kind = np.full((len(t), 4), np.nan), x.get("throttle"), "normalised"
    if "thrust" in x and log_map.thrust.unit == "weight":
        throttle = x["thrust"]
    elif "thrust" in x:
        u[:, 0], kind = x["thrust"][:, 0], "thrust_only"
    if throttle is not None and "hover_throttle" in x:
        throttle = throttle / np.maximum(x["hover_throttle"], 1e-3)
    if "torque" in x and kind == "thrust_only":
        u[:, 1:], kind = x["torque"], "command"
    elif "rotor_speed" in x:
        kind = "rotor_speed"
    return FlightLog(
        t=t - t[0],
        start=float(t[0]),
        p=x["position"],
        q=x["attitude"],
        v=x["velocity"],
        w=x["rates"],
        u=u,
        a=x.get("acceleration"),
        al=x.get("angular_acceleration"),
        rotor=x.get("rotor_speed"),
        throttle=throttle,
        voltage=x["voltage"][:, 0] if "voltage" in x else None,
        commanded_rates=x.get("commanded_rates"),
        input=kind,
    )


def _timing(signals: Signals, log_map: LogMap) -> float:
    """Return the deviation of the time at which a row's command acts [s]; 0 without a command."""
    commands = [signals[name] for name in COMMANDS if name in signals]
    step = max((own.step for own in commands), default=0.0)
    ticks = max(own.tick for own in signals.values()) * TICK
    if "rotor_speed" in signals and not step:
        own = signals["rotor_speed"]
        slow = own.renewal > FASTER * signals["attitude"].step
        return max(ticks, UNCERTAIN["sampled"] * own.renewal * slow)
    a = signals.get("acceleration")
    if log_map.command == "averaged" and (a is None or FASTER * a.step <= step):
        return ticks
    return max(
        ticks, *(UNCERTAIN[command_meaning(own, log_map)] * own.step for own in commands), 0.0
    )
