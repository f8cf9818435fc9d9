"""Diagnosis of the gap between a nominal model and flight logs, in five steps.

1. condition: residuals of every flight against the nominal model, on one grid
   (`make_flight_residuals`);
2. fit and search: sets of effects by their Bayesian evidence on training flights, parameters by
   maximum a posteriori (`selection`, `fitting`);
3. decide: which effects of the best set are causes, judged by held-out flights (`conclude`);
4. report: what the logs cannot tell (identifiability), where the gap lies (localisation), and how
   far the causes close it on held-out flights (gap reduction);
5. second answer: where held-out flights show what training flights do not, the same with their
   first halves. The second halves alone judge it.
"""

import dataclasses as dc
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from np_drake.diagnosis.calibration import (
    calibration_effects,
    differences,
    torque_gain,
    with_fixed_effects,
    with_torque_gain,
)
from np_drake.diagnosis.decision.decide import (
    decide,
    estimates,
    joint_posterior,
    load_estimates,
    without_late_onsets,
    without_missing_drag,
)
from np_drake.diagnosis.decision.support import support_of, visible_changes
from np_drake.diagnosis.decision.unexplained import (
    Indication,
    LinearModel,
    find_unexplained,
    measure_remainder,
)
from np_drake.diagnosis.doctor.flight_facts import as_lines, doubts
from np_drake.diagnosis.fitting import fit_of_some
from np_drake.diagnosis.gap import (
    assess_identifiability,
    excitation,
    excited,
    localise,
    measure_gap_reduction,
    unexcited_diagnosis,
    with_held_out_gains,
)
from np_drake.diagnosis.gusts import in_gusts, residuals_of, with_drag, with_gusts
from np_drake.diagnosis.held_out import HeldOut, mark_outliers, on_held_out, with_calibration
from np_drake.diagnosis.options import SPREAD, Options, Tolerance
from np_drake.diagnosis.regressors import tolerance_of, with_input
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
from np_drake.diagnosis.slow_force import position_p_value
from np_drake.effects.gusty_wind import GustyWind
from np_drake.files.number_text import NBSP, number
from np_drake.flight_log import FlightLog
from np_drake.logs.columns import said_of_bridged
from np_drake.logs.inputs import usual_voltage, with_hover_thrust, with_throttle_map
from np_drake.logs.opening import with_neighbours
from np_drake.logs.rotors import named_rotors
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import VOLTAGE

PLACE = ResidualFinding("place", "a slow force tied to a place", 1.0, {}, ELSEWHERE)
NO_REPLAY = (
    "no replay: the held-out logs do not tell the rotors' torque, or the motion to compare with."
)
LEAST_HALF = 4.0  # duration of either half of a flight, below which it stays whole [s]; own choice


@dc.dataclass(frozen=True)
class Inference:
    """Causes and what they leave; held: the causes on held-out flights."""

    ranking: Ranking
    held: HeldOut
    causes: list[Cause]
    below_threshold: list[ResidualFinding]
    structures: list[Indication]
    slow: Indication

    @cached_property
    def left(self) -> Remainder:
        """What the causes leave of the held-out gap."""
        said = [*self.structures, self.slow]
        ranking = self.ranking
        return measure_remainder(self.causes, ranking.noise, self.held, said, ranking.options)

    @property
    def findings(self) -> tuple[ResidualFinding, ...]:
        """Where the remainder lives: what is more probable than not."""
        return tuple(s.finding for s in (self.slow, *self.structures) if s.probability > 0.5)


def conclude(found: Ranking, held_out: Sequence[FlightResiduals]) -> Inference:
    """Rank the models of a search, judge the best by held-out flights, and decide which of its
    effects are causes.
    """
    ranking = rank_models(found)
    held = _held_out(ranking, held_out)
    linear = LinearModel(ranking)
    _, structure = linear.select_structure()
    structures, slow = find_unexplained(ranking, linear, structure, held)
    # The drift of an estimator that nobody measured is neither told from gusts nor from a force
    # tied to a place.
    if slow.probability > 0.5 and not ranking.options.tolerance.unmeasured:
        # Gusts do not depend on position alike in all flights.
        every = [*ranking.problem.flights, *(e for e in held.flights if not e.joined.any())]
        rest = residuals_of(ranking, held)
        begins = dict.fromkeys([e.name for e in every])
        if position_p_value(every, rest, begins) < ranking.options.thresholds.position_p_value:
            slow = slow._replace(finding=PLACE)
        else:
            blown = _in_gusts(ranking, linear, structure, held, slow.probability)
            if blown is not None:
                return Inference(*blown, structures, slow._replace(probability=0.0))
    causes, minor = decide(ranking, linear.margins(structure), held)
    return Inference(ranking, held, causes, minor, structures, slow)


