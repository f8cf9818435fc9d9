"""Inference from one set of training flights: which effects are causes, and what they leave on all
flights.

Training flights alone give the model; held-out flights judge it. In the words of Bayesian model
selection:

1. search: the set of effects with the largest evidence, and its maximum a posteriori fit
   (`find_map_model`);
2. rank: rival sets, all parameters of each refined, and the probability of every effect
   (`rank_models`);
3. hold out: the best fit on flights that it has not seen, its parameters kept (`on_held_out`);
4. structure: what no effect of the library explains, as generic structure
   (`LinearModel.select_structure`) and as signs in the residual (`find_unexplained`);
5. decide: an effect is a cause where its probability of acting and of being material is large
   enough (`causes_of`).

A slow level force that sensors alone do not make is either that of gusts, which act through a drag,
or unknown.
"""

import dataclasses as dc
from collections.abc import Sequence
from functools import cached_property

from np_drake.diagnosis.decision.causes import causes_of, estimates
from np_drake.diagnosis.decision.remainder import measure_remainder
from np_drake.diagnosis.decision.unexplained import PLACE, Indication, LinearModel, find_unexplained
from np_drake.diagnosis.fitting import fit_of_some
from np_drake.diagnosis.gusts import in_gusts, residuals_of, with_drag, with_gusts
from np_drake.diagnosis.held_out import HeldOut, mark_outliers, on_held_out, with_calibration
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Finding, Remainder
from np_drake.diagnosis.selection import Ranking, rank_models
from np_drake.diagnosis.slow_force import position_p_value
from np_drake.effects.gusty_wind import GustyWind


@dc.dataclass(frozen=True)
class Inference:
    """Causes and what they leave.

    flights: of the fit, with their outliers marked.   held: the causes on held-out flights.
    """

    flights: Sequence[FlightResiduals]
    ranking: Ranking
    held: HeldOut
    structures: list[Indication]
    slow: Indication
    causes: list[Cause]
    below_threshold: list[Finding]

    @cached_property
    def left(self) -> Remainder:
        """What the causes leave of the held-out gap."""
        said, ranking = [*self.structures, self.slow], self.ranking
        return measure_remainder(self.causes, ranking.noise, self.held, said, ranking.options)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Where the remainder lives: what is more probable than not."""
        said = (self.slow, *self.structures)
        return tuple(s.finding for s in said if s.probability > 0.5)


def conclude(found: Ranking, held_out: Sequence[FlightResiduals]) -> Inference:
    """Rank the models of a search, judge the best by held-out flights, and decide which of its
    effects are causes.
    """
    ranking = rank_models(found)
    flights, held = ranking.problem.flights, _held_out(ranking, held_out)
    linear = LinearModel(ranking)
    _, structure = linear.select_structure()
    structures, slow = find_unexplained(ranking, linear, structure, held)
    blown = None
    # The drift of an estimator that nobody measured is neither told from gusts nor from a force
    # tied to a place.
    if slow.probability > 0.5 and not ranking.options.tolerance.unmeasured:
        # Gusts do not depend on position alike in all flights.
        every = [*flights, *(e for e in held.flights if not e.joined.any())]
        p_value = position_p_value(
            every, residuals_of(ranking, held), {e.name: None for e in every}
        )
        if p_value < ranking.options.thresholds.position_p_value:
            slow = slow._replace(finding=PLACE)
        else:
            blown = _in_gusts(ranking, linear, structure, held, slow.probability)
    if blown is None:
        causes, minor = causes_of(ranking, linear, structure, held)
    else:
        ranking, held, causes, minor = blown
        slow = slow._replace(probability=0.0)
    return Inference(flights, ranking, held, structures, slow, causes, minor)


def as_named(found: Inference) -> Inference:
    """Return the inference with its causes fitted as they are named: without the effects that are
    not.

    What is not named gives way to calibration and the causes, which were fitted beside it. A lag or
    delay that the logs leave open is calibration too.
    """
    named, ranking = {c.identifier for c in found.causes}, found.ranking
    vehicle, options = ranking.problem.flights[0].vehicle, ranking.options
    effects = [t.effect for t in ranking.best.terms]
    open_ = frozenset(e.identifier for e in effects if options.within_timing(e, vehicle))
    if not open_ and not named < {e.identifier for e in effects}:
        return found
    fit = fit_of_some(ranking.problem, ranking.best, named | open_, ranking.noise)
    ranking = dc.replace(ranking, fits=(fit, *ranking.fits))
    terms = {t.effect.identifier: i for i, t in enumerate(fit.terms)}
    causes = []
    for c in found.causes:
        i = terms[c.identifier]
        own = estimates(fit, i, vehicle, options)
        causes.append(dc.replace(c, parameters=own, effect=fit.terms[i].effect))
    held = dc.replace(_held_out(ranking, found.held.flights), calibrations=open_)
    return dc.replace(found, ranking=ranking, held=held, causes=causes)


def _held_out(ranking: Ranking, held_out: Sequence[FlightResiduals]) -> HeldOut:
    """Return the best fit on held-out flights, calibrated and with their outliers marked."""
    best, noise, options = ranking.best, ranking.noise, ranking.options
    own = [with_calibration(best, e, noise, options) for e in held_out]
    marked = [mark_outliers(best.terms, e, noise, options.priors, best.calibration) for e in own]
    return on_held_out(best, marked, noise, options)


def _in_gusts(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    held: HeldOut,
    probability: float,
) -> tuple[Ranking, HeldOut, list[Cause], list[Finding]] | None:
    """Return ranking, held-out flights and causes with gusts of this probability as the slow force;
    None where it can be no wind.
    """
    if (with_one := with_drag(ranking)) is not ranking:
        ranking, linear = with_one, LinearModel(with_one)
    held = on_held_out(ranking.best, held.flights, ranking.noise, ranking.options)
    causes, minor = causes_of(ranking, linear, structure, held, gusts=True)
    causes = with_gusts(ranking, held, causes, probability)
    if not any(c.identifier == GustyWind.identifier for c in causes):
        return None
    return ranking, in_gusts(held, causes), causes, minor
