"""Examination of flight logs before a diagnosis: is the log usable, what does it excite, which
effects can it tell.
"""

import dataclasses as dc
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from np_drake.diagnosis.calibration.columns import nuisance_of, with_fixed_effects
from np_drake.diagnosis.doctor.doubts import as_lines, doubts, law_doubts
from np_drake.diagnosis.doctor.flight_facts import flight_facts
from np_drake.diagnosis.doctor.log_report import NEVER, NO, YES, Answer, FlightFacts, LogReport
from np_drake.diagnosis.doctor.smallest_sizes import (
    Information,
    Smallest,
    smallest_gust,
    smallest_sizes,
)
from np_drake.diagnosis.doctor.swing_test import swing_test
from np_drake.diagnosis.doctor.traces import GUSTS, explain, nearest_usual, payload_traces, traces
from np_drake.diagnosis.localisation.identifiability import (
    excitation,
    excited,
    manoeuvre,
    tells_apart,
)
from np_drake.diagnosis.regressors import DRAG, PAYLOAD, WIND, hidden_from, options_of
from np_drake.diagnosis.residuals import (
    FORCE,
    LEAST_DURATION,
    FlightResiduals,
    make_flight_residuals,
    natural_step,
)
from np_drake.effects.library import LIBRARY, effects_for, unobservable
from np_drake.effects.parameter import usual_size
from np_drake.files.number_text import number
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.parts import FITS
from np_drake.logs.inputs import with_hover_thrust
from np_drake.vehicle import Vehicle

Progress = Callable[[float, str], None]
MOST_SECONDS = 120.0  # of a flight from which effects are answered for [s]; own choice: memory
MOST_GAPS = 0.1  # share of rows put into gaps from which a log is limited [1]; own choice
MOST_SATURATED = (
    0.05  # share of rows with a rotor at a limit from which a log is limited [1]; own choice
)
FAR = 100.0  # usual sizes beyond which a smallest size is infinite [1]
INSTEAD = {  # words of a reason of `unobservable`: what to log instead
    "measured rotor speed": "log the commanded thrust and torque as well",
    "up to a scale": "log rotor speed, with a thrust coefficient from a stand",
    "no torque": "log the torque command, rotor speed, or every motor's throttle",
    "no accelerations": "log the accelerometer",
    "no position": "log the position",
    "no velocity": "log velocity or position",
    "no attitude": "log the attitude",
}


def examine(
    logs: Sequence[FlightLog],
    vehicle: Vehicle | None = None,
    *,
    sheets: Mapping[str, Mapping[str, Any]] | None = None,
    on_progress: Progress | None = None,
) -> LogReport:
    """Examine flight logs of one kind together.

    Args:
        logs: flights, with thrust and torque from the vehicle where their input is rotor speed or
            throttle.
        vehicle: the nominal vehicle; None: facts, motion and conventions alone, and no effects.
        sheets: by flight, what its import did; sensors of imported flights are taken as real.
        on_progress: called with the share done [1] and the name of the step.
    Raises: ValueError: if there is no flight, or flights have different inputs.
    """
    _require(logs)
    if vehicle is not None:
        vehicle, logs, _ = with_hover_thrust(vehicle, logs)
    tell = on_progress or (lambda share, text: None)
    tell(0.0, "signals and clocks")
    facts = tuple(
        dc.replace(flight_facts(log, vehicle), imported=dict((sheets or {}).get(log.name, {})))
        for log in logs
    )
    own = [doubt for log in logs for doubt in law_doubts(log)]
    wrong = [line for f in facts for line in _no_flight(f)]
    wrong += as_lines(doubt for doubt in own if doubt.fails)
    problems = wrong + [line for f in facts for line in _limits(f)]
    long_enough = [log for log in logs if log.t[-1] - log.t[0] >= LEAST_DURATION]
    if not long_enough:
        problems.append(f"no flight lasts {LEAST_DURATION:g} s: fly longer")
    if vehicle is None or not long_enough or wrong:
        if vehicle is None:
            problems.append(
                "no vehicle file: effects are not judged (np-drake doctor --vehicle FILE)"
            )
        problems += as_lines(doubt for doubt in own if not doubt.fails)
        fastest = {
            key: max(f.motion[key] for f in facts)
            for key in ("speed [m/s]", "rate [rad/s]", "tilt [deg]")
        }
        still = [] if excited(fastest | {"thrust variation [1]": 0.0}) else [_still(fastest, logs)]
        return LogReport(facts, bool(long_enough) and not (wrong or still), (*still, *problems))
    return _with_answers(
        LogReport(facts, True, tuple(problems), vehicle.name), long_enough, vehicle, tell
    )


