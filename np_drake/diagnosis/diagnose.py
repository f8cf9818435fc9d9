"""Diagnosis of the gap between a nominal model and flight logs, in five steps.

1. condition: residuals of every flight against the nominal model, on one grid
  (`make_flight_residuals`);
2. fit and search: sets of effects by their Bayesian evidence on training flights, parameters by
  maximum a posteriori
   (`selection`, `fitting`);
3. decide: which effects of the best set are causes, judged by held-out flights (`decision.infer`);
4. report: what the logs cannot tell (identifiability), where the gap lies (localisation), and how
  far the causes close
   it on held-out flights (gap reduction);
5. second answer: where held-out flights show what training flights do not, the same with their
  first halves.
"""

import dataclasses as dc
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from np_drake.diagnosis.calibration.columns import calibration_effects, with_fixed_effects
from np_drake.diagnosis.calibration.differences import differences
from np_drake.diagnosis.calibration.torque_gain import torque_gain, with_torque_gain
from np_drake.diagnosis.decision.causes import joint_posterior, without_late_onsets
from np_drake.diagnosis.decision.explanations import explanations_of
from np_drake.diagnosis.decision.infer import Inference, as_named, infer
from np_drake.diagnosis.decision.second_answer import novelty, second_answer, without_onsets_in
from np_drake.diagnosis.doctor.doubts import as_lines, doubts
from np_drake.diagnosis.forward_model import predicted_residual
from np_drake.diagnosis.gap.gap_reduction import held_out_gains, measure_gap_reduction
from np_drake.diagnosis.localisation.identifiability import (
    assess_identifiability,
    excitation,
    excited,
    unexcited_diagnosis,
)
from np_drake.diagnosis.localisation.localisation import localise
from np_drake.diagnosis.numerics import Readings
from np_drake.diagnosis.options import Options, Tolerance
from np_drake.diagnosis.regressors import tolerance_of, with_input
from np_drake.diagnosis.report import headline as headline  # which every `Diagnosis` says
from np_drake.diagnosis.report.coverage import coverage
from np_drake.diagnosis.residuals import (
    FlightResiduals,
    long_enough,
    make_flight_residuals,
    natural_step,
    require_flights,
    with_same_readings,
)
from np_drake.diagnosis.result import UNKNOWN, Diagnosis, Replay
from np_drake.flight_log import FlightLog
from np_drake.logs.case_folder import with_neighbours
from np_drake.logs.columns import said_of_bridged
from np_drake.logs.inputs import with_hover_thrust, with_throttle_map
from np_drake.vehicle import Vehicle

Progress = Callable[[float, str], None]
NO_REPLAY = (
    "no replay: the held-out logs do not tell the rotors' torque, or the motion to compare with."
)


