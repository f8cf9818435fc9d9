"""Frequency and damping of an oscillator that a drive excites, refined from a grid of resonances."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import optimize

from np_drake.diagnosis.fitting.map_estimate import Generic
from np_drake.diagnosis.numerics import Gram, NoiseModel
from np_drake.diagnosis.regressors import DAMPING
from np_drake.diagnosis.residuals import FlightResiduals

WITHIN = 1.5  # largest ratio to the frequency from the grid, up or down [1]; own choice
DAMPINGS = (0.005, 1.0)  # bounds of the damping [1]; own choice
STEP = 0.1  # initial step in the logarithm of frequency and damping
EDGE = 1e-3  # distance from a bound in the logarithm, within which a solution lies on it
TRIES = 80  # largest number of evaluations, of about ten milliseconds each


def mode_of(
    generic: Generic,
    flights: Sequence[FlightResiduals],
    residual: Mapping[str, np.ndarray],
    noise: NoiseModel,
) -> tuple[float, float] | None:
    """Return frequency [Hz] and damping [1] of the oscillator s'' + 2 z w s' + w² s = w² drive with the least residual.

    Args:
        generic: the resonance as fitted on a grid.
        flights: the flights of the fit.
        residual: by flight, (m, 15) residual of the whole fit, in which `generic` is explained.
        noise: noise model that whitens.
    Returns: None where no mode lies within the bounds or the search has not converged.
    Source: output error with the gains projected out (Golub and Pereyra 1973, variable projection).
    Raises: ValueError: if the structure is no resonance.
    """
    candidate = generic.candidate
    if candidate.swing is None:
        raise ValueError(f"mode_of: {candidate.identifiers[0]} does not swing.")
    swing = candidate.swing
    target = np.concatenate([e.white(noise, residual[e.name] + generic.part(e)).ravel() for e in flights])

    def misfit(logs: np.ndarray) -> float:
        frequency, damping = np.exp(logs)
        columns = [e.white(noise, swing(frequency, damping, e)) for e in flights]
        X = np.concatenate([part.reshape(-1, part.shape[-1]) for part in columns])
        return -Gram(X.T @ X, X.T @ target, 0.0, len(X)).log_evidence(np.arange(X.shape[1]))

    start = np.log([candidate.figures["frequency"], DAMPING])
    about = start[0] + np.log(WITHIN) * np.array([-1.0, 1.0])
    simplex = start + STEP * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    found = optimize.minimize(
        misfit,
        start,
        method="Nelder-Mead",
        bounds=[tuple(about), tuple(np.log(DAMPINGS))],
        options={"initial_simplex": simplex, "maxfev": TRIES, "xatol": 1e-3, "fatol": 0.05},
    )
    ends = np.array([about, np.log(DAMPINGS)]).T
    inside = np.all(np.abs(found.x - ends) > EDGE)
    frequency, damping = np.exp(found.x)
    return (float(frequency), float(damping)) if found.success and inside else None