def _with_answers(
    report: LogReport, logs: Sequence[FlightLog], vehicle: Vehicle, tell: Progress
) -> LogReport:
    """Return the report with excitation, swings and answers."""
    tell(0.2, "residuals")
    logs = [_head(log) for log in logs]
    step = max(natural_step(log.t) for log in logs)
    flights = [with_fixed_effects(make_flight_residuals(log, vehicle, step)) for log in logs]
    first_of_all = [doubt for e in flights for doubt in doubts(e)]
    moving = excitation(flights)
    options = options_of(flights, real=True if any(f.imported for f in report.flights) else None)
    nuisance = nuisance_of(flights, options.tolerance, options.priors)
    tell(0.4, "effects")
    every = traces(flights, options.priors)
    near = [t for t in nearest_usual(every) if t.identifier != PAYLOAD]
    tests = []
    for e in [] if PAYLOAD in hidden_from(flights) else flights:
        tell(0.5, "swing")
        others = nuisance_of([e], options.tolerance, options.priors)
        own = [dc.replace(t, columns={e.name: t.columns[e.name]}) for t in near]
        tests.append(swing_test(e, [c.columns for c in others] + [t.columns for t in own], options))
    swinging = [test for test in tests if test.swings]
    tell(0.7, "noise")
    lengths = np.array([test.length for test in swinging[:1]])
    beside = payload_traces(flights, lengths, options.priors) if swinging else []
    explained = explain(flights, nuisance, [*near, *beside], options)
    tell(0.8, "smallest sizes")
    information = Information(explained.flights, explained.noise, nuisance, every)
    first = logs[0]
    known: dict[str, Any] = {
        "accelerations": first.a is not None,
        "torque": flights[0].knows_torque,
    }
    known["lacks"] = sorted({quantity for log in logs for quantity in log.lacks})
    gust = smallest_gust(explained.noise, moving["duration [s]"])
    found = answers(
        smallest_sizes(information), gust, explained.drag, vehicle, log_input=first.input, **known
    )
    still = () if excited(moving) else (_still(moving, logs),)
    return dc.replace(
        report,
        usable=not still and not any(doubt.fails for doubt in first_of_all),
        problems=(*as_lines(first_of_all), *report.problems, *still),
        sensors="real" if options.tolerance.real else "ideal",
        excitation=moving,
        residual_force=_residual_force(flights),
        noise_floor=explained.floor,
        swings=tuple(tests),
        answers=found,
    )


def _residual_force(flights: Sequence[FlightResiduals]) -> dict[str, float]:
    """Return by axis of B the RMS of the residual force over weight [1]."""
    y = np.concatenate([e.y[~e.outliers, FORCE] for e in flights])
    weight = flights[0].weight
    return dict(zip("xyz", (np.sqrt(np.mean(y**2, axis=0)) / weight).tolist(), strict=True))


def _still(moving: Mapping[str, float], logs: Sequence[FlightLog]) -> str:
    """Return that flights do not move, and what to fly."""
    speed, rate = number(moving["speed [m/s]"], 2), number(moving["rate [rad/s]"], 2)
    logged = "" if any("velocity" in log.lacks for log in logs) else f"speed {speed} m/s, "
    return (
        f"nothing moves ({logged}rates {rate} rad/s): fly sprints in both horizontal "
        f"directions, climbs, "
        "and turns about every axis, for a minute"
    )


def _head(log: FlightLog) -> FlightLog:
    rows = int((log.t <= log.t[0] + MOST_SECONDS).sum())
    return log if rows == len(log) else log.rows(0, rows)


def _no_flight(f: FlightFacts) -> list[str]:
    """Return that a log holds no flight, as its import found."""
    return [
        f"{f.name}: {note}" for note in f.imported.get("notes", ()) if note.startswith("no flight")
    ]


def _limits(f: FlightFacts) -> list[str]:
    """Return what limits the use of a flight, one line each."""
    found = [f"{f.name}: {note}" for note in f.notes if note.startswith(FITS)]
    if f.bridged > MOST_GAPS * f.rows:
        found.append(f"{f.name}: {f.bridged / f.rows:.0%} of the rows were put into gaps")
    if f.saturated is not None and f.saturated > MOST_SATURATED:
        found.append(f"{f.name}: a rotor is at its limit in {f.saturated:.0%} of the rows")
    return found


