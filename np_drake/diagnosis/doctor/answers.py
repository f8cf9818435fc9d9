"""Answers for every effect: whether logs can tell it, from which size on, and what to log or fly where they cannot."""

import math
from collections.abc import Sequence

from np_drake.diagnosis.doctor.log_report import NEVER, NO, YES, Answer
from np_drake.diagnosis.doctor.smallest_sizes import Smallest
from np_drake.diagnosis.doctor.traces import GUSTS
from np_drake.diagnosis.localisation.manoeuvres import manoeuvre, tells_apart
from np_drake.diagnosis.regressors import DRAG, WIND
from np_drake.effects.library import LIBRARY, effects_for, unobservable
from np_drake.effects.parameter import usual_size
from np_drake.vehicle import Vehicle

FAR = 100.0  # usual sizes beyond which a smallest size is infinite [1]
INSTEAD = {  # words of a reason of `unobservable`: what to log instead
    "measured rotor speed": "log the commanded thrust and torque as well",
    "up to a scale": "log rotor speed, with a thrust coefficient from a stand",
    "no torque": "log the torque command, rotor speed, or every motor's throttle",
    "no accelerations": "log the accelerometer",
}


def answers(
    found: Sequence[Smallest],
    gust: float,
    drag: float | None,
    vehicle: Vehicle,
    *,
    log_input: str,
    **known: bool,
) -> tuple[Answer, ...]:
    """Return an answer for each parameter of each effect: told, not told, never told, in the order of the library.

    Args:
        found: smallest sizes; those of the wind are for the usual drag of such a vehicle.
        gust: least deviation of a gusty force [N].
        drag: that of the vehicle, where it is known [N·s/m]: winds act through it.
        vehicle: the nominal vehicle.
        log_input: as `FlightLog.input`.
        known: whether the log has `accelerations` and `torque`.
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
                (what for words, what in INSTEAD.items() if words in reason), manoeuvre((identifier,))
            )
            never = (math.inf, math.inf, usual_size(p, vehicle), NEVER, reason, todo)
            out.append(Answer(identifier, p.name, p.unit, *never))
        elif identifier == GUSTS:
            size = gust / (drag or usual_drag)
            out.append(_gust_answer(size, drag is None))
        elif identifier in sizes:
            scale = usual_drag / drag if identifier == WIND and drag else 1.0
            out += _answers(
                sizes[identifier], effect, vehicle, scale, told=identifier != WIND or drag is not None
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
            reason = reason or ("with their drag" if told else "with usual drag: these flights tell none")
        alone, beside = (float(v) if v <= far else math.inf for v in (alone, beside))
        out.append(
            Answer(s.identifier, name, p.unit, beside, alone, typical, verdict, reason, todo, s.resembles)
        )
    return out


def _gust_answer(size: float, guessed: bool) -> Answer:
    p = next(p for p in LIBRARY[GUSTS].parameters if p.name == "deviation")
    verdict = YES if size <= p.typical else NO
    reason = "with usual drag: these flights tell none" if guessed else "with their drag"
    todo = "" if verdict == YES else manoeuvre((GUSTS,))
    return Answer(GUSTS, p.name, p.unit, size, size, p.typical, verdict, reason, todo)
