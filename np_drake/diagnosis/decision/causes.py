"""Causes and minor findings: the effects of the best model, each with its probability and size."""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import special

from np_drake.diagnosis.adequacy.linear_model import LinearModel
from np_drake.diagnosis.decision.effect_size import size_of, within_calibration
from np_drake.diagnosis.decision.equivalence import indistinguishable
from np_drake.diagnosis.decision.size_posterior import material_share, relative_sizes, wind_share
from np_drake.diagnosis.fitting import Fit, impossible, interval
from np_drake.diagnosis.forward_model import pendulum_error
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.materiality import Size
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors import DRAG
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Estimate, Finding
from np_drake.diagnosis.selection import Ranking, names_of, names_of_fit


@dc.dataclass(frozen=True)
class Judged:
    """What is known of a term of the best model.

    in_model: probability that it acts, against other effects and generic structure in its place [1].
    material: probability that it is larger than what is practically none, given that it acts [1].
    size: at the fit.   stands_for: why its parameters are not physical; empty where they are.
    """

    in_model: float
    material: float
    size: Size
    stands_for: str

    @property
    def probability(self) -> float:
        """Probability of a cause [1]."""
        return 0.0 if self.stands_for else self.in_model * self.material

    @property
    def reason(self) -> str:
        """Why it is a minor finding."""
        if self.stands_for:
            return self.stands_for
        return "immaterial" if self.material < self.in_model else f"not sure, {self.in_model:.2g}"


def causes_of(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    held_out: Sequence[FlightResiduals],
    held: HeldOut,
    *,
    gusty: bool = False,
) -> tuple[list[Cause], list[Finding]]:
    """Return causes and minor findings of the best model.

    Args:
        ranking: of the models.
        linear, structure: the best model linear about its fit, and the generic structure beside it.
        held_out, held: the held-out flights, and the fit on them; they give onsets and sizes there.
        gusty: gusts blow. The drag that feels them matters however small it is by itself.
    """
    fit, flights, options = ranking.best, ranking.problem.flights, ranking.options
    same = _same(ranking)
    causes, minor = [], []
    for i, term in enumerate(fit.terms):
        identifier = term.effect.identifier
        known = same.get(identifier, ())
        blown = gusty and identifier == DRAG
        judged = judge(ranking, linear, structure, i, known, held_out, held, blown=blown)
        if blown:
            judged = dc.replace(judged, material=1.0, stands_for="")
        begins = {
            e.name: held.terms.get(e.name, fit.everything)[i].begins(e.name) for e in [*flights, *held_out]
        }
        cause = Cause(
            identifier,
            judged.probability,
            _estimates(fit, i, options.priors),
            begins,
            same.get(identifier, ()),
            judged.size.gap,
            term.effect,
        )
        if cause.probability >= options.thresholds.sure:
            causes.append(cause)
        else:
            minor.append(_minor(cause, judged))
    return without_missing_drag(causes, minor)


def judge(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    i: int,
    same: Sequence[str],
    held_out: Sequence[FlightResiduals],
    held: HeldOut,
    *,
    blown: bool = False,
) -> Judged:
    """Judge term i of the best model.

    Args:
        ranking, linear, structure, held_out, held: as in `causes_of`.
        i: position of the term.
        same: effects that cannot be told from it, whose probability is added.
        blown: gusts blow and bring this drag, so that its prior is that of gusts against what the library lacks.
    """
    fit, flights, options = ranking.best, ranking.problem.flights, ranking.options
    effect, tolerance = fit.terms[i].effect, options.tolerance
    named = min(1.0, sum(ranking.probability.get(name, 0.0) for name in (effect.identifier, *same)))
    priors = options.priors
    brought = priors.wind_over_unknown - priors.of_effect(DRAG) if blown else 0.0
    in_model = named * float(special.expit(linear.margin(i, structure) + brought))
    size = size_of(fit, i, flights, ranking.noise, tolerance, [(e, held.terms[e.name]) for e in held_out])
    material = material_share(
        size,
        relative_sizes(fit, i, flights),
        options.materiality,
        calibration=within_calibration(fit.terms[i], options),
        sensor=tolerance.of(effect.identifier) > 0,
    )
    material *= wind_share(fit, i, options.materiality.still_air)
    shift = abs(effect.time_shift(flights[0].vehicle))
    if 0 < shift < options.materiality.sensor * tolerance.timing:
        material = 0.0
    return Judged(in_model, material, size, impossible(fit, i, flights[0].vehicle, options.thresholds))


def _same(ranking: Ranking) -> Mapping[str, tuple[str, ...]]:
    members = {names_of(ranking.problem, m): m for m in reversed(ranking.models)}
    key = names_of_fit(ranking.best)
    return indistinguishable(ranking.problem, members[key]) if key in members else {}


def _estimates(fit: Fit, i: int, priors: Priors) -> dict[str, Estimate]:
    """Return the parameters of term i with 95 % intervals; payloads, which are no ideal pendulums, with their error."""
    term = fit.terms[i]
    out = {}
    for p in term.effect.parameters:
        value, (lower, upper) = float(getattr(term.effect, p.name)), interval(fit, i, p.name)
        half = 0.5 * (upper - lower)
        if term.swings:
            half = float(np.hypot(half, 1.96 * pendulum_error(p.name, value, priors)))
        out[p.name] = Estimate(value, p.unit, (value - half, value + half))
    return out


def _minor(cause: Cause, judged: Judged) -> Finding:
    """Return the finding of an effect that is no cause, with the reason."""
    size = judged.size
    values = ", ".join(f"{n} {e.value:.3g} {e.unit}" for n, e in cause.parameters.items())
    text = (
        f"{values}: {judged.reason} ({100 * size.force:.2g} % of weight, {100 * size.torque:.2g} % of torque)"
    )
    figures = {"force": size.force, "torque": size.torque, "probability": judged.probability}
    return Finding(cause.identifier, text, size.gap, figures)


def without_missing_drag(causes: list[Cause], minor: list[Finding]) -> tuple[list[Cause], list[Finding]]:
    """Return causes and minor findings with winds moved to the latter where no drag is a cause."""
    named = {c.identifier for c in causes}
    unfelt = [c for c in causes if c.effect and c.effect.needs and not named & {*c.effect.needs}]
    texts = [Finding(c.identifier, "no cause through which it would be felt", c.share, {}) for c in unfelt]
    return [c for c in causes if c not in unfelt], [*minor, *texts]
