"""The decision: which effects of the best model are causes.

An effect is a cause if it acts, its size is material to the motion, and it predicts flights and
blocks of time that did not fit it. `decide_term` has these factors in the order of docs/theory.md;
a `TermDecision` says which of them a candidate fell by.
"""

import dataclasses as dc
from collections.abc import Collection, Mapping, Sequence

import numpy as np
import scipy

from np_drake import attitude
from np_drake.diagnosis.calibration import healthy_prior
from np_drake.diagnosis.decision.predictive_evidence import PredictiveGain, predictive_evidence
from np_drake.diagnosis.fitting import (
    LOADS,
    Fit,
    greatest_height,
    half_width,
    impossible,
    scaled_jacobian,
)
from np_drake.diagnosis.forward_model import Term, pendulum_error, predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import HALF_WIDTH_95, Options, Size
from np_drake.diagnosis.regressors import DRAG, Model, RegressionProblem
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals
from np_drake.diagnosis.result import Cause, Estimate, ResidualFinding
from np_drake.diagnosis.selection import Ranking, names_of, names_of_fit
from np_drake.effects.base import Effect
from np_drake.effects.effect_entry import Posterior
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.estimation.priors import HEALTHY
from np_drake.files.number_text import measure, percent, probability
from np_drake.logs.rotors import named_rotors
from np_drake.vehicle import Vehicle
from np_drake.vehicle.rotor_layout import RotorName

LATE_ONSET = 1.0  # of a flight, in which an onset is none [s]; own choice
ODDS = 0.0124  # share of healthy vehicles beyond whose size a size is a cause [1]; own choice
MOST_ALTERNATIVES = 2  # effects named as indistinguishable from a cause


@dc.dataclass(frozen=True)
class TermDecision:
    """Factors by which a term of the best model is a cause, in the order of docs/theory.md.

    in_model: probability that it acts, against other effects and generic structure in its place
        [1].
    material: probability that its size is more than practically none, given that it acts [1].
    gain: its gain in prediction; None: not asked.
    stands_for: why its parameters are not physical; empty where they are.
    size: at the fit.
    timing: deviation of the time at which commands act, of an effect that shifts it; else 0 [s].
    """

    in_model: float
    material: float
    gain: PredictiveGain | None
    stands_for: str
    size: Size
    timing: float = 0.0

    @property
    def probability(self) -> float:
        """Probability of a cause [1]."""
        predicts = 1.0 if self.gain is None else self.gain.factor
        return 0.0 if self.stands_for else self.in_model * self.material * predicts

    @property
    def is_open(self) -> bool:
        """Whether it may act as well as commands that act late, which the logs leave open."""
        return self.timing > 0 and not (
            self.gain is None or self.gain.contradicted or self.stands_for
        )

    @property
    def reason(self) -> str:
        """Why it is below the threshold of a cause."""
        factors = {
            f"not sure, {probability(self.in_model)}": self.in_model,
            "immaterial": self.material,
        }
        if (gain := self.gain) is not None:
            if gain.contradicted and not self.stands_for:
                return gain.reason
            predicts = gain.reason
            if self.is_open:
                predicts = (
                    f"not told from the time at which commands act, which the logs leave open by "
                    f"{measure(self.timing, 's', 2)} ({gain.gained})"
                )
            factors[predicts] = gain.probability
        return self.stands_for or min(factors, key=lambda why: factors[why])


def decide_term(
    ranking: Ranking,
    log_odds: Sequence[float],
    held_out: HeldOut,
    i: int,
    *,
    same: Sequence[str] = (),
    gain: PredictiveGain | None = None,
    gusts: bool = False,
) -> TermDecision:
    """Decide whether term i of the best model is a cause.

    Args:
        log_odds: of every term, its log odds against generic structure in its place
            (`LinearModel.log_odds`) [nat].
        same: effects that cannot be told from term i, whose probability is added.
        gain: its gain in prediction; None: not asked.
        gusts: whether the slow force is that of gusts. The drag through which they act is material
            and stands for nothing else; its prior is that of gusts against structure that is no
            effect.
    """
    fit = ranking.best
    flights = ranking.problem.flights
    effect = fit.terms[i].effect
    priors = ranking.options.priors
    through_drag = gusts and effect.identifier == DRAG

    # 1. In the model: the share of evidence, times the odds against generic structure.
    named = sum(ranking.probability.get(name, 0.0) for name in (effect.identifier, *same))
    prior_gain = priors.generic - priors.of_effect(DRAG) if through_drag else 0.0
    in_model = min(1.0, named) * float(scipy.special.expit(log_odds[i] + prior_gain))

    # 2. Material: the size is outside the region of practical equivalence.
    size = size_of(
        ranking,
        i,
        [flight for flight in flights if not flight.earlier],
        [(flight, held_out.terms[flight.name]) for flight in held_out.flights],
    )
    if through_drag:
        return TermDecision(in_model, 1.0, None, "", size)
    material = probably_material(ranking, i, size)

    # 3. Predicts: the gain, halved where held-out flights contradict it. 4. Zero, where no vehicle
    # can have such parameters.
    stands_for = impossible(fit, i, flights[0].vehicle, greatest_height(flights))
    timing = ranking.options.tolerance.timing * effect.shifts_commands
    return TermDecision(in_model, material, gain, stands_for, size, timing)


