"""Isotropic prior: parameters that the flights hardly determine, with a prior as wide as those of the same vector."""

import dataclasses as dc

import numpy as np

from np_drake.diagnosis.fitting.map_estimate import Fit
from np_drake.diagnosis.fitting.parameters import write
from np_drake.diagnosis.options import Priors


def with_isotropic_prior(fit: Fit, priors: Priors) -> Fit:
    """Return the fit with priors of `isotropic` effects as wide as their well-determined parameters are large.

    The search does not know how large an effect is, and its priors are wide. Where an axis is hardly excited, its
    parameter is noise as large as that prior. The log evidence stays that of the search.

    Source: conditioning of the posterior on one more observation of each such parameter: its neutral value.
    """
    values, covariance = fit.values.copy(), fit.covariance.copy()
    for i in (i for i, t in enumerate(fit.terms) if t.effect.isotropic):
        own = [k for k, f in enumerate(fit.free) if f.term == i and not f.flight]
        away = np.abs([values[k] - fit.free[k].neutral for k in own])
        told = away > priors.isotropic_deviations * np.sqrt(np.diag(covariance)[own])
        size = float(np.sqrt(np.mean(away[told] ** 2))) if told.any() else np.inf
        for k in (k for k, known in zip(own, told, strict=True) if not known and size < fit.free[k].scale):
            more = 1.0 / (size**-2 - fit.free[k].scale ** -2)
            gain = covariance[:, k] / (covariance[k, k] + more)
            values = values + gain * (fit.free[k].neutral - values[k])
            covariance = covariance - np.outer(gain, covariance[k])
    everything = write(fit.everything, list(fit.free), values)
    n = len(fit.terms)
    return dc.replace(
        fit,
        terms=tuple(everything[:n]),
        calibration=tuple(everything[n:]),
        values=values,
        covariance=covariance,
    )
