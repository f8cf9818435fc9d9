"""The onset that whoever knows the effect itself would read from a flight: what no diagnosis can be asked to beat."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.forward_model.prediction import gate, predicted_residual
from np_drake.diagnosis.forward_model.term import Term
from np_drake.diagnosis.numerics.autoregressive_noise import NoiseModel
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals

AROUND = 4.0  # of the true onset, in which others are weighed [s]
SPAN = 0.4  # that is to hold the onset as likely as may be: twice the tolerance of the score [s]


def best_onset(
    exact: FlightResiduals, errors: np.ndarray, terms: Sequence[Term], onset: float, noise: NoiseModel
) -> float:
    """The middle of the span of `SPAN` that most likely holds the onset [s], each instant about it alike before.

    Args:
        exact, errors: a flight without noise, (m, 15) what noise adds to its channels.
        terms: the true effects with the true onset [s].   noise: model of `errors`.
    """
    t, name = exact.t, exact.name
    begun = predicted_residual(exact, terms)
    always = predicted_residual(exact, [dc.replace(term, onset={**term.onset, name: None}) for term in terms])
    tried = np.flatnonzero(np.abs(t - onset) <= AROUND)
    cost = [
        float(np.sum(noise.whiten(errors + begun - _from(t, k, onset, begun, always)) ** 2)) for k in t[tried]
    ]
    likely = np.exp(-0.5 * (np.array(cost) - min(cost)))
    width = min(len(likely), max(1, round(SPAN / exact.grid.step)))
    first = int(np.argmax(np.convolve(likely, np.ones(width), "valid")))
    within = np.cumsum(likely[first : first + width])
    return float(t[tried[first + np.searchsorted(within, 0.5 * within[-1])]])


def _from(t: np.ndarray, k: float, onset: float, begun: np.ndarray, always: np.ndarray) -> np.ndarray:
    """(m, 15) the trace if it began at k: as it is where it has begun, as from the start before that."""
    return gate(t, k) * np.where(gate(t, onset) > 0, begun, always)
