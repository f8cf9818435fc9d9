"""Examination of flight logs before a diagnosis: usable or not, and which effects they can tell.

`LogReport.as_json` gives the content of `np-drake doctor --json`.
"""

import dataclasses as dc
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from np_drake.diagnosis.calibration import nuisance_of, with_fixed_effects
from np_drake.diagnosis.doctor.flight_facts import (
    FlightFacts,
    as_lines,
    doubts,
    flight_facts,
    law_doubts,
)
from np_drake.diagnosis.doctor.smallest_sizes import (
    Information,
    Smallest,
    explain,
    nearest_usual,
    smallest_gust,
    smallest_sizes,
    traces,
)
from np_drake.diagnosis.localisation import excitation, excited, manoeuvre, tells_apart
from np_drake.diagnosis.regressors import DRAG, PAYLOAD, WIND, options_of
from np_drake.diagnosis.residuals import (
    FORCE,
    LEAST_DURATION,
    common_step,
    make_flight_residuals,
    require_alike,
)
from np_drake.diagnosis.result import CHANNELS
from np_drake.effects.base import usual_size
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.library import LIBRARY, effects_for, unobservable
from np_drake.files.file_access import plain
from np_drake.files.number_text import number
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.parts import FITS
from np_drake.logs.inputs import with_hover_thrust
from np_drake.vehicle import Vehicle

YES, NO, NEVER = "yes", "no", "never"


@dc.dataclass(frozen=True)
class Answer:
    """Whether a log can tell one parameter of an effect.

    smallest: size that is told from zero at 99.7 % (three posterior deviations), beside nuisance
    parameters and the
    effects named in `beside`; infinite: none.   alone: the same beside nuisance parameters only.
    typical: usual size for a vehicle of this mass and arm.
    verdict: `yes` (smallest is at most typical), `no`, or `never` (a log of this kind has no trace
        of it).
    todo: what to log or fly instead; empty for `yes`.
    """

    identifier: str
    parameter: str
    unit: str
    smallest: float
    alone: float
    typical: float
    verdict: str
    reason: str = ""
    todo: str = ""
    beside: tuple[str, ...] = ()


