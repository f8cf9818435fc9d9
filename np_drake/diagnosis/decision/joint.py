"""Joint posterior of the parameters of all causes."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.fitting import Fit
from np_drake.diagnosis.result import Cause
from np_drake.effects.posterior import Posterior


def joint_posterior(fit: Fit, causes: Sequence[Cause]) -> Posterior:
    """Return the covariance of the causes' parameters: correlations of the fit, deviations of the reported intervals.

    A parameter that the fit does not move, such as the number of a rotor, is not among them.
    """
    reported = {
        (c.identifier, name): (estimate.ci95[1] - estimate.ci95[0]) / (2 * 1.96)
        for c in causes
        for name, estimate in c.parameters.items()
    }
    names = [
        (fit.terms[f.term].effect.identifier if not f.flight and f.term < len(fit.terms) else "", f.name)
        for f in fit.free
    ]
    own = [k for k, name in enumerate(names) if reported.get(name, 0.0) > 0]
    scale = np.sqrt(np.maximum(np.diag(fit.covariance)[own], 1e-300))
    deviation = np.array([reported[names[k]] for k in own])
    covariance = fit.covariance[np.ix_(own, own)] * np.outer(deviation / scale, deviation / scale)
    return Posterior([".".join(names[k]) for k in own], (0.5 * (covariance + covariance.T)).tolist()).check()
