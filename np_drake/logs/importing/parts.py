"""Parts of a log, between its breaks: the stretch that fits the conventions, its rows, and the
flights in it.
"""

import dataclasses as dc
from collections.abc import Callable, Mapping

import numpy as np

from np_drake.checks import require
from np_drake.finding import Finding, Kind
from np_drake.flight_log import FlightLog
from np_drake.logs.clock import on_one_clock
from np_drake.logs.columns import LEAST_ROWS, LONGEST_GAP
from np_drake.logs.errors import LogError
from np_drake.logs.importing.alignment import (
    COMMANDS,
    Aligned,
    align,
    command_meaning,
    with_whole_motion,
)
from np_drake.logs.importing.breaks import within
from np_drake.logs.importing.conventions import (
    DOUBTED,
    Verdict,
    WrongConventions,
    agreed,
    fitting_stretch,
    judged,
)
from np_drake.logs.importing.laws import FASTEST_ROTOR, WINDOW, stretches
from np_drake.logs.importing.log_map import GRAVITY, UNITS, LogMap, convert_quantity
from np_drake.logs.importing.signals import FASTER, Signals, clock_of, is_slow

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
    for start, stop in stretches(share < RUNNING).tolist():
        at_an_end = stop - start >= LEAST_ROWS and (start == 0 or stop == len(t))
        if not at_an_end and t[stop - 1] - t[start] < STANDS:
            continue
        rises = 2 * np.polyfit(t[start:stop] - t[start], p[start:stop, 2], 2)[0]
        if rises < -(1 - RUNNING) * GRAVITY:
            continue
        drifts = np.linalg.norm(p[start:stop] - p[start], axis=1).max() > MOVED
        if drifts and np.median(share[start:stop]) > STOPPED:
            continue
        before = np.flatnonzero(np.linalg.norm(p[:start] - p[start], axis=1) > MOVED)
        after = np.flatnonzero(np.linalg.norm(p[stop:] - p[stop - 1], axis=1) > MOVED)
        first = before[-1] + 1 if before.size else 0
        out[first : stop + after[0] if after.size else len(t)] = True
    return out


RANGES = {  # of nearly all values in flight
    "throttle": (-0.05, 1.5),  # [1]; own choice: trimmed and overdriven motors stay inside
    "hover_throttle": (0.02, 1.5),  # [1]; own choice
    "rotor_speed": (-np.inf, FASTEST_ROTOR),  # [rad/s]
    "voltage": (-np.inf, 1000.0),  # [V]; own choice: what no vehicle has
}


def require_ranges(values: Mapping[str, np.ndarray], log_map: LogMap, path: str) -> None:
    """Check the inputs and the voltage of a log in SI units.
    Raises: LogError: if its values cannot be in the unit that the map declares.
    """
    for name, (least, most) in ((n, ends) for n, ends in RANGES.items() if n in values):
        middle = np.median(values[name])
        high = np.percentile(values[name], 99.9)
        source = getattr(log_map, name)
        unit = source.unit_of(name)
        wrong, shown = (f"above {most:g}", high) if high > most else (f"below {least:g}", middle)
        require(
            least <= middle and high <= most,
            f"{path}, {name} ({', '.join(source.columns)}): must not be {wrong} in flight; got "
            f"{shown:.4g} with unit: {unit}. Give its unit ({', '.join(UNITS[name])}) or scale in "
            "the map.",
            LogError,
        )


def require_a_flight(log_map: LogMap, path: str, looks: Callable[[str], str]) -> None:
    """Check that the map names what a flight log needs, before anything is read.

    Args:
        looks: returns a sentence on the columns that look like fields.
    Raises: LogError: if it does not.
    """
    needs = (
        (
            log_map.attitude or log_map.in_body,
            "attitude, or of rates and acceleration in body axes, as a gyro and an accelerometer "
            "read them; a flight log needs these.",
            "qwa",
        ),
        (
            log_map.position or log_map.velocity or log_map.acceleration,
            "position, velocity or acceleration; got none of them.",
            "pva",
        ),
        (
            log_map.thrust or log_map.rotor_speed or log_map.throttle,
            "thrust, rotor_speed or throttle; a flight log needs one of them.",
            "u",
        ),
    )
    for named, what, fields in needs:
        if not named:
            raise LogError(
                f"{path}: its own names, or a map (--map FILE), must tell columns of {what}"
                f"{looks(fields)}"
            )


RESTS = 0.8  # share of readings equal to the one before from which motors idle [1]; own choice