@dc.dataclass(frozen=True)
class LogReport:
    """Result of `examine`.

    usable: whether anything can be diagnosed; problems: what stands against it, or limits it, one
    line each.
    excitation: RMS values and spans over all flights; with the vehicle's where one is given.
    residual_force: by axis of B, RMS of the residual force over weight, nothing fitted [1]; empty
        without a vehicle.
    noise_floor: by channel, RMS of what no effect explains [N, N·m]; empty without a vehicle.
    """

    flights: tuple[FlightFacts, ...]
    usable: bool
    problems: tuple[str, ...]
    vehicle: str = ""
    sensors: str = ""
    excitation: dict[str, float] = dc.field(default_factory=dict)
    noise_floor: dict[str, float] = dc.field(default_factory=dict)
    answers: tuple[Answer, ...] = ()
    residual_force: dict[str, float] = dc.field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return the report in plain types; values that are not finite become None."""
        return plain(dc.asdict(self))


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
    on_progress: Callable[[float, str], None] | None = None,
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
    wrong, limits = [], []
    for f in facts:
        notes = f.imported.get("notes", ())
        wrong += [f"{f.name}: {note}" for note in notes if note.startswith("no flight")]
        limits += [f"{f.name}: {note}" for note in f.notes if note.startswith(FITS)]
        if f.bridged > MOST_GAPS * f.rows:
            limits.append(f"{f.name}: {f.bridged / f.rows:.0%} of the rows were put into gaps")
        if f.saturated is not None and f.saturated > MOST_SATURATED:
            limits.append(f"{f.name}: a rotor is at its limit in {f.saturated:.0%} of the rows")
    wrong += as_lines(doubt for doubt in own if doubt.fails)
    problems = wrong + limits
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
        still = nothing_moves(fastest | {"thrust variation [1]": 0.0}, logs)
        return LogReport(facts, bool(long_enough) and not (wrong or still), (*still, *problems))
    report = LogReport(facts, True, tuple(problems), vehicle.name)
    return _with_answers(report, long_enough, vehicle, tell)


def _with_answers(
    report: LogReport,
    logs: Sequence[FlightLog],
    vehicle: Vehicle,
    tell: Callable[[float, str], None],
) -> LogReport:
    """Return the report with excitation and answers, from the first `MOST_SECONDS` of flights."""
    tell(0.2, "residuals")
    logs = [log.rows(0, int((log.t <= log.t[0] + MOST_SECONDS).sum())) for log in logs]
    step = common_step([log.t for log in logs], len(logs))
    flights = [with_fixed_effects(make_flight_residuals(log, vehicle, step)) for log in logs]
    first_of_all = [doubt for e in flights for doubt in doubts(e)]
    moving = excitation(flights)
    options = options_of(flights, real=True if any(f.imported for f in report.flights) else None)
    nuisance = nuisance_of(flights, options.tolerance, options.priors)
    every = traces(flights, options.priors)
    # All that the flights may hold, payloads on every tether, is no noise.
    near = [t for t in nearest_usual(every) if t.identifier != PAYLOAD]
    hung = [t for t in every if t.identifier == PAYLOAD]
    tell(0.6, "noise")
    cleared, noise, drag = explain(flights, nuisance, [*near, *hung], options)
    tell(0.8, "smallest sizes")
    information = Information(cleared, noise, nuisance, every)
    known: dict[str, Any] = {
        "accelerations": logs[0].a is not None,
        "torque": flights[0].knows_torque,
        "lacks": sorted({quantity for log in logs for quantity in log.lacks}),
    }
    gust = smallest_gust(noise, moving["duration [s]"])
    smallest = smallest_sizes(information)
    still = nothing_moves(moving, logs)
    y = np.concatenate([e.y[~e.outliers, FORCE] for e in flights])
    force = np.sqrt(np.mean(y**2, axis=0)) / flights[0].weight
    return dc.replace(
        report,
        usable=not still and not any(doubt.fails for doubt in first_of_all),
        problems=(*as_lines(first_of_all), *report.problems, *still),
        sensors="real" if options.tolerance.real else "ideal",
        excitation=moving,
        residual_force=dict(zip("xyz", force.tolist(), strict=True)),
        noise_floor=dict(zip(CHANNELS, noise.rms.tolist(), strict=False)),
        answers=answers(smallest, gust, drag, vehicle, log_input=logs[0].input, **known),
    )


def nothing_moves(moving: Mapping[str, float], logs: Sequence[FlightLog]) -> tuple[str, ...]:
    """Return that flights do not move, and what to fly; empty where they do."""
    if excited(dict(moving)):
        return ()
    speed, rate = number(moving["speed [m/s]"], 2), number(moving["rate [rad/s]"], 2)
    logged = "" if any("velocity" in log.lacks for log in logs) else f"speed {speed} m/s, "
    return (
        f"nothing moves ({logged}rates {rate} rad/s): fly sprints in both horizontal directions, "
        "climbs, and turns about every axis, for a minute",
    )


def _require(logs: Sequence[FlightLog]) -> None:
    if not logs:
        raise ValueError("doctor: logs must hold at least one flight; got none.")
    require_alike("doctor", logs)
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

    found: smallest sizes; those of the wind are for the usual drag of such a vehicle.
    gust: least deviation of the force of gusts [N]. drag: that of the vehicle, where it is known
    [N·s/m]: winds act through it.
    known: whether the log has `accelerations` and `torque`, and what it `lacks`.
    """
    hidden, sizes = unobservable(log_input, **known), {s.identifier: s for s in found}
    usual_drag = usual_size(LIBRARY[DRAG].parameters[0], vehicle)
    through = "with their drag" if drag else "with usual drag: these flights tell none"
    out: list[Answer] = []
    for name, effect in effects_for(log_input).items():
        parameters, fly = {p.name: p for p in effect.parameters}, manoeuvre((name,))
        p = next(p for p in effect.parameters if not p.choices)
        if name in hidden:
            reason = hidden[name]
            todo = next((what for words, what in INSTEAD.items() if words in reason), fly)
            never = (math.inf, math.inf, usual_size(p, vehicle), NEVER, reason, todo)
            out.append(Answer(name, p.name, p.unit, *never))
        elif name == GustyWind.identifier:
            p, size = parameters["deviation"], gust / (drag or usual_drag)
            told = (YES, through, "") if size <= p.typical else (NO, through, fly)
            out.append(Answer(name, p.name, p.unit, size, size, p.typical, *told))
        elif name in sizes:
            s, scale = sizes[name], usual_drag / drag if name == WIND and drag else 1.0
            for own, alone, beside in zip(s.parameters, s.alone, s.beside, strict=True):
                p, verdict, reason, todo = parameters[own], YES, "", ""
                alone, beside = float(alone * scale), float(beside * scale)
                usual = p.typical if name == WIND else usual_size(p, vehicle)
                if not beside <= usual:
                    verdict, todo = NO, fly
                    reason = "at its usual size it leaves no clear trace in these flights"
                    if not alone > usual:
                        reason = f"it cannot be told from {', '.join(s.resembles)} in these flights"
                        todo = tells_apart(name, s.resembles[0]) or fly
                if name == WIND:
                    reason = reason or through
                beside, alone = (v if v <= FAR * usual else math.inf for v in (beside, alone))
                said = (verdict, reason, todo, s.resembles)
                out.append(Answer(name, own, p.unit, beside, alone, usual, *said))
    return tuple(out)