def decide(
    ranking: Ranking, log_odds: Sequence[float], held_out: HeldOut, *, gusts: bool = False
) -> tuple[list[Cause], list[ResidualFinding]]:
    """Return the causes among the effects of the best model, and the others as findings below their
    threshold.

    log_odds: log odds of every term against generic structure in its place [nat]. held_out: the
    best fit on held-out flights, which gives onsets and sizes there. gusts: whether the slow force
    is that of gusts; the drag through which they act matters however small it is.
    """
    fit = ranking.best
    problem = ranking.problem
    options = ranking.options
    members = {names_of(problem, m): m for m in reversed(ranking.models)}
    key = names_of_fit(fit)
    same = equivalents(problem, members[key]) if key in members else {}
    flights = [*problem.flights, *held_out.flights]
    rotors = named_rotors([flight.log for flight in flights], flights[0].vehicle)
    causes = []
    minor = []
    for i, (term, gain) in enumerate(
        zip(fit.terms, predictive_evidence(ranking, held_out), strict=True)
    ):
        name = term.effect.identifier
        effect = term.effect
        # What is in all refined models that are probable has no rival, whatever its columns say.
        room = 1.0 - ranking.probability.get(name, 0.0)
        has_rivals = room > np.exp(-options.thresholds.indistinguishable_evidence)
        others = same.get(name, ()) if has_rivals else ()
        decision = decide_term(ranking, log_odds, held_out, i, same=others, gain=gain, gusts=gusts)
        vehicle = problem.flights[0].vehicle
        parameters = estimates(fit, i, vehicle, options)
        rotor = rotors[round(effect.values["rotor"]) - 1] if "rotor" in effect.values else None
        if decision.probability >= options.thresholds.cause_probability:
            there = {
                flight.name: held_out.terms.get(flight.name, fit.everything)[i]
                for flight in flights
            }
            causes.append(
                Cause(
                    name,
                    decision.probability,
                    parameters,
                    {flight: now.begins(flight) for flight, now in there.items()},
                    others,
                    decision.size.gap,
                    effect,
                    changed=has_changed(ranking, i),
                    rotor=rotor,
                    loads=load_estimates(fit, i, vehicle, options),
                    changes={flight: now.changes.get(flight, ()) for flight, now in there.items()},
                )
            )
        else:
            minor.append(_finding(effect, parameters, decision, rotor))
    return without_missing_drag(causes, minor)


def _finding(
    effect: Effect,
    parameters: Mapping[str, Estimate],
    decision: TermDecision,
    rotor: RotorName | None = None,
) -> ResidualFinding:
    """Return what is said of an effect that is no cause; rotor: what its rotor is called."""
    units = {
        n: "share" if effect.shares and e.unit == "1" else e.unit for n, e in parameters.items()
    }
    values = ", ".join(f"{n} {measure(e.value, units[n], 3)}" for n, e in parameters.items())
    size = decision.size
    shares = f"{percent(size.force)} of weight, {percent(size.torque)} of torque"
    figures = {"force": size.force, "torque": size.torque, "probability": decision.probability}
    if decision.is_open:
        figures["timing"] = decision.timing
    if rotor:
        values = values.replace(f"rotor {rotor.number}", str(rotor))
    return ResidualFinding(
        effect.identifier, f"{values}: {decision.reason} ({shares})", size.gap, figures
    )