def as_named(found: Inference) -> Inference:
    """Return the inference with its causes fitted as they are named: without the effects that are
    not.

    What is not named gives way to calibration and the causes, which were fitted beside it. A lag or
    delay that the logs leave open is calibration too. A cause that predicted beside what is not
    named alone is none: each must predict given the others.
    """
    named = {c.identifier for c in found.causes}
    ranking = found.ranking
    vehicle = ranking.problem.flights[0].vehicle
    options = ranking.options
    effects = [t.effect for t in ranking.best.terms]
    untold = {f.name for f in found.below_threshold if "timing" in f.figures}
    open_ = frozenset(
        e.identifier for e in effects if e.identifier in untold or options.within_timing(e, vehicle)
    )
    every = {e.identifier for e in effects}
    if not named <= every or not (open_ or named < every):
        return found  # gusts are fitted otherwise; nothing gives way
    fit = fit_of_some(ranking.problem, ranking.best, named | open_, ranking.noise)
    ranking = dc.replace(ranking, fits=(fit, *ranking.fits))
    terms = {t.effect.identifier: i for i, t in enumerate(fit.terms)}
    causes = [
        dc.replace(
            c,
            parameters=estimates(fit, terms[c.identifier], vehicle, options),
            effect=fit.terms[terms[c.identifier]].effect,
            loads=load_estimates(fit, terms[c.identifier], vehicle, options),
        )
        for c in found.causes
    ]
    held = dc.replace(_held_out(ranking, found.held.flights), calibrations=open_)
    predicts = dict(zip(terms, support_of(ranking, held), strict=True))
    least = options.thresholds.cause_probability
    silent = {n: s for n, s in predicts.items() if s.factor < least and not s.confirmed}
    kept = [c for c in causes if c.identifier not in silent]
    lost = [
        ResidualFinding(c.identifier, silent[c.identifier].reason, c.share)
        for c in causes
        if c not in kept
    ]
    kept, minor = without_missing_drag(kept, [*found.below_threshold, *lost])
    now = dc.replace(found, ranking=ranking, held=held, causes=kept, below_threshold=minor)
    return as_named(now) if lost else now


def _held_out(ranking: Ranking, held_out: Sequence[FlightResiduals]) -> HeldOut:
    """Return the best fit on held-out flights, calibrated and with their outliers marked."""
    best = ranking.best
    noise = ranking.noise
    options = ranking.options
    own = [with_calibration(best, e, noise, options) for e in held_out]
    marked = [mark_outliers(best.terms, e, noise, options.priors, best.calibration) for e in own]
    return on_held_out(best, marked, noise, options)