def _require(logs: Sequence[FlightLog]) -> None:
    if not logs:
        raise ValueError("doctor: logs must hold at least one flight; got none.")
    inputs = sorted({log.input for log in logs})
    if len(inputs) > 1:
        raise ValueError(
            f"doctor: all flights must have the same input; got {' and '.join(inputs)}. "
            f"Examine each kind alone."
        )
    names = [log.name for log in logs]
    if len(set(names)) < len(names):
        raise ValueError(
            "doctor: flights must have different names. Rename one, or give each flight once."
        )
    if len({log.a is None for log in logs}) > 1:
        raise ValueError(
            "doctor: either all flights have accelerations or none. Examine them one kind "
            "at a time."
        )


def answers(
    found: Sequence[Smallest],
    gust: float,
    drag: float | None,
    vehicle: Vehicle,
    *,
    log_input: str,
    **known: Any,
) -> tuple[Answer, ...]:
    """Return an answer for each parameter of each effect: told, not told, never told, in the order
    of the library.

    Args:
        found: smallest sizes; those of the wind are for the usual drag of such a vehicle.
        gust: least deviation of the force of gusts [N].
        drag: that of the vehicle, where it is known [N·s/m]: winds act through it.
        log_input: as `FlightLog.input`.
        known: whether the log has `accelerations` and `torque`, and what it `lacks`.
    """
    hidden = unobservable(log_input, **known)
    sizes = {s.identifier: s for s in found}
    usual_drag = usual_size(LIBRARY[DRAG].parameters[0], vehicle)
    out: list[Answer] = []
    for identifier, effect in effects_for(log_input).items():
        p = next(p for p in effect.parameters if not p.choices)
        if identifier in hidden:
            reason = hidden[identifier]
            todo = next(
                (what for words, what in INSTEAD.items() if words in reason),
                manoeuvre((identifier,)),
            )
            never = (math.inf, math.inf, usual_size(p, vehicle), NEVER, reason, todo)
            out.append(Answer(identifier, p.name, p.unit, *never))
        elif identifier == GUSTS:
            size = gust / (drag or usual_drag)
            out.append(_gust_answer(size, drag is None))
        elif identifier in sizes:
            scale = usual_drag / drag if identifier == WIND and drag else 1.0
            out += _answers(
                sizes[identifier],
                effect,
                vehicle,
                scale,
                told=identifier != WIND or drag is not None,
            )
    return tuple(out)


def _answers(s: Smallest, effect, vehicle: Vehicle, scale: float, *, told: bool) -> list[Answer]:
    parameters = {p.name: p for p in effect.parameters}
    out = []
    for name, alone, beside in zip(s.parameters, s.alone * scale, s.beside * scale, strict=True):
        p = parameters[name]
        typical = p.typical if s.identifier == WIND else usual_size(p, vehicle)
        far = FAR * typical
        verdict = YES if beside <= typical else NO
        reason, todo = "", ""
        if verdict == NO and alone > typical:
            reason = "at its usual size it leaves no clear trace in these flights"
            todo = manoeuvre((s.identifier,))
        elif verdict == NO:
            reason = f"it cannot be told from {', '.join(s.resembles)} in these flights"
            todo = tells_apart(s.identifier, s.resembles[0]) or manoeuvre((s.identifier,))
        if s.identifier == WIND:
            reason = reason or (
                "with their drag" if told else "with usual drag: these flights tell none"
            )
        alone, beside = (float(v) if v <= far else math.inf for v in (alone, beside))
        out.append(
            Answer(
                s.identifier,
                name,
                p.unit,
                beside,
                alone,
                typical,
                verdict,
                reason,
                todo,
                s.resembles,
            )
        )
    return out


def _gust_answer(size: float, guessed: bool) -> Answer:
    p = next(p for p in LIBRARY[GUSTS].parameters if p.name == "deviation")
    verdict = YES if size <= p.typical else NO
    reason = "with usual drag: these flights tell none" if guessed else "with their drag"
    todo = "" if verdict == YES else manoeuvre((GUSTS,))
    return Answer(GUSTS, p.name, p.unit, size, size, p.typical, verdict, reason, todo)