def equivalents(problem: RegressionProblem, model: Model) -> dict[str, tuple[str, ...]]:
    """Return by effect of the model those that explain the logs as well in its place, where nothing
    there does not.

    The best `MOST_ALTERNATIVES`, the best first.
    """
    close = model.score - problem.options.thresholds.indistinguishable_evidence
    out: dict[str, tuple[str, ...]] = {}
    for i in model.members:
        candidate = problem.candidates[i]
        rest = tuple(j for j in model.members if j != i)
        if candidate.generic or problem.score(rest) > close:
            continue
        scores: dict[str, float] = {}
        for k, other in enumerate(problem.candidates):
            shared = set(other.identifiers) & set(candidate.identifiers)
            if other.generic or shared or not problem.fits_together((*rest, k)):
                continue
            score = problem.score((*rest, k))
            name = other.identifiers[-1]
            if score > max(close, scores.get(name, -np.inf)):
                scores[name] = score
        out |= dict.fromkeys(
            candidate.identifiers,
            tuple(sorted(scores, key=lambda n: -scores[n])[:MOST_ALTERNATIVES]),
        )
    return out


def estimates(fit: Fit, i: int, vehicle: Vehicle, options: Options) -> dict[str, Estimate]:
    """Return the parameters of term i with 95 % intervals; payloads, which are no ideal pendulums,
    with their error.

    Mass and tether of an unmeasured vehicle are those of a payload without the downwash of its
    rotors. The effect itself keeps those with it: in a simulator payloads hang in still air.
    """
    effect = fit.terms[i].effect
    out = {}
    for p in effect.parameters:
        value = float(getattr(effect, p.name))
        half = half_width(fit, i, p.name)
        if isinstance(effect, SuspendedPayload):
            value, half = _of_pendulum(fit, i, p.name, half, effect, vehicle, options)
        out[p.name] = Estimate(value, p.unit, (value - half, value + half))
    return out


def load_estimates(fit: Fit, i: int, vehicle: Vehicle, options: Options) -> tuple[Estimate, ...]:
    """Return the mass of a payload after each of its changes [kg], as `estimates` does."""
    masses = list[Estimate]()
    for k, load in enumerate(fit.terms[i].loads):
        heavy = SuspendedPayload(**{**fit.terms[i].effect.values, "mass": load})
        half = half_width(fit, i, LOADS, k)
        value, half = _of_pendulum(fit, i, "mass", half, heavy, vehicle, options)
        masses.append(Estimate(value, "kg", (value - half, value + half)))
    return tuple(masses)


def _of_pendulum(
    fit: Fit,
    i: int,
    name: str,
    half: float,
    payload: SuspendedPayload,
    vehicle: Vehicle,
    options: Options,
) -> tuple[float, float]:
    """Return a parameter of a payload and half its 95 % interval, which is no ideal pendulum.

    half: half the interval of the fit.
    """
    unsure = half_width(fit, i, "damping") / HALF_WIDTH_95 if options.tolerance.unmeasured else None
    factor, error = pendulum_error(name, payload, vehicle, options.priors, unsure)
    # Of an unmeasured vehicle, what thrust differs by from session to session hangs there as well.
    weighs = name == "mass" and options.tolerance.unmeasured
    thrust = HEALTHY.session_thrust * vehicle.mass if weighs else 0.0
    half = float(np.linalg.norm([half, HALF_WIDTH_95 * error, HALF_WIDTH_95 * thrust]))
    return factor * getattr(payload, name), factor * half


def without_late_onsets(
    causes: Sequence[Cause], ends: Mapping[str, float]
) -> tuple[list[Cause], list[ResidualFinding]]:
    """Return the causes, absent from flights of which they would begin in the last second, which is
    too little to tell.

    What then acts in no flight is a finding, and no cause. ends: by flight, its end [s].
    """
    kept = []
    late = []
    for c in causes:
        onset = {
            name: np.inf if t is not None and t > ends.get(name, np.inf) - LATE_ONSET else t
            for name, t in c.onset.items()
        }
        if onset != c.onset and all(t == np.inf for t in onset.values()):
            late.append(
                ResidualFinding(
                    c.identifier, "it would begin in the last second of a flight alone", c.share
                )
            )
        else:
            kept.append(dc.replace(c, onset=onset))
    return kept, late


def without_missing_drag(
    causes: Sequence[Cause], minor: Sequence[ResidualFinding]
) -> tuple[list[Cause], list[ResidualFinding]]:
    """Return both with winds moved from the causes to the findings where no drag is a cause."""
    named = {c.identifier for c in causes}
    still = [c for c in causes if c.effect and c.effect.needs and not named & {*c.effect.needs}]
    unfelt = [
        ResidualFinding(c.identifier, "no cause through which it would be felt", c.share)
        for c in still
    ]
    return [c for c in causes if c not in still], [*minor, *unfelt]


