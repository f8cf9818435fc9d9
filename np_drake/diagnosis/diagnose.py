"""Diagnosis of the gap between a nominal model and flight logs, in five steps.

1. condition: residuals of every flight against the nominal model, on one grid
   (`make_flight_residuals`);
2. fit and search: sets of effects by their Bayesian evidence on training flights, parameters by
   maximum a posteriori (`selection`, `fitting`);
3. decide: which effects of the best set are causes, judged by held-out flights (`conclude`);
4. report: what the logs cannot tell (identifiability), where the gap lies (localisation), and how
   far the causes close it on held-out flights (gap reduction);
5. second answer: where held-out flights show what training flights do not, the same with their
   first halves. Its held-out figures are of the second halves alone.
"""

import dataclasses as dc
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from np_drake.diagnosis.calibration import (
    calibration_effects,
    differences,
    scale_torque,
    subtract_file_calibration,
    torque_gain,
)
from np_drake.diagnosis.decision.decide import (
    decide,
    estimates,
    joint_posterior,
    load_estimates,
    without_late_onsets,
    without_missing_drag,
)
from np_drake.diagnosis.decision.predictive_evidence import predictive_evidence, visible_changes
from np_drake.diagnosis.decision.unexplained import (
    Indication,
    LinearModel,
    find_unexplained,
    measure_remainder,
)
from np_drake.diagnosis.doctor.flight_facts import bridged_rows, findings_on
from np_drake.diagnosis.fitting import fit_of_subset
from np_drake.diagnosis.forward_model import has_swing
from np_drake.diagnosis.gap import (
    assess_identifiability,
    excitation,
    excited,
    localise,
    measure_gap_reduction,
    unexcited_diagnosis,
    with_held_out_gains,
)
from np_drake.diagnosis.gusts import as_gusts, in_gusts, with_drag
from np_drake.diagnosis.held_out import (
    HeldOut,
    mark_outliers,
    on_held_out,
    subtract_fitted_calibration,
)
from np_drake.diagnosis.options import Options, Tolerance
from np_drake.diagnosis.regressors import GUSTY, tolerance_of, widen_tolerance
from np_drake.diagnosis.regressors.generic import ELSEWHERE
from np_drake.diagnosis.report.words import headline
from np_drake.diagnosis.residuals import (
    WRENCH,
    FlightResiduals,
    common_step,
    long_enough,
    make_flight_residuals,
    require_flights,
    with_same_readings,
)
from np_drake.diagnosis.result import (
    CHANNELS,
    UNKNOWN,
    Cause,
    Diagnosis,
    Remainder,
    Replay,
    ResidualFinding,
)
from np_drake.diagnosis.rotor_balance import compare_balance
from np_drake.diagnosis.selection import Ranking, find_map_model, rank_models
from np_drake.diagnosis.slow_force import position_p_value, residuals_of
from np_drake.effects.gusty_wind import GustyWind
from np_drake.estimation.priors import HEALTHY
from np_drake.estimation.regression import places
from np_drake.files.number_text import NBSP, number
from np_drake.finding import joined
from np_drake.flight_log import FlightLog
from np_drake.logs.inputs import usual_voltage, with_hover_thrust, with_throttle_map
from np_drake.logs.opening import with_neighbours
from np_drake.logs.rotors import named_rotors
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import VOLTAGE

PLACE = ResidualFinding("place", "a slow force tied to a place", 1.0, {}, ELSEWHERE)
NO_REPLAY = (
    "no replay: the held-out logs do not tell the rotors' torque, or the motion to compare with."
)
LEAST_HALF = 4.0  # duration of either half of a flight, below which it is not split [s]; own choice