# Below which rotors stand [N, 1, rad/s]; own choice. Commands count before speeds.
IDLE = {"thrust": 0.0, "throttle": 0.05, "rotor_speed": 10.0}
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
    timing: deviation of the time at which a row's command acts [s].
    """

    signals: Signals
    verdict: Verdict
    aligned: Aligned
    carried: bool
    ground: np.ndarray
    flights: tuple[FlightLog, ...]
    timing: float


def import_part(
    signals: Signals, log_map: LogMap, verdict: Verdict, path: str, usual: float = 0.0
) -> Part:
    """Return the flights of one part, in SI units and our frames.

    Args:
        usual: lift in the flights of the longest part, as of `lift_of`; 0: not known.
    Raises: LogError: if its signals do not overlap, or are in another unit.
    """
    carried = not no_flight(signals, log_map)
    signals, log_map, lacks, derived = with_whole_motion(signals, log_map)
    aligned = align(signals, log_map, path)
    aligned = dc.replace(aligned, findings=(*derived, *aligned.findings))
    ground = np.zeros(len(aligned.t), bool)
    if carried:
        require_ranges(aligned.values, log_map, path)
        ground = standing(aligned.t, aligned.values["position"], lift_of(aligned.values), usual)
    flights = _flights(_with_collective(aligned, signals, log_map), ground, log_map)
    flights = [dc.replace(flight, lacks=lacks, findings=list(derived)) for flight in flights]
    return Part(
        signals, verdict, aligned, carried, ground, tuple(flights), _timing(signals, log_map)
    )


def no_flight(signals: Signals, log_map: LogMap) -> str:
    """Return why a part is no flight; empty: it is one, as far as the log tells.

    A vehicle that is carried by hand moves while its motors stand or idle: what holds a vehicle in
    the air never rests.
    """
    moving = next(name for name in ("position", "velocity", "acceleration") if name in signals)
    if not np.ptp(signals[moving].values[:, :2], axis=0).any():
        return "position stays"
    for name, least in IDLE.items():
        if name in signals:
            values = convert_quantity(name, signals[name].renewed.values, log_map)
            size = np.abs(values.mean(axis=1))  # the check of conventions asks for the sign
            rests = np.mean(np.diff(size[size > least]) == 0) if (size > least).sum() > 1 else 1.0
            carry = float(np.percentile(size, 90)) > least and rests < RESTS
            return "" if carry else "the motors do not carry the vehicle"
    return ""


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
        # At which all together lift as much: thrust goes with the square.
        each = values.pop(name)
        one = np.sqrt(np.mean(np.square(each), axis=1, keepdims=True))
        if count == 4:
            values["balance"] = each / np.maximum(one, 1e-9)
        if name == "rotor_speed":  # of no scale, as a throttle is
            one = one / max(float(np.percentile(one, 99)), 1e-9)
        if "thrust" not in values:
            values.setdefault("throttle", one)
    return dc.replace(aligned, values=values)


def _flights(aligned: Aligned, ground: np.ndarray, log_map: LogMap) -> list[FlightLog]:
    """Return the flights, split on the `ground` and at long gaps that no line bridges.

    Rows in gaps are left out; in a long gap that a line bridges they stay, with a mark.
    """
    t = aligned.t
    chosen = np.flatnonzero(~aligned.filled & ~ground)
    breaks = np.flatnonzero(np.diff(t[chosen]) > LONGEST_GAP + 1e-9) + 1
    parts = [part for part in np.split(chosen, breaks) if len(part) >= LEAST_ROWS]
    flights = parts[:1]
    for part in parts[1:]:
        between = np.arange(flights[-1][-1], part[0] + 1)
        holes = np.diff(t[between]) > LONGEST_GAP + 1e-9
        if holes.any() or (aligned.torn | ground)[between].any():
            flights.append(part)
        else:
            flights[-1] = np.concatenate([flights[-1], between[1:-1], part])
    return [_flight(aligned, rows, log_map) for rows in flights]


def _flight(aligned: Aligned, rows: np.ndarray, log_map: LogMap) -> FlightLog:
    x = {key: value[rows] for key, value in aligned.values.items()}
    t = aligned.t[rows]
    bridged = aligned.filled[rows]
    u = np.full((len(t), 4), np.nan)
    throttle = x.get("throttle")
    kind = "normalised"
    if "thrust" in x and log_map.thrust.unit == "weight":
        throttle = x["thrust"]
    elif "thrust" in x:
        u[:, 0] = x["thrust"][:, 0]
        kind = "thrust_only"
    if throttle is not None and "hover_throttle" in x:
        throttle = throttle / np.maximum(x["hover_throttle"], 1e-3)
    if "torque" in x and kind == "thrust_only":
        u[:, 1:] = x["torque"]
        kind = "command"
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
        balance=x.get("balance"),
        bridged=bridged if bridged.any() else None,
        input=kind,
    )


def _timing(signals: Signals, log_map: LogMap) -> float:
    """Return the deviation of the time at which a row's command acts [s]; 0 without a command."""
    commands = [signals[name] for name in COMMANDS if name in signals]
    step = max((signal.step for signal in commands), default=0.0)
    ticks = max(signal.tick for signal in signals.values()) * TICK
    if "rotor_speed" in signals and not step:
        signal = signals["rotor_speed"]
        slow = signal.renewal > FASTER * signals["attitude"].step
        return max(ticks, UNCERTAIN["sampled"] * signal.renewal * slow)
    a = signals.get("acceleration")
    if log_map.command == "averaged" and (a is None or FASTER * a.step <= step):
        return ticks
    return max(
        ticks,
        *(UNCERTAIN[command_meaning(signal, log_map)] * signal.step for signal in commands),
        0.0,
    )