def joint_posterior(fit: Fit, causes: Sequence[Cause]) -> Posterior:
    """Return the covariance of the causes' parameters: correlations of the fit, deviations of the
    reported intervals.

    A parameter that the fit does not move, such as the number of a rotor, is not among them.
    """
    reported = {
        (c.identifier, name): estimate.half / HALF_WIDTH_95
        for c in causes
        for name, estimate in c.parameters.items()
    }
    names = [
        (
            fit.terms[f.term].effect.identifier if not f.flight and f.term < len(fit.terms) else "",
            f.name,
        )
        for f in fit.free
    ]
    free_indices = [k for k, name in enumerate(names) if reported.get(name, 0.0) > 0]
    scale = np.sqrt(np.maximum(np.diag(fit.covariance)[free_indices], 1e-300))
    deviation = np.array([reported[names[k]] for k in free_indices])
    covariance = fit.covariance[np.ix_(free_indices, free_indices)] * np.outer(
        deviation / scale, deviation / scale
    )
    return Posterior(
        [".".join(names[k]) for k in free_indices], (0.5 * (covariance + covariance.T)).tolist()
    ).check()


SIZE_DRAWS = 400  # of the posterior
SIZE_SEED = 1


def has_changed(ranking: Ranking, i: int) -> bool:
    """Return whether term i of the best model is practically nothing in the flights from before
    what is asked.
    """
    earlier = [flight for flight in ranking.problem.flights if flight.earlier]
    if not earlier:
        return False
    size = size_of(ranking, i, earlier)
    least = ranking.options.materiality
    return size.force < least.force and size.torque < least.torque


def size_of(
    ranking: Ranking,
    i: int,
    flights: Sequence[FlightResiduals],
    unseen: Sequence[tuple[FlightResiduals, Sequence[Term]]] = (),
) -> Size:
    """Return the size of term i over training and held-out flights; its gap counts training flights
    alone.

    What does little where it was fitted may do much elsewhere, as a drag in a flight that is
    faster. A half of a flight that joined the fit counts in both.

    Args:
        unseen: held-out flights with the terms as they are there.
    Source: own choice.
    """
    fit = ranking.best
    rms = ranking.noise.rms
    known = rms > 0
    here = np.concatenate([_part_of(fit.everything, i, flight) for flight in flights])
    part = np.concatenate([here, *(_part_of(terms, i, flight) for flight, terms in unseen)])
    torques = [flight.nominal[:, 3:] for flight in (*flights, *(flight for flight, _ in unseen))]
    command = np.concatenate([tau - tau.mean(axis=0) for tau in torques])
    y = np.concatenate([flight.y for flight in flights])
    term_power, gap = (float(np.sum((x[:, known] / rms[known]) ** 2)) for x in (here, y))
    effect = fit.terms[i].effect
    return Size(
        float(np.linalg.norm(part[:, FORCE]) / np.sqrt(len(part))) / flights[0].weight,
        float(np.linalg.norm(part[:, TORQUE])) / max(float(np.linalg.norm(command)), 1e-6),
        term_power / max(gap - len(y) * int(known.sum()), term_power, 1e-9),
        float(np.linalg.norm(list(effect.values.values())))
        / max(ranking.options.tolerance.of(effect), 1e-9),
    )


def _part_of(terms: Sequence[Term], i: int, flight: FlightResiduals) -> np.ndarray:
    """Return the part (m, 15) of the terms' predicted residual that is due to term i."""
    return predicted_residual(flight, terms) - predicted_residual(
        flight, [t for j, t in enumerate(terms) if j != i]
    )


def probably_material(ranking: Ranking, i: int, size: Size) -> float:
    """Return the probability that term i of the best model, of this size at the fit, is more than
    what is practically none, given that it acts [1].
    """
    fit = ranking.best
    flights = ranking.problem.flights
    options = ranking.options
    effect = fit.terms[i].effect
    if options.within_timing(effect, flights[0].vehicle):
        return 0.0
    posterior = SizePosterior(fit, i, flights)
    changed = has_changed(ranking, i)
    outside = (
        posterior.material(size, options),
        posterior.beyond(healthy_prior(effect, flights[-1], options.tolerance, changed=changed)),
        posterior.wind(options),
    )
    # Their product: what two bounds leave in doubt is not sure of either.
    return float(np.prod(np.mean(outside, axis=1)))