class Logs(NamedTuple):
    """Logs of one diagnosis, in the order of time, and what is said of those left out."""

    before: list[FlightLog]
    train: list[FlightLog]
    held_out: list[FlightLog]
    notes: tuple[str, ...]

    @property
    def fitted(self) -> list[FlightLog]:
        """Logs to which effects are fitted."""
        return [*self.before, *self.train]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What their readers and the battery say of them."""
        bridged = bridged_rows([*self.fitted, *self.held_out])
        voltage = voltage_change(self.before, [*self.train, *self.held_out])
        return (*bridged, *self.notes, *voltage)


@dc.dataclass(frozen=True)
class Inference:
    """Causes, the best fit on held-out flights, and structure that no effect explains."""

    ranking: Ranking
    held_out: HeldOut
    causes: list[Cause]
    below_threshold: list[ResidualFinding]
    structures: list[Indication]
    slow: Indication

    @cached_property
    def remainder(self) -> Remainder:
        """What the causes leave of the held-out gap."""
        ranking = self.ranking
        indications = [*self.structures, self.slow]
        return measure_remainder(
            self.causes, ranking.noise, self.held_out, indications, ranking.options
        )

    @property
    def findings(self) -> tuple[ResidualFinding, ...]:
        """Where the remainder lives: what is more probable than not."""
        return tuple(s.finding for s in (self.slow, *self.structures) if s.probability > 0.5)


# Flights that are fitted, and those that judge.
FittedAndJudging = tuple[list[FlightResiduals], list[FlightResiduals]]


def conclude(searched: Ranking, judging: Sequence[FlightResiduals]) -> Inference:
    """Rank the models of a search, judge the best by held-out flights, and decide which of its
    effects are causes.
    """
    ranking = rank_models(searched)
    held_out = _best_on_held_out(ranking, judging)
    linear = LinearModel(ranking)
    _, structure = linear.select_structure()
    structures, slow = find_unexplained(ranking, linear, structure, held_out)
    # The drift of an estimator that nobody measured is neither told from gusts nor from a force
    # tied to a place.
    if slow.probability > 0.5 and not ranking.options.tolerance.unmeasured:
        # Gusts do not depend on position alike in all flights.
        unsplit = [flight for flight in held_out.flights if not flight.joined.any()]
        flights = [*ranking.problem.flights, *unsplit]
        p_value = position_p_value(flights, residuals_of(ranking, held_out), ranking.options)
        if p_value < ranking.options.thresholds.position_p_value:
            slow = slow._replace(finding=PLACE)
        else:
            blown = _in_gusts(ranking, linear, structure, held_out, slow.probability)
            if blown is not None:
                return Inference(*blown, structures, slow._replace(probability=0.0))
    causes, minor = decide(ranking, linear.log_odds(structure), held_out)
    return Inference(ranking, held_out, causes, minor, structures, slow)


def as_named(inference: Inference) -> Inference:
    """Return the inference with its causes fitted as they are named: without the effects that are
    not.

    What is not named gives way to calibration and the causes, with which it was fitted. A lag or
    delay that the logs leave open is calibration too. A cause that predicts only together with what
    is not named is none: each must predict given the others.
    """
    ranking = inference.ranking
    options = ranking.options
    vehicle = ranking.problem.flights[0].vehicle
    effects = [term.effect for term in ranking.best.terms]
    open_timing = {f.name for f in inference.below_threshold if "timing" in f.figures}
    calibrations = frozenset(
        effect.identifier
        for effect in effects
        if effect.identifier in open_timing or options.within_timing(effect, vehicle)
    )
    fitted = {effect.identifier for effect in effects}
    named = {cause.identifier for cause in inference.causes}
    if not named <= fitted or not (calibrations or named < fitted):
        return inference  # gusts are fitted otherwise; nothing gives way
    fit = fit_of_subset(ranking.problem, ranking.best, named | calibrations, ranking.noise)
    ranking = dc.replace(ranking, fits=(fit, *ranking.fits))
    terms = {term.effect.identifier: i for i, term in enumerate(fit.terms)}
    causes = [
        dc.replace(
            cause,
            parameters=estimates(fit, terms[cause.identifier], vehicle, options),
            effect=fit.terms[terms[cause.identifier]].effect,
            loads=load_estimates(fit, terms[cause.identifier], vehicle, options),
        )
        for cause in inference.causes
    ]
    held_out = _best_on_held_out(ranking, inference.held_out.flights)
    held_out = dc.replace(held_out, calibrations=calibrations)
    evidence = dict(zip(terms, predictive_evidence(ranking, held_out), strict=True))
    least = options.thresholds.cause_probability
    silent = {
        name: gain.reason
        for name, gain in evidence.items()
        if gain.factor < least and not gain.confirmed
    }
    kept = [cause for cause in causes if cause.identifier not in silent]
    lost = [
        ResidualFinding(cause.identifier, silent[cause.identifier], cause.share)
        for cause in causes
        if cause.identifier in silent
    ]
    kept, minor = without_missing_drag(kept, [*inference.below_threshold, *lost])
    inference = dc.replace(
        inference, ranking=ranking, held_out=held_out, causes=kept, below_threshold=minor
    )
    return as_named(inference) if lost else inference


def _best_on_held_out(ranking: Ranking, judging: Sequence[FlightResiduals]) -> HeldOut:
    """Return the best fit on held-out flights, calibrated and with their outliers marked."""
    best = ranking.best
    noise = ranking.noise
    options = ranking.options
    calibrated = [subtract_fitted_calibration(best, flight, noise, options) for flight in judging]
    marked = [
        mark_outliers(best.terms, flight, noise, options.priors, best.calibration)
        for flight in calibrated
    ]
    return on_held_out(best, marked, noise, options)


def _in_gusts(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    held_out: HeldOut,
    probability: float,
) -> tuple[Ranking, HeldOut, list[Cause], list[ResidualFinding]] | None:
    """Return ranking, held-out flights and causes with gusts of this probability as the slow force;
    None where it can be no wind.
    """
    if (with_one := with_drag(ranking)) is not ranking:
        ranking = with_one
        linear = LinearModel(with_one)
    held_out = on_held_out(ranking.best, held_out.flights, ranking.noise, ranking.options)
    causes, minor = decide(ranking, linear.log_odds(structure), held_out, gusts=True)
    causes = as_gusts(
        ranking.problem.flights,
        residuals_of(ranking, held_out, but=GUSTY),
        causes,
        probability,
        ranking.options,
        held_out.flights,
    )
    if not any(cause.identifier == GustyWind.identifier for cause in causes):
        return None
    return ranking, in_gusts(held_out, causes), causes, minor


def diagnose(
    train: Sequence[FlightLog],
    held_out: Sequence[FlightLog],
    vehicle: Vehicle,
    replay: Replay | None = None,
    *,
    adaptive_split: bool = True,
    tolerance: Tolerance | None = None,
    options: Options | None = None,
    material: float | None = None,
    neighbours: Mapping[str, Sequence[FlightLog]] | None = None,
    before: Sequence[FlightLog] = (),
    same_battery: bool = False,
    on_progress: Callable[[float, str], None] | None = None,
) -> Diagnosis:
    """Diagnose the gap between the nominal model and the flights: its causes, and how far adding
    them closes it.

    Args:
        train: flights to which effects are fitted.
        held_out: flights that judge the fit.
        vehicle: the nominal vehicle. A thrust coefficient that its file calls a guess gives way to
            the rotor speed that carries the training flights (`Diagnosis.nominal`).
        replay: the simulator as a callable (`diagrams.gap.drake_replay.DrakeReplay`); without it,
            replay errors are left out. Where it has `of_vehicle`, it replays the vehicle of
            `Diagnosis.nominal`.
        adaptive_split: where held-out flights show what the training flights do not, give a second
            answer as well (`Diagnosis.refit`): their first halves join its fit, and their second
            halves judge it.
        tolerance: errors of vehicle file and sensors that are not a cause: `Tolerance()` for real
            sensors, `IDEAL_SENSORS`, or any other; default: as the logs look (`tolerance_of`).
        options: all that steers the answer; default: `Options.for_sensors` of that tolerance.
        material: position error of a simulator after 1 s from which what is left is material [m];
            default: that of the options. A force is in proportion to it.
        neighbours: by name of a flight, logs of vehicles that flew near it, on clocks that agree
            and in one frame: their downwash is then tried as a cause.
        before: flights of the same vehicle from before what is asked, when it was as the file says.
            They tell the vehicle, and what acts in none of them has changed since. They may lack
            the accelerations of the others.
        same_battery: whether the battery stayed in place since those flights, so that trim and
            thrust are as they were.
        on_progress: called with the share done [1] and the name of the step.
    Raises: ValueError: if the logs cannot be used, or both tolerance and options are given; one
        line with the remedy.
    """
    if tolerance is not None:
        if options is not None:
            raise ValueError(
                "diagnose: give either tolerance or options, which hold a tolerance; got both."
            )
        options = Options.for_sensors(tolerance.real, tolerance)
    start = time.perf_counter()
    progress = on_progress or (lambda share, step: None)

    # 1. Residuals of all flights on one grid, the coarsest of theirs. A `log` is what was flown, a
    # `flight` its residuals.
    require_flights(train, held_out, before)
    logs = _usable_logs(train, held_out, before, neighbours or {}, vehicle)
    nominal, logs = _with_known_thrust(vehicle, logs)
    if nominal is not vehicle and replay is not None and hasattr(replay, "of_vehicle"):
        replay = replay.of_vehicle(nominal)
    progress(0.0, "residuals")
    fitted, judging = _residuals(logs, nominal)
    findings = [f for flight in (*fitted, *judging) for f in findings_on(flight)]
    doubted = tuple(map(str, joined(findings)))
    options = options or Options.for_sensors(tolerance_of(fitted).real)
    if material is not None:
        options = options.with_material(material)
    if same_battery:
        tolerance = dc.replace(options.tolerance, reseated=False)
        options = dc.replace(options, tolerance=tolerance)
    fitted, judging = _with_shown_torque(fitted, judging, options)
    if not excited(excitation(fitted)):
        answer = unexcited_diagnosis(fitted, judging)
        return dc.replace(answer, doubts=doubted, wall=time.perf_counter() - start)

    # 2. and 3. Sets of effects searched and fitted, rivals ranked, causes decided.
    progress(0.1, "effects")
    inference = conclude(find_map_model(fitted, options), judging)
    novel = novelty(inference)

    # 4. Report.
    progress(0.6, "how far")
    answer = _answer(inference, replay, doubted)
    answer = dc.replace(answer, new_on_held_out=novel, warnings=(*answer.warnings, *logs.warnings))

    # 5. Where held-out flights show more, the same again with their first halves: a second answer.
    if novel and adaptive_split:
        halves, judges = split_flights(inference.held_out.flights)
        if halves:
            progress(0.7, "what held-out flights show")
            refit = _answer(_with_halves(inference, halves, judges), replay, doubted, halves)
            answer = dc.replace(answer, refit=dc.replace(refit, wall=time.perf_counter() - start))
    return dc.replace(answer, wall=time.perf_counter() - start)


def _usable_logs(
    train: Sequence[FlightLog],
    held_out: Sequence[FlightLog],
    before: Sequence[FlightLog],
    neighbours: Mapping[str, Sequence[FlightLog]],
    vehicle: Vehicle,
) -> Logs:
    """Return the logs with the same readings and their neighbours, without those too short."""
    alike, unread = with_same_readings([*train, *held_out])
    alike = with_neighbours([*before, *alike], neighbours, vehicle.rotor_radius)
    sizes = (len(before), len(train), len(held_out))
    groups = [long_enough(alike[place]) for place in places(sizes)]
    short = [line for _, lines in groups for line in lines]
    return Logs._make([*(logs for logs, _ in groups), (*short, *unread)])


def _with_known_thrust(vehicle: Vehicle, logs: Logs) -> tuple[Vehicle, Logs]:
    """Return the vehicle and the logs with the thrust that the first flights show: the file
    describes the vehicle as it was before, where such flights are given.
    """
    known = logs.before or logs.train
    since = [*logs.train, *logs.held_out] if logs.before else logs.held_out
    mapped = with_throttle_map(vehicle, known, since, before=bool(logs.before))
    vehicle, known, since = with_hover_thrust(vehicle, *mapped)
    row = [*known, *since]
    sizes = map(len, (logs.before, logs.train, logs.held_out))
    return vehicle, Logs._make([*(row[place] for place in places(sizes)), logs.notes])


def _residuals(logs: Logs, vehicle: Vehicle) -> FittedAndJudging:
    """Return the flights that are fitted, those from before marked, and those that judge."""
    step = common_step([log.t for log in (*logs.fitted, *logs.held_out)], len(logs.fitted))

    def flight_of(log: FlightLog) -> FlightResiduals:
        return subtract_file_calibration(make_flight_residuals(log, vehicle, step))

    before = [flight_of(log).revised(earlier=True) for log in logs.before]
    fitted = [*before, *map(flight_of, logs.train)]
    return fitted, [flight_of(log) for log in logs.held_out]


def _with_shown_torque(
    fitted: list[FlightResiduals], judging: list[FlightResiduals], options: Options
) -> FittedAndJudging:
    """Return the flights with the share of torque that the motion of an unmeasured vehicle shows,
    where all logs tell torque.
    """
    knows_torque = all(flight.knows_torque for flight in (*fitted, *judging))
    if not (widen_tolerance(options, fitted).tolerance.unmeasured and knows_torque):
        return fitted, judging
    gain = torque_gain(fitted)
    return scale_torque(fitted, gain), scale_torque(judging, gain)


def _with_halves(
    inference: Inference, halves: Sequence[FlightResiduals], judges: Sequence[FlightResiduals]
) -> Inference:
    """Return the inference again, with the first halves of held-out flights in its fit."""
    ranking = inference.ranking
    # A wind is a condition of a flight: where none is named, one can act in the halves alone.
    still_air = not any(cause.effect and cause.effect.needs for cause in inference.causes)
    flights = [*ranking.problem.flights, *halves]
    return conclude(find_map_model(flights, ranking.options, still_air=still_air), judges)


def voltage_change(before: Sequence[FlightLog], since: Sequence[FlightLog]) -> tuple[str, ...]:
    """Return the battery's voltage before and since as a sentence, where thrust differs by it as
    much as by its charge; else none.
    """
    was = usual_voltage(before)
    now = usual_voltage(since)
    if was is None or now is None or VOLTAGE * abs(np.log(now / was)) < HEALTHY.charge:
        return ()
    return (
        f"battery: {number(was, 3)}{NBSP}V in the flights before, {number(now, 3)}{NBSP}V since",
    )


def novelty(inference: Inference) -> tuple[ResidualFinding, ...]:
    """Return whether held-out flights show what training flights do not, as a sentence or none.

    Gusts, which repeat nowhere, and a payload, whose swing may be lost, do not count.
    """
    ranking = inference.ranking
    held_out = inference.held_out
    gusts = any(cause.identifier == GustyWind.identifier for cause in inference.causes)
    if gusts or has_swing(ranking.best.terms):
        return ()
    residual = np.concatenate(
        [held_out.residual[name][rows, WRENCH] for name, rows in held_out.rows.items()]
    )
    ratios = np.sqrt(np.mean(residual**2, axis=0)) / np.maximum(ranking.noise.rms[WRENCH], 1e-12)
    channel = int(np.argmax(ratios))
    ratio = float(ratios[channel])
    if ratio <= ranking.options.thresholds.misfit_ratio:
        return ()
    text = f"{CHANNELS[channel]} is {number(ratio, 2)} times what the training flights leave"
    return (
        ResidualFinding("misfit", text, ratio, {}, "fly the held-out trajectory again, and fit it"),
    )


def split_flights(flights: Sequence[FlightResiduals]) -> FittedAndJudging:
    """Return the first halves of flights, and all flights with these rows marked as joined."""
    halves = []
    judges = []
    for flight in flights:
        log = flight.log
        middle = 0.5 * (log.t[0] + log.t[-1])
        if middle - log.t[0] < LEAST_HALF:
            judges.append(flight)
            continue
        rows = int(np.searchsorted(log.t, middle))
        first = dc.replace(log.rows(0, rows), name=f"first half of {flight.name}")
        half = subtract_file_calibration(
            make_flight_residuals(first, flight.vehicle, flight.grid.step)
        )
        (half,) = scale_torque([half], np.array(flight.torque_gain))
        halves.append(dc.replace(half, goes_on=True))
        judges.append(flight.revised(joined=flight.t <= middle))
    return halves, judges


def _answer(
    inference: Inference,
    replay: Replay | None,
    doubted: tuple[str, ...],
    halves: Sequence[FlightResiduals] = (),
) -> Diagnosis:
    """Return the diagnosis of an inference: its causes, what these logs cannot tell, where the gap
    lies, how far; halves: of held-out flights, which joined the fit.
    """
    inference = as_named(inference)
    ranking = inference.ranking
    flights = ranking.problem.flights
    held_out = inference.held_out
    judging = held_out.flights
    vehicle = flights[0].vehicle
    options = ranking.options
    best = ranking.best
    noise = ranking.noise
    logs = {flight.name: flight.log for flight in (*flights, *judging)}
    ends = {name: float(log.t[-1]) for name, log in logs.items()}
    causes, late = without_late_onsets(inference.causes, ends)
    causes = with_held_out_gains(causes, noise, held_out)
    remainder = dc.replace(inference, causes=causes).remainder
    checked = assess_identifiability(flights, judging, noise)
    residual = held_out.remaining_residuals({cause.identifier for cause in causes})
    flyable = all(flight.knows_torque and not flight.log.lacks for flight in judging)
    reduction = measure_gap_reduction(
        causes,
        noise,
        held_out,
        remainder,
        replay if flyable else None,
        calibration_effects(best, flights[0], options.tolerance),
    )
    before = tuple(flight.name for flight in flights if flight.earlier)
    not_asked = {*before, *(half.name for half in halves)}
    posterior = joint_posterior(best, causes)
    visible = visible_changes(ranking) if before else {}
    if before and not flights[0].knows_torque:
        balance = compare_balance(
            [logs[name] for name in before],
            [log for name, log in logs.items() if name not in not_asked],
            vehicle,
            options,
        )
        causes = [*causes, *balance.causes]
        late = [*late, *balance.findings]
        visible |= balance.visible
    answer = Diagnosis(
        vehicle=vehicle.name,
        nominal=vehicle,
        rotors=tuple(named_rotors([*logs.values()], vehicle)),
        train=tuple(flight.name for flight in flights if flight.name not in not_asked),
        held_out=tuple(flight.name for flight in judging),
        joined=tuple(flight.name for flight in judging if flight.joined.any()),
        doubts=doubted,
        judged_as="rig" if options.tolerance.real else "laboratory",
        before=before,
        visible=visible,
        verdict=tuple(cause.identifier for cause in causes if cause.changed or not before)
        + ((UNKNOWN,) if remainder.matters else ()),
        causes=tuple(
            dc.replace(
                cause, onset={name: t for name, t in cause.onset.items() if name not in not_asked}
            )
            for cause in causes
        ),
        calibration=differences(best, flights, options.tolerance),
        identifiability=checked,
        localisation=localise(judging, residual, noise, held_out.rows),
        gap_reduction=reduction,
        posterior=posterior,
        below_threshold=(*inference.below_threshold, *late),
        unexplained=inference.findings,
        unknown_probability=remainder.probability,
        warnings=(
            *checked.warnings,
            *reduction.warnings,
            *(() if flyable or replay is None else (NO_REPLAY,)),
        ),
    )
    return dc.replace(answer, headline=headline(answer))