Parts = tuple[LogMap, list[Part], list[Finding]]  # map, what was made of every part


def imported_parts(
    parts: list[Signals], log_map: LogMap, path: str, *, origin: float, adopt: bool
) -> Parts:
    """Return the map that agrees with the longest part, what was made of every part, and the
    findings on those left out.

    Args:
        origin: from which times of the findings count [s].
        adopt: take other conventions where the longest part fits those.
    Raises: WrongConventions, LogError: if that of the longest part that fails, where none holds a
        flight.
    """
    grounds = [no_flight(signals, log_map) for signals in parts]
    by_length = sorted(
        range(len(parts)), key=lambda k: (bool(grounds[k]), -np.ptp(clock_of(parts[k]).t))
    )
    parts, log_map, findings = on_one_clock(parts, parts[by_length[0]], log_map)
    done: dict[int, Part] = {}
    failure: LogError | None = None
    usual = 0.0
    for k in by_length:
        span = f"the part from {clock_of(parts[k]).t[0] - origin:.2f} s on"
        if done and grounds[k]:
            findings.append(Finding(Kind.LEFT_OUT, "", f"{span} is no flight; left out"))
            continue
        try:
            part, log_map, verdict, stretch = _fitting(
                parts[k], log_map, path, origin, adopt=adopt and not done
            )
            made = import_part(part, log_map, verdict, path, usual)
            if done and not made.flights:
                findings.append(Finding(Kind.LEFT_OUT, "", f"{span} holds no flight; left out"))
                continue
            usual = usual or (usual_lift(lift_of(made.aligned.values)) if made.carried else 0.0)
            done[k] = made
            findings += stretch
        except LogError as error:
            fits_other = isinstance(error, WrongConventions) and bool(error.verdict.changes)
            if len(parts) == 1 or (fits_other and not done):
                raise
            failure = failure or error
            wrong = (
                "does not agree with"
                if isinstance(error, WrongConventions)
                else "is no flight log by"
            )
            findings.append(Finding(Kind.LEFT_OUT, "", f"{span} {wrong} itself; left out"))
    if failure is not None and not done:
        raise failure
    stated = any(finding.kind is Kind.STRETCH for finding in findings)
    if max(done) < len(parts) - 1 and not stated:
        end = done[max(done)].aligned.t[-1] - origin
        text = f"fits until {end:.1f} s; what follows is left out"
        findings.append(Finding(Kind.STRETCH, "", text))
    if why := grounds[by_length[0]]:
        text = f"{why}; nothing can be identified"
        findings.insert(0, Finding(Kind.NO_FLIGHT, "no flight", text))
    return log_map, [done[k] for k in sorted(done)], findings


def _fitting(
    signals: Signals, log_map: LogMap, path: str, origin: float, *, adopt: bool
) -> tuple[Signals, LogMap, Verdict, list[Finding]]:
    """Return what of a part agrees with the map, the map, the verdict, and a finding where that is
    not all of the part.
    """
    verdict = Verdict({}, ()) if no_flight(signals, log_map) else judged(signals, log_map, path)
    disturbed = any(misfit > DOUBTED for misfit in verdict.misfits.values()) and not verdict.changes
    findings: list[Finding] = []
    if stretch := fitting_stretch(signals, log_map, verdict) if disturbed else None:
        start, stop = stretch
        part, _ = within(signals, start, stop)
        of_part = judged(part, log_map, path)
        kinds, tested = (
            {law.split()[0] for law in laws} for laws in (verdict.failed, of_part.misfits)
        )
        if not of_part.failed and kinds <= tested:
            since = f"from {start - origin:.1f} " if start > clock_of(signals).t[0] + WINDOW else ""
            laws_text = ", ".join(verdict.failed[:3]) or "its quantities"
            where = f"fits {since}until {stop - origin:.1f} s; beyond, {laws_text} do not agree"
            findings = [Finding(Kind.STRETCH, where, "left out")]
            signals = part
            verdict = of_part
    log_map, verdict = agreed(verdict, signals, log_map, path, adopt=adopt)
    return signals, log_map, verdict, findings
