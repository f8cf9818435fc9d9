"""The decision: which effects of the best model are causes.

An effect is a cause if it acts, its size is material to the motion, and it predicts flights and
blocks of time that did not fit it. `judge` has these factors in the order of docs/theory.md; a
`Judgement` says which of them a candidate fell by.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import special

from np_drake.diagnosis.decision.size import has_changed, probably_material, size_of
from np_drake.diagnosis.decision.support import Support, support_of
from np_drake.diagnosis.decision.unexplained import LinearModel
from np_drake.diagnosis.fitting import Fit, greatest_height, impossible, interval
from np_drake.diagnosis.forward_model import pendulum_error
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import SURE, Options, Size
from np_drake.diagnosis.regressors import DRAG, Model, RegressionProblem
from np_drake.diagnosis.result import Cause, Estimate, Finding
from np_drake.diagnosis.selection import Ranking, names_of, names_of_fit
from np_drake.effects.base import Effect
from np_drake.effects.effect_entry import Posterior
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.files.number_text import measure, number, percent, probability
from np_drake.vehicle import Vehicle

LAST = 1.0  # of a flight, in which an onset is none [s]; own choice
MOST_ALTERNATIVES = 2  # effects named as indistinguishable from a cause


@dc.dataclass(frozen=True)
class Judgement:
    """Factors by which a term of the best model is a cause, in the order of docs/theory.md.

    in_model: probability that it acts, against other effects and generic structure in its place
        [1].
    material: probability that its size is more than practically none, given that it acts [1].
    support: its gain in prediction; None: not asked.
    stands_for: why its parameters are not physical; empty where they are.
    size: at the fit.
    """

    in_model: float
    material: float
    support: Support | None
    stands_for: str
    size: Size

    @property
    def probability(self) -> float:
        """Probability of a cause [1]; what held-out flights contradict is never more probable than
        not.
        """
        found = self.in_model * self.material
        if self.support is not None:
            found *= self.support.probability * (0.5 if self.support.contradicted else 1.0)
        return 0.0 if self.stands_for else found

    @property
    def reason(self) -> str:
        """Why it is below the threshold of a cause."""
        factors = {
            f"not sure, {probability(self.in_model)}": self.in_model,
            "immaterial": self.material,
        }
        if (support := self.support) is not None:
            if support.contradicted and not self.stands_for:
                return "held-out flights are predicted better without it"
            gained = f"{number(support.total, 2)} ± {number(support.error, 2)} nat"
            predicts = f"it does not predict: {gained} in time that did not fit it"
            factors[predicts] = support.probability
        return self.stands_for or min(factors, key=lambda why: factors[why])


def judge(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    held: HeldOut,
    i: int,
    *,
    same: Sequence[str] = (),
    support: Support | None = None,
    gusts: bool = False,
) -> Judgement:
    """Judge term i of the best model.

    Args:
        same: effects that cannot be told from term i, whose probability is added.
        support: its gain in prediction; None: not asked.
        gusts: whether the slow force is that of gusts. The drag through which they act is material
            and stands for nothing else; its prior is that of gusts against structure that is no
            effect.
    """
    fit, flights = ranking.best, ranking.problem.flights
    effect, priors = fit.terms[i].effect, ranking.options.priors
    through_drag = gusts and effect.identifier == DRAG

    # 1. In the model: the share of evidence, times the odds against generic structure.
    named = sum(ranking.probability.get(name, 0.0) for name in (effect.identifier, *same))
    brought = priors.generic - priors.of_effect(DRAG) if through_drag else 0.0
    in_model = min(1.0, named) * float(special.expit(linear.margin(i, structure) + brought))

    # 2. Material: the size is outside the region of practical equivalence.
    unseen = [(e, held.terms[e.name]) for e in held.flights]
    size = size_of(ranking, i, [e for e in flights if not e.earlier], unseen)
    if through_drag:
        return Judgement(in_model, 1.0, None, "", size)
    material = probably_material(ranking, i, size)

    # 3. Predicts: `support`, halved where held-out flights contradict it. 4. Zero, where no vehicle
    # can have such parameters.
    stands_for = impossible(fit, i, flights[0].vehicle, greatest_height(flights))
    return Judgement(in_model, material, support, stands_for, size)


def decide(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    held: HeldOut,
    *,
    gusts: bool = False,
) -> tuple[list[Cause], list[Finding]]:
    """Return the causes among the effects of the best model, and the others as findings below their
    threshold.

    held: the best fit on held-out flights, which gives onsets and sizes there. gusts: whether the
    slow force is that of gusts; the drag through which they act matters however small it is.
    """
    fit, problem, options = ranking.best, ranking.problem, ranking.options
    members = {names_of(problem, m): m for m in reversed(ranking.models)}
    key = names_of_fit(fit)
    same = equivalents(problem, members[key]) if key in members else {}
    every = [*problem.flights, *held.flights]
    causes, minor = [], []
    for i, (term, support) in enumerate(zip(fit.terms, support_of(ranking, held), strict=True)):
        name, effect = term.effect.identifier, term.effect
        others = same.get(name, ())
        found = judge(
            ranking, linear, structure, held, i, same=others, support=support, gusts=gusts
        )
        parameters = estimates(fit, i, problem.flights[0].vehicle, options)
        if found.probability >= options.thresholds.cause_probability:
            onset = {
                e.name: held.terms.get(e.name, fit.everything)[i].begins(e.name) for e in every
            }
            cause = Cause(
                name, found.probability, parameters, onset, others, found.size.gap, effect
            )
            causes.append(dc.replace(cause, changed=has_changed(ranking, i)))
        else:
            minor.append(_finding(effect, parameters, found))
    return without_missing_drag(causes, minor)


def _finding(effect: Effect, parameters: Mapping[str, Estimate], found: Judgement) -> Finding:
    """Return what is said of an effect that is no cause."""
    units = {
        n: "share" if effect.shares and e.unit == "1" else e.unit for n, e in parameters.items()
    }
    values = ", ".join(f"{n} {measure(e.value, units[n], 3)}" for n, e in parameters.items())
    size = found.size
    shares = f"{percent(size.force)} of weight, {percent(size.torque)} of torque"
    figures = {"force": size.force, "torque": size.torque, "probability": found.probability}
    text = f"{values}: {found.reason} ({shares})"
    return Finding(effect.identifier, text, size.gap, figures)


def equivalents(problem: RegressionProblem, model: Model) -> dict[str, tuple[str, ...]]:
    """Return by effect of the model those that explain the logs as well in its place.

    The best `MOST_ALTERNATIVES`, the best first.
    """
    least = model.score - problem.options.thresholds.indistinguishable_evidence
    out: dict[str, tuple[str, ...]] = {}
    for i in model.members:
        own = problem.candidates[i]
        if own.generic:
            continue
        rest = tuple(j for j in model.members if j != i)
        found: dict[str, float] = {}
        for k, other in enumerate(problem.candidates):
            shared = set(other.identifiers) & set(own.identifiers)
            if other.generic or shared or not problem.fits_together((*rest, k)):
                continue
            score, name = problem.score((*rest, k)), other.identifiers[-1]
            if score > max(least, found.get(name, -np.inf)):
                found[name] = score
        names = sorted(found, key=lambda n: -found[n])[:MOST_ALTERNATIVES]
        out |= dict.fromkeys(own.identifiers, tuple(names))
    return out


def estimates(fit: Fit, i: int, vehicle: Vehicle, options: Options) -> dict[str, Estimate]:
    """Return the parameters of term i with 95 % intervals; payloads, which are no ideal pendulums,
    with their error.

    Mass and tether of an unmeasured vehicle are those of a payload without the downwash of its
    rotors. The effect itself keeps those with it: in a simulator payloads hang in still air.
    """
    effect, out = fit.terms[i].effect, {}
    for p in effect.parameters:
        value, (lower, upper) = float(getattr(effect, p.name)), interval(fit, i, p.name)
        half = 0.5 * (upper - lower)
        if isinstance(effect, SuspendedPayload):
            low, high = interval(fit, i, "damping")
            unsure = 0.5 * (high - low) / SURE if options.tolerance.unmeasured else None
            factor, error = pendulum_error(p.name, effect, vehicle, options.priors, unsure)
            value, half = factor * value, factor * float(np.hypot(half, SURE * error))
        out[p.name] = Estimate(value, p.unit, (value - half, value + half))
    return out


def without_late_onsets(
    causes: Sequence[Cause], ends: Mapping[str, float]
) -> tuple[list[Cause], list[Finding]]:
    """Return the causes, absent from flights of which they would begin in the last second, which is
    too little to tell.

    What then acts in no flight is a finding, and no cause. ends: by flight, its end [s].
    """
    kept, late = [], []
    for c in causes:
        onset = {
            name: np.inf if t is not None and t > ends.get(name, np.inf) - LAST else t
            for name, t in c.onset.items()
        }
        if onset != c.onset and all(t == np.inf for t in onset.values()):
            text = "it would begin in the last second of a flight alone"
            late.append(Finding(c.identifier, text, c.share))
        else:
            kept.append(dc.replace(c, onset=onset))
    return kept, late


def without_missing_drag(
    causes: Sequence[Cause], minor: Sequence[Finding]
) -> tuple[list[Cause], list[Finding]]:
    """Return both with winds moved from the causes to the findings where no drag is a cause."""
    named = {c.identifier for c in causes}
    still = [c for c in causes if c.effect and c.effect.needs and not named & {*c.effect.needs}]
    why = "no cause through which it would be felt"
    unfelt = [Finding(c.identifier, why, c.share) for c in still]
    return [c for c in causes if c not in still], [*minor, *unfelt]


def joint_posterior(fit: Fit, causes: Sequence[Cause]) -> Posterior:
    """Return the covariance of the causes' parameters: correlations of the fit, deviations of the
    reported intervals.

    A parameter that the fit does not move, such as the number of a rotor, is not among them.
    """
    reported = {
        (c.identifier, name): estimate.half / SURE
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
    own = [k for k, name in enumerate(names) if reported.get(name, 0.0) > 0]
    scale = np.sqrt(np.maximum(np.diag(fit.covariance)[own], 1e-300))
    deviation = np.array([reported[names[k]] for k in own])
    covariance = fit.covariance[np.ix_(own, own)] * np.outer(deviation / scale, deviation / scale)
    return Posterior(
        [".".join(names[k]) for k in own], (0.5 * (covariance + covariance.T)).tolist()
    ).check()
