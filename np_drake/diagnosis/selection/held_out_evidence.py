"""Held-out evidence of models between which the training flights hardly decide."""

import dataclasses as dc
import math
from collections.abc import Sequence

from scipy.special import logsumexp

from np_drake.diagnosis.fitting import Fit
from np_drake.diagnosis.forward_model import NEVER, Term, predicted_residual
from np_drake.diagnosis.held_out import HeldOut, on_held_out, onset_log_likelihood
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors import Drift, drift_of, loss_on
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection.ranking import Ranking, names_of_fit, of_fits, score_of


def rerank_by_held_out_evidence(ranking: Ranking, held_out: Sequence[FlightResiduals]) -> Ranking:
    """Re-rank near-tied models by adding their held-out log evidence.

    Models within `held_out_margin` of the best are compared, except those that name a strict superset of its effects:
    what fitted flights hardly show would be named for anything that held-out flights show (`adaptive_split`). Skipped
    where any holds a payload, whose swing would be fitted to the held-out flight, or generic structure, which is not
    carried over.   Source: own choice: what a model predicts of held-out flights is evidence like any other.
    """
    best = ranking.fits[0]
    options = ranking.options
    least = score_of(best, options.priors) - options.search.held_out_margin
    near = [f for f in ranking.fits if score_of(f, options.priors) > least]
    close = [f for f in near if f is best or not _names(best) < _names(f)]
    rivals = any(not _names(f) < _names(best) for f in close if f is not best)
    if not rivals or any(f.generic or any(t.swings for t in f.terms) for f in close):
        return ranking
    drift = drift_of(held_out, ranking.noise, options.tolerance)
    said = [sum(_log_evidence(f, e, ranking, drift) for e in held_out) for f in close]
    asked = {id(f): dc.replace(f, held_out_evidence=s - said[0]) for f, s in zip(close, said, strict=True)}
    return of_fits(ranking, [asked.get(id(f), f) for f in ranking.fits])


def _names(fit: Fit) -> set[str]:
    return set(names_of_fit(fit))


def _log_evidence(fit: Fit, e: FlightResiduals, ranking: Ranking, drift: Drift) -> float:
    """Of a held-out flight, but for a constant, whatever its own sensors are off by; tempered as that of the others."""
    noise, options = ranking.noise, ranking.options
    held = on_held_out(fit, [e], noise, options.priors)
    loss = loss_on(e, held.residual[e.name], noise, held.rows[e.name], drift)
    priors = (_onset_prior(held.terms[e.name], at, e, noise, options.priors) for at in _onsets(held, e))
    return -0.5 * loss / ranking.problem.temperature + sum(priors)


def _onsets(held: HeldOut, e: FlightResiduals) -> set[float]:
    """Those that were sought in it, each once (a wind begins with its drag)."""
    return {begin for t in held.terms[e.name] if (begin := t.begins(e.name)) is not None}


def _onset_prior(
    terms: Sequence[Term], at: float, e: FlightResiduals, noise: NoiseModel, priors: Priors
) -> float:
    """Log prior of what begins at this instant, of an instant as wide as its peak; of what does not begin at all."""
    if at == NEVER:
        return priors.absence
    rest = predicted_residual(e, [t for t in terms if t.begins(e.name) != at])
    always = [dc.replace(t, onset={}) if t.begins(e.name) == at else t for t in terms]
    _, profile = onset_log_likelihood(e, noise, e.y - rest, predicted_residual(e, always) - rest)
    inside = profile[1:-1]
    return priors.another_onset + float(logsumexp(inside) - inside.max() - math.log(len(inside)))