def _in_gusts(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    held: HeldOut,
    probability: float,
) -> tuple[Ranking, HeldOut, list[Cause], list[ResidualFinding]] | None:
    """Return ranking, held-out flights and causes with gusts of this probability as the slow force;
    None where it can be no wind.
    """
    if (with_one := with_drag(ranking)) is not ranking:
        ranking = with_one
        linear = LinearModel(with_one)
    held = on_held_out(ranking.best, held.flights, ranking.noise, ranking.options)
    causes, minor = decide(ranking, linear.margins(structure), held, gusts=True)
    causes = with_gusts(ranking, held, causes, probability)
    if not any(c.identifier == GustyWind.identifier for c in causes):
        return None
    return ranking, in_gusts(held, causes), causes, minor


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
    before: Sequence[FlightLog] = (),
    on_progress: Callable[[float, str], None] | None = None,
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
        before: flights of the same vehicle from before what is asked, when it was as the file says.
            They tell the vehicle, and what acts in none of them has changed since. They may lack
            the accelerations of the others.
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
    tell = on_progress or (lambda share, step: None)

    # 1. Residuals of all flights on one grid, the coarsest of theirs.
    require_flights(train, held_out, before)
    alike, unread = with_same_readings([*train, *held_out])
    alike = with_neighbours([*before, *alike], neighbours or {}, vehicle.rotor_radius)
    first = len(before)
    second = len(before) + len(train)
    parts = [long_enough(logs) for logs in (alike[:first], alike[first:second], alike[second:])]
    before, train, held_out = (logs for logs, _ in parts)
    short = [line for _, lines in parts for line in lines]
    # The file describes the vehicle as it was before, where that is given: it carries its weight
    # there.
    train = [*before, *train]
    file = vehicle
    known = len(before) or len(train)
    since = [*train[known:], *held_out]
    vehicle, was, since = with_hover_thrust(
        vehicle, *with_throttle_map(vehicle, train[:known], since, before=bool(before))
    )
    train, held_out = [*was, *since][: len(train)], [*was, *since][len(train) :]
    if vehicle is not file:
        replay = getattr(replay, "of_vehicle", lambda _: replay)(vehicle)
    tell(0.0, "residuals")
    step = common_step([log.t for log in [*train, *held_out]], len(train))
    fitted, judging = (
        [with_fixed_effects(make_flight_residuals(log, vehicle, step)) for log in logs]
        for logs in (train, held_out)
    )
    fitted = [dc.replace(e, earlier=k < len(before)) for k, e in enumerate(fitted)]
    doubted = as_lines(doubt for e in (*fitted, *judging) for doubt in doubts(e))
    sensors = options or Options.for_sensors(tolerance_of(fitted).real)
    if material is not None:
        options = sensors = sensors.with_material(material)
    if with_input(sensors, fitted).tolerance.unmeasured and all(
        e.knows_torque for e in (*fitted, *judging)
    ):
        gain = torque_gain(fitted)
        fitted = with_torque_gain(fitted, gain)
        judging = with_torque_gain(judging, gain)
    if not excited(excitation(fitted)):
        return dc.replace(
            unexcited_diagnosis(fitted, judging), doubts=doubted, wall=time.perf_counter() - start
        )

    # 2. and 3. Sets of effects searched and fitted, rivals ranked, causes decided; 4. report.
    tell(0.1, "effects")
    inference = conclude(find_map_model(fitted, options), judging)
    novel = novelty(inference)
    tell(0.6, "how far")
    answer = _answer(inference, replay, doubted)
    said = (*said_of_bridged([*train, *held_out]), *short, *unread)
    said += voltage_change(train[: len(before)], [*train[len(before) :], *held_out])
    answer = dc.replace(answer, new_on_held_out=novel, warnings=(*answer.warnings, *said))

    # 5. Where held-out flights show more, the same again with their first halves: a second answer.
    halves, judges = split_flights(inference.held.flights) if novel and adaptive_split else ([], [])
    if halves:
        tell(0.7, "what held-out flights show")
        # A wind is a condition of a flight: where none is named, one can act in the halves alone.
        still_air = not any(c.effect and c.effect.needs for c in inference.causes)
        found = find_map_model(
            [*inference.ranking.problem.flights, *halves],
            inference.ranking.options,
            still_air=still_air,
        )
        refit = _answer(conclude(found, judges), replay, doubted, halves)
        answer = dc.replace(answer, refit=dc.replace(refit, wall=time.perf_counter() - start))
    return dc.replace(answer, wall=time.perf_counter() - start)


def voltage_change(before: Sequence[FlightLog], since: Sequence[FlightLog]) -> tuple[str, ...]:
    """Return the battery's voltage before and since as a sentence, where thrust differs by it as
    much as by its charge; else none.
    """
    was = usual_voltage(before)
    now = usual_voltage(since)
    if was is None or now is None or VOLTAGE * abs(np.log(now / was)) < SPREAD.charge:
        return ()
    return (
        f"battery: {number(was, 3)}{NBSP}V in the flights before, {number(now, 3)}{NBSP}V since",
    )


def novelty(found: Inference) -> tuple[ResidualFinding, ...]:
    """Return whether held-out flights show what training flights do not, as a sentence or none.

    Gusts, which repeat nowhere, and a payload, whose swing may be lost, do not count.
    """
    ranking = found.ranking
    if any(c.identifier == GustyWind.identifier for c in found.causes) or any(
        t.effect.has_hidden_state for t in ranking.best.terms
    ):
        return ()
    rest = np.concatenate(
        [found.held.residual[name][own, WRENCH] for name, own in found.held.rows.items()]
    )
    ratios = np.sqrt(np.mean(rest**2, axis=0)) / np.maximum(ranking.noise.rms[WRENCH], 1e-12)
    channel = int(np.argmax(ratios))
    ratio = float(ratios[channel])
    if ratio <= ranking.options.thresholds.misfit_ratio:
        return ()
    text = f"{CHANNELS[channel]} is {number(ratio, 2)} times what the training flights leave"
    return (
        ResidualFinding("misfit", text, ratio, {}, "fly the held-out trajectory again, and fit it"),
    )