def diagnose(
    vehicle: Vehicle,
    train: Sequence[FlightLog],
    held_out: Sequence[FlightLog],
    replay: Replay | None = None,
    *,
    adaptive_split: bool = True,
    tolerance: Tolerance | None = None,
    options: Options | None = None,
    material: float | None = None,
    neighbours: Mapping[str, Sequence[FlightLog]] | None = None,
    on_progress: Progress | None = None,
) -> Diagnosis:
    """Diagnose the gap between the nominal model and the flights: its causes, and how far adding
    them closes it.

    Args:
        vehicle: the nominal vehicle. A thrust coefficient that its file calls a guess gives way to
            the rotor speed that carries the training flights (`Diagnosis.nominal`).
        train: flights to which effects are fitted.
        held_out: flights that judge the fit.
        replay: the simulator as a callable (`diagrams.gap.drake_replay.DrakeReplay`); without it,
            replay errors are left out. Where it has `of_vehicle`, it replays the vehicle of
            `Diagnosis.nominal`.
        adaptive_split: where held-out flights show what the training flights do not, give a second
            answer beside (`Diagnosis.refit`): their first halves join its fit, and their second
            halves judge it.
        tolerance: errors of vehicle file and sensors that are not a cause: `Tolerance()` for real
            sensors, `IDEAL_SENSORS`, or one's own; default: real where attitudes are noisy or rotor
            speed is measured.
        options: all that steers the answer; default: `Options.for_sensors` of that tolerance.
        material: position error of a simulator after 1 s from which what is left is material [m];
            default: that of the options. A force is in proportion to it.
        neighbours: by name of a flight, logs of vehicles that flew beside it, on clocks that agree
            and in one frame: their downwash is then tried as a cause.
        on_progress: called with the share done [1] and the name of the step.
    Raises: ValueError: if the logs cannot be used, or both tolerance and options are given; one
        line with the remedy.
    """
    if tolerance is not None and options is not None:
        raise ValueError(
            "diagnose: give either tolerance or options, which hold a tolerance; got both."
        )
    if tolerance is not None:
        options = Options.for_sensors(tolerance.real, tolerance)
    start = time.perf_counter()
    tell = on_progress or (lambda share, text: None)

    # 1. Residuals of all flights on one grid, the coarsest of theirs.
    require_flights(train, held_out)
    alike, unread = with_same_readings([*train, *held_out])
    train, held_out = alike[: len(train)], alike[len(train) :]
    if neighbours:
        beside = with_neighbours([*train, *held_out], neighbours, vehicle.rotor_radius)
        train, held_out = beside[: len(train)], beside[len(train) :]
    (train, short), (held_out, brief) = long_enough(train), long_enough(held_out)
    train, held_out = with_throttle_map(vehicle, train, held_out)
    file, (vehicle, train, held_out) = vehicle, with_hover_thrust(vehicle, train, held_out)
    if vehicle is not file:
        replay = getattr(replay, "of_vehicle", lambda _: replay)(vehicle)
    tell(0.0, "residuals")
    step = max(natural_step(log.t) for log in [*train, *held_out])
    fitted = [with_fixed_effects(make_flight_residuals(log, vehicle, step)) for log in train]
    judging = [with_fixed_effects(make_flight_residuals(log, vehicle, step)) for log in held_out]
    names: dict[str, Any] = {
        "vehicle": vehicle.name,
        "nominal": vehicle,
        "train": _names(fitted),
        "held_out": _names(judging),
    }
    names["doubts"] = as_lines(doubt for e in (*fitted, *judging) for doubt in doubts(e))
    sensors = options or Options.for_sensors(tolerance_of(fitted).real)
    if material is not None:
        options = sensors = sensors.with_material(material)
    if with_input(sensors, fitted).tolerance.unmeasured and all(
        e.knows_torque for e in (*fitted, *judging)
    ):
        gain = torque_gain(fitted)
        fitted, judging = with_torque_gain(fitted, gain), with_torque_gain(judging, gain)
    if not excited(excitation(fitted)):
        nothing = unexcited_diagnosis(fitted, judging)
        return Diagnosis(**names, **nothing, cannot_tell=True, wall=time.perf_counter() - start)

    # 2. and 3. Sets of effects searched and fitted, rivals ranked, causes decided; 4. report.
    tell(0.1, "effects")
    first = infer(fitted, judging, options)
    novel = novelty(first)
    tell(0.6, "how far")
    answer = _answer(first, names, replay)
    filled = said_of_bridged([*train, *held_out])
    wall = time.perf_counter() - start
    warnings = (*answer.warnings, *filled, *short, *brief, *unread)
    answer = dc.replace(answer, new_on_held_out=novel, warnings=warnings, wall=wall)
    if not (novel and adaptive_split):
        return answer

    # 5. Where held-out flights show more, the same again with their first halves: a second answer.
    tell(0.7, "what held-out flights show")
    again = second_answer(first)
    if again is None:
        return answer
    second, joined = again
    refit = _answer(second, names, replay)
    causes = tuple(without_onsets_in(joined, cause) for cause in refit.causes)
    halves = tuple(e.name for e in second.held_out if e.joined.any())
    wall = time.perf_counter() - start
    return dc.replace(
        answer, refit=dc.replace(refit, causes=causes, joined=halves, wall=wall), wall=wall
    )


def _answer(found: Inference, names: dict[str, Any], replay: Replay | None) -> Diagnosis:
    """Return the diagnosis of an inference: its causes, what these logs cannot tell, where the gap
    lies, how far.
    """
    found = as_named(found)
    ends = {e.name: float(e.log.t[-1]) for e in (*found.flights, *found.held_out)}
    causes, late = without_late_onsets(found.causes, ends)
    found = dc.replace(found, causes=causes, below_threshold=[*found.below_threshold, *late])
    noise, held = found.ranking.noise, found.held
    gains = held_out_gains(causes, noise, held)
    found = dc.replace(
        found, causes=[dc.replace(c, held_out_gain=g) for c, g in zip(causes, gains, strict=True)]
    )
    checked = assess_identifiability(
        found.flights, found.held_out, found.ranking.problem.candidates, noise
    )
    named = {c.identifier for c in found.causes}
    left = {e.name: e.y - predicted_residual(e, held.kept(e.name, named)) for e in found.held_out}
    located = localise(found.held_out, left, noise, held.rows)
    flyable = all(e.knows_torque and not e.log.lacks for e in found.held_out)
    told = () if flyable or replay is None else (NO_REPLAY,)
    calibration = calibration_effects(found.ranking.best, found.flights[0], found.options.tolerance)
    reduction = measure_gap_reduction(
        found.causes, noise, held, found.left, replay if flyable else None, calibration
    )
    return Diagnosis(
        **names,
        judged_as=found.options.tolerance.name,
        verdict=tuple(c.identifier for c in found.causes) + ((UNKNOWN,) if found.unknown else ()),
        causes=tuple(found.causes),
        calibration=differences(found.ranking.best, found.flights, found.options.tolerance),
        identifiability=checked,
        localisation=located,
        gap_reduction=reduction,
        coverage=coverage(tuple(found.causes), found.flights, found.held_out),
        posterior=joint_posterior(found.ranking.best, found.causes),
        explanations=explanations_of(found.ranking, held),
        readings=Readings(noise, found.options.tolerance),
        below_threshold=tuple(found.below_threshold),
        unexplained=found.findings,
        unknown_probability=found.left.probability,
        warnings=(*checked.warnings, *reduction.warnings, *told),
    )


def _names(flights: Sequence[FlightResiduals]) -> tuple[str, ...]:
    return tuple(e.name for e in flights)
