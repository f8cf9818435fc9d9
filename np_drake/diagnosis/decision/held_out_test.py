"""Log evidence of a term on held-out flights."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.fitting import Fit
from np_drake.diagnosis.forward_model import NEVER, Term, predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Priors, Thresholds
from np_drake.diagnosis.regressors import Drift, loss_on
from np_drake.diagnosis.residuals import FlightResiduals


def log_bayes_factor(
    fit: Fit,
    i: int,
    flights: Sequence[FlightResiduals],
    noise: NoiseModel,
    held: HeldOut,
    drift: Drift,
    priors: Priors,
) -> float:
    """Return the log Bayes factor of term i on held-out flights, their sensor errors marginalised.

    What acts throughout the flights of the fit, but not in one of these, must bring there what its onset had to.
    """
    brought = sum(
        _log_bayes_factor_on(held.whole_flight_terms[e.name], i, e, noise, held.rows[e.name], drift)
        for e in flights
    )
    late = sum(held.terms[e.name][i].begins(e.name) is not None for e in flights)
    return brought if set(fit.terms[i].onset.values()) - {None} else brought - priors.new_onset_gain * late


def _log_bayes_factor_on(
    terms: Sequence[Term], i: int, e: FlightResiduals, noise: NoiseModel, rows: np.ndarray, drift: Drift
) -> float:
    """Log evidence that terms[i] brings to the others on these rows (m,) of a flight."""
    if terms[i].begins(e.name) == NEVER:
        return 0.0
    without = e.y - predicted_residual(e, [t for j, t in enumerate(terms) if j != i])
    losses = [loss_on(e, r, noise, rows, drift) for r in (without, e.y - predicted_residual(e, terms))]
    return 0.5 * (losses[0] - losses[1])


def least_log_bayes_factor(
    fit: Fit,
    i: int,
    flights: Sequence[FlightResiduals],
    noise: NoiseModel,
    drift: Drift,
    thresholds: Thresholds,
) -> float:
    """Return the log Bayes factor on held-out flights below which term i is not confirmed.

    Where a flight does not excite an effect, its columns are the noise of what is measured, and it explains nothing
    there: that may cost a share of what the term brings to the flights of the fit.
    """
    brought = sum(
        _log_bayes_factor_on(fit.everything, i, e, noise, np.ones(len(e.t), bool), drift) for e in flights
    )
    return -(thresholds.hurt + thresholds.hurt_share * max(brought, 0.0))
