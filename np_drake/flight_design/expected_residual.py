"""What explanations expect to see in a flight: whitened predicted residuals, and how far parameters move them."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.fitting import Free, scaled_jacobian
from np_drake.diagnosis.fitting.parameters import free_parameters
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.numerics import Readings
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import sensor_drift
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.explanation import CALIBRATION, Explanation
from np_drake.flight_design.information import Information


def expected_information(
    flight: FlightResiduals, explanations: Sequence[Explanation], readings: Readings
) -> Information:
    """Return what a flight can tell about the explanations, by the columns of the residual model.

    Args:
        flight: residuals of the flight, of which the motion and the commands count, not the readings `y`.
        explanations: that stand, each linear about its values, with its posterior as the prior of the flight.
        readings: noise that whitens, and tolerances of the sensors, whose errors are new in every flight.
    """
    return seen_in(flight, explanations, readings)[0]


def seen_in(
    flight: FlightResiduals, explanations: Sequence[Explanation], readings: Readings
) -> tuple[Information, np.ndarray]:
    """Return `expected_information` and the products (K,) of its columns with the readings of the flight."""
    options = Options.for_sensors(readings.tolerance.real, readings.tolerance)
    means, spreads = [], []
    for explanation in explanations:
        mean, spread = expected_residual(flight, explanation, options)
        means.append(mean[..., None])
        spreads.append(spread)
    drift = sensor_drift([flight], readings.tolerance)
    drifting = np.zeros((*flight.y.shape, 0)) if drift is None else drift.columns[flight.name]
    columns = [*means, *spreads, drifting, flight.y[..., None]]
    gram = readings.noise.products([flight.bridged(X) for X in columns], flight.name)
    gram = gram / options.priors.temperature
    sizes = tuple(spread.shape[-1] for spread in spreads)
    prior = np.array([e.probability for e in explanations])
    return Information(gram[:-1, :-1], sizes, prior / prior.sum()), gram[:-1, -1]


def separation(
    flight: FlightResiduals, explanations: Sequence[Explanation], readings: Readings, pair: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return times (m,) [s] and how the distance of a pair of explanations grows over a flight, (m,) [nat].

    It is that part of the difference which no change of the parameters of either, and no sensor error, mimics; the
    parts of the prior are left out.
    """
    options = Options.for_sensors(readings.tolerance.real, readings.tolerance)
    (mean, spread), (other, others) = (expected_residual(flight, explanations[k], options) for k in pair)
    drift = sensor_drift([flight], readings.tolerance)
    columns = [(mean - other)[..., None], spread / np.sqrt(2), others / np.sqrt(2)]
    columns += [] if drift is None else [drift.columns[flight.name]]
    white = flight.white(readings.noise, np.concatenate(columns, axis=-1)) / np.sqrt(
        options.priors.temperature
    )
    d, M = white[..., 0], white[..., 1:]
    flat = M.reshape(d.size, M.shape[-1])
    mimicked = np.linalg.solve(np.eye(M.shape[-1]) + flat.T @ flat, flat.T @ d.ravel())
    growth = np.cumsum(np.sum((d - M @ mimicked) ** 2, axis=1)) / 8
    return flight.t[-len(growth) :], growth


def expected_residual(
    flight: FlightResiduals, explanation: Explanation, options: Options
) -> tuple[np.ndarray, np.ndarray]:
    """Return the predicted residual (m, 15) of an explanation, and its change (m, 15, k).

    The change is by each of k independent standard normal deviations of parameters and hidden states.
    """
    terms = [Term(effect) for effect in (*explanation.effects, *explanation.calibration)]
    free = free_parameters(terms, [flight], {}, options.priors)
    names = [_name(f, terms, len(explanation.effects)) for f in free]
    deviation = np.sqrt(np.maximum(np.diag(explanation.covariance), 1e-300))
    known = {name: k for k, name in enumerate(explanation.parameters)}
    own = [
        dc.replace(f, scale=float(deviation[known[name]]))
        for f, name in zip(free, names, strict=True)
        if name in known
    ]
    order = [known[name] for name in names if name in known]
    hidden = [f for f in free if f.flight]
    J = scaled_jacobian(terms, [*own, *hidden], flight)
    correlation = (explanation.covariance / np.outer(deviation, deviation))[np.ix_(order, order)]
    spread = np.concatenate([J[..., : len(own)] @ _root(correlation), J[..., len(own) :]], axis=-1)
    return predicted_residual(flight, terms), spread


def _name(f: Free, terms: Sequence[Term], effects: int) -> str:
    """Return the name of a free parameter as an explanation has it; empty for a hidden state."""
    if f.flight:
        return ""
    return f"{CALIBRATION if f.term >= effects else ''}{terms[f.term].effect.identifier}.{f.name}"


def _root(correlation: np.ndarray) -> np.ndarray:
    """Return R with R R^T = correlation, also where it is singular."""
    if not len(correlation):
        return correlation
    value, vector = np.linalg.eigh(correlation)
    return vector * np.sqrt(np.maximum(value, 0.0))
