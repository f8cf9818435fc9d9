"""Causes and minor findings of a ranking of models."""

from collections.abc import Sequence

from np_drake.diagnosis.decision.cause_report import make_cause, minor_finding
from np_drake.diagnosis.decision.consistency import without_faint_shifts, without_missing_drag
from np_drake.diagnosis.decision.equivalence import indistinguishable
from np_drake.diagnosis.decision.inclusion import judge
from np_drake.diagnosis.fitting import Fit
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.regressors import drift_of
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Finding
from np_drake.diagnosis.selection import Ranking, calibrated_probability, names_of, names_of_fit


def causes_of(
    ranking: Ranking,
    fit: Fit,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    held: HeldOut,
    *,
    gusty: bool = False,
) -> tuple[list[Cause], list[Finding]]:
    """Return causes and minor findings of a fit; a cause is material and helps on held-out flights.

    gusty: gusts were felt. Then the drag that feels them matters however small it is by itself, may lie at its bound,
    and neither it nor the wind must help on held-out flights, where it blew otherwise.
    """
    members = {names_of(ranking.named_problem, m): m for m in reversed(ranking.named_models)}
    key = names_of_fit(ranking.named)
    same = indistinguishable(ranking.named_problem, members[key]) if key in members else {}
    drift = drift_of([*flights, *held_out], ranking.noise, ranking.options.tolerance)
    causes, minor = [], []
    for i, term in enumerate(fit.terms):
        alternatives = same.get(term.effect.identifier, ())
        probability = calibrated_probability(
            ranking.probability, (term.effect.identifier, *alternatives), ranking.options.thresholds
        )
        verdict = judge(ranking, fit, i, probability, flights, held_out, held, drift, gusty=gusty)
        cause = make_cause(
            fit,
            i,
            probability,
            verdict.size.gap,
            {e.name: held.terms.get(e.name, fit.everything)[i].begins(e.name) for e in [*flights, *held_out]},
            alternatives,
            priors=ranking.options.priors,
        )
        if verdict.included:
            causes.append(cause)
        else:
            minor.append(minor_finding(cause, verdict))
    share = ranking.options.materiality.time_shift_share
    return without_faint_shifts(*without_missing_drag(causes, minor), share)
