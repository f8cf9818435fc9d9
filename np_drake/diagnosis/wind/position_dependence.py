"""Test of a slow force for dependence on position, which gusts do not have."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import linalg, stats

from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.wind.gauss_markov import (
    Begins,
    WindForce,
    binned,
    drags,
    factor,
    forces,
    spans,
    width,
    wind_force,
)
from np_drake.rigid_body import P


def position_p_value(
    flights: Sequence[FlightResiduals], residual: Mapping[str, np.ndarray], begins: Begins
) -> float:
    """Return the probability that gusts follow the position as much as this force does [1].

    Args:
        residual: by flight, (m, 15) what a model leaves of it.
        begins: by flight, when the wind begins [s]; None: from the start.
    Source: likelihood ratio of a level force that is quadratic in the position beside gusts, a mean
        in each span and a
    drag, under the gusts' covariance, as strong in each flight as they are there.
    """
    wind = wind_force(flights, residual, begins)
    x = np.concatenate([e.rows.x[:, P] for e in flights])
    middle, size = x.mean(axis=0), x.std(axis=0) + 1e-9  # [m], for a height that is kept
    first, second = np.triu_indices(3)
    white = []
    for e in flights:
        at = np.stack([np.interp(e.t, e.rows.t, axis) for axis in e.rows.x[:, P].T], axis=1)
        place = (at - middle) / size
        dragged = np.hstack([*np.moveaxis(drags(e)[:, :2], 1, 0)])
        level = np.hstack(
            [
                forces(e, residual[e.name])[:, :2],
                dragged,
                binned(e, place),
                binned(e, place[:, first] * place[:, second]),
            ]
        )
        pieces = [_about_its_mean(p, width(e), wind) for p in spans(e, level, begins.get(e.name))]
        if pieces:
            own = np.concatenate(pieces)
            white.append(own / np.sqrt(np.mean(own[:, :2] ** 2)))
    if not white:
        return 1.0
    force, drag_x, drag_y, place = np.split(np.concatenate(white), [2, 5, 8], axis=1)
    less = linalg.orth(np.vstack([drag_x, drag_y]))
    more = linalg.orth(np.hstack([np.vstack([drag_x, drag_y]), linalg.block_diag(place, place)]))
    both = force.T.ravel()
    # Likelihood ratio: the power that the position explains beside the drag, by projection on both
    # column spaces.
    gain = np.sum((more.T @ both) ** 2) - np.sum((less.T @ both) ** 2)
    return float(stats.chi2.sf(gain, more.shape[1] - less.shape[1]))


def _about_its_mean(span: np.ndarray, width: float, wind: WindForce) -> np.ndarray:
    """Return (k, a) columns whitened, without what is constant before it was."""
    root = factor(len(span), width, *wind.figures)
    white = linalg.solve_triangular(root, np.column_stack([span, np.ones(len(span))]), lower=True)
    one = white[:, -1:]
    return white[:, :-1] - one @ (one.T @ white[:, :-1]) / np.sum(one**2)