def split_flights(
    flights: Sequence[FlightResiduals],
) -> tuple[list[FlightResiduals], list[FlightResiduals]]:
    """Return the first halves of flights as flights of their own, and all flights with these rows
    marked as joined.
    """
    halves = []
    judges = []
    for e in flights:
        log = e.log
        middle = 0.5 * (log.t[0] + log.t[-1])
        if middle - log.t[0] < LEAST_HALF:
            judges.append(e)
            continue
        half = dc.replace(
            log.rows(0, int(np.searchsorted(log.t, middle))), name=f"first half of {e.name}"
        )
        own = with_fixed_effects(make_flight_residuals(half, e.vehicle, e.grid.step))
        (own,) = with_torque_gain([own], np.array(e.torque_gain))
        halves.append(dc.replace(own, goes_on=True))
        judges.append(dc.replace(e, joined=e.t <= middle))
    return halves, judges


def _answer(
    found: Inference,
    replay: Replay | None,
    doubted: tuple[str, ...],
    halves: Sequence[FlightResiduals] = (),
) -> Diagnosis:
    """Return the diagnosis of an inference: its causes, what these logs cannot tell, where the gap
    lies, how far; halves: of held-out flights, which joined the fit.
    """
    found = as_named(found)
    flights = found.ranking.problem.flights
    held = found.held
    options = found.ranking.options
    best = found.ranking.best
    noise = found.ranking.noise
    judging = held.flights
    causes, late = without_late_onsets(
        found.causes, {e.name: float(e.log.t[-1]) for e in (*flights, *judging)}
    )
    causes = with_held_out_gains(causes, noise, held)
    left = dc.replace(found, causes=causes).left
    checked = assess_identifiability(flights, judging, noise)
    rest = held.left({c.identifier for c in causes})
    flyable = all(e.knows_torque and not e.log.lacks for e in judging)
    reduction = measure_gap_reduction(
        causes,
        noise,
        held,
        left,
        replay if flyable else None,
        calibration_effects(best, flights[0], options.tolerance),
    )
    before = tuple(e.name for e in flights if e.earlier)
    own = {e.name for e in halves} | {*before}
    posterior = joint_posterior(best, causes)
    visible = visible_changes(found.ranking) if before else {}
    if before and not flights[0].knows_torque:
        told = compare_balance(
            [e.log for e in flights if e.earlier],
            [e.log for e in (*flights, *judging) if e.name not in own],
            flights[0].vehicle,
            options,
        )
        causes = [*causes, *told.causes]
        late = [*late, *told.findings]
        visible |= told.visible
    answer = Diagnosis(
        vehicle=flights[0].vehicle.name,
        nominal=flights[0].vehicle,
        rotors=tuple(named_rotors([e.log for e in (*flights, *judging)], flights[0].vehicle)),
        train=tuple(e.name for e in flights if e.name not in own),
        held_out=tuple(e.name for e in judging),
        joined=tuple(e.name for e in judging if e.joined.any()),
        doubts=doubted,
        judged_as="rig" if options.tolerance.real else "laboratory",
        before=before,
        visible=visible,
        verdict=tuple(c.identifier for c in causes if c.changed or not before)
        + ((UNKNOWN,) if left.matters else ()),
        causes=tuple(
            dc.replace(c, onset={name: t for name, t in c.onset.items() if name not in own})
            for c in causes
        ),
        calibration=differences(best, flights, options.tolerance),
        identifiability=checked,
        localisation=localise(judging, rest, noise, held.rows),
        gap_reduction=reduction,
        posterior=posterior,
        below_threshold=(*found.below_threshold, *late),
        unexplained=found.findings,
        unknown_probability=left.probability,
        warnings=(
            *checked.warnings,
            *reduction.warnings,
            *(() if flyable or replay is None else (NO_REPLAY,)),
        ),
    )
    return dc.replace(answer, headline=headline(answer))