class SizePosterior:
    """Draws of the parameters of a term from its posterior, and which of them are more than what is
    practically none.

    Source: Laplace approximation.
    """

    def __init__(self, fit: Fit, i: int, flights: Sequence[FlightResiduals]):
        self._fit = fit
        self._i = i
        self._flights = flights
        self._term = fit.terms[i]
        indices = [k for k, f in enumerate(fit.free) if f.term == i and not f.flight]
        self._free = [fit.free[k] for k in indices]
        self._values = fit.values[indices]
        self.draws = np.random.default_rng(SIZE_SEED).multivariate_normal(
            self._values, fit.covariance[np.ix_(indices, indices)], SIZE_DRAWS
        )

    def _places(self, names: Collection[str]) -> list[int]:
        return [k for k, f in enumerate(self._free) if f.name in names]

    def relative(self) -> np.ndarray:
        """Return the size over that at the fit (n,) [1].

        It is the RMS of what the term's parameters predict, linear in their distance from none.
        """
        columns = self._places(
            [LOADS, *(p.name for p in self._term.effect.parameters if p.vanishes)]
        )
        if not columns:
            return np.ones(len(self.draws))
        free = [self._free[k] for k in columns]
        scale, neutral = np.array([(f.scale, f.neutral) for f in free]).T
        # The squared size is the quadratic form d' P d of the distance d from none, P = sum J'J
        # over the flights.
        terms = self._fit.everything
        J = [scaled_jacobian(terms, free, flight)[:, WRENCH] / scale for flight in self._flights]
        flat = np.concatenate(J).reshape(-1, len(columns))
        power = flat.T @ flat
        if not power.any():  # a sensor error that no wrench shows
            power = np.diag(scale**-2.0)
        away = self.draws[:, columns] - neutral
        at_fit = self._values[columns] - neutral
        squares = np.einsum("ni,ij,nj->n", away, power, away)
        return np.sqrt(np.maximum(squares, 0.0) / max(float(at_fit @ power @ at_fit), 1e-300))

    def material(self, size: Size, options: Options) -> np.ndarray:
        """Return which draws (n,) matter to the motion, or are beyond the tolerance of a sensor.

        Args:
            size: of the term at the fit.
        """
        effect = self._term.effect
        least = options.materiality
        relative = self.relative()
        if options.tolerance.of(effect) > 0:
            return size.sensor * relative >= least.sensor
        late = any(begin is not None for begin in self._term.onset.values())
        if (
            effect.tolerance
            and effect.place != "measurement"
            and options.tolerance.real
            and not late
        ):
            # A vehicle file may be off by as much.
            return size.force * relative >= least.calibration_force
        return (size.force * relative >= least.force) | (size.torque * relative >= least.torque)

    def beyond(self, spread: Mapping[str, tuple[float, float]]) -> np.ndarray:
        """Return which draws (n,) are larger than healthy vehicles differ by.

        Args:
            spread: usual value and deviation of parameters by name; empty: there is no such thing.
        """
        columns = self._places(spread)
        if not columns:
            return np.ones(len(self.draws), bool)
        usual, deviation = np.array([spread[self._free[k].name] for k in columns]).T
        away = (self.draws[:, columns] - usual) / deviation
        return np.linalg.norm(away, axis=1) > scipy.stats.chi.isf(ODDS, len(columns))

    def wind(self, options: Options) -> np.ndarray:
        """Return which draws (n,) are more than still air, where the term is a wind.

        The mean level wind is faster than a draught, and pushes harder than an attitude error that
        the sensors may have, under which thrust pushes as a wind does.
        """
        level = self._places(("x", "y"))
        if not self._term.effect.needs or len(level) < 2:
            return np.ones(len(self.draws), bool)
        tolerance = options.tolerance
        least = options.materiality
        # Of the attitude against the rotors' axes, all together [rad].
        lean = (
            (HEALTHY.tilt, HEALTHY.mounting)
            if tolerance.unmeasured
            else (tolerance.attitude, tolerance.mounting)
        )
        error = least.sensor * float(np.hypot(*lean)) * self._flights[0].weight
        forces = []  # in W while it acts
        for flight in self._flights:
            begin = self._term.begins(flight.name)
            acts = flight.t >= (-np.inf if begin is None else begin)
            forces.append(
                attitude.rotate(
                    flight.q, _part_of(self._fit.everything, self._i, flight)[:, FORCE]
                )[acts]
            )
        force = float(np.linalg.norm(np.concatenate(forces).mean(axis=0)[:2]))
        speed = np.linalg.norm(self.draws[:, level], axis=1)
        slowest = error * float(np.linalg.norm(self._values[level])) / max(force, 1e-12)
        return speed > max(least.still_air, slowest)
