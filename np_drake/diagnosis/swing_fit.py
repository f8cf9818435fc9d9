"""Fit of a payload's swing on some rows of a flight, its parameters being known: a grid of starts
and Gauss-Newton.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
import scipy

from np_drake.diagnosis.forward_model import (
    NEVER,
    Term,
    hidden_size,
    padded,
    predicted_residual,
    swing_units,
    swing_wrenches,
)
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.estimation.noise import NoiseModel

# difference quotients: of a swing [rad], of a length, relative [1], of a damping [1/s]
SMALL = 0.02
WIDEST = 1.2  # swing [rad], and with the natural rate its rate, that a guess may have
DESCENT_STEPS = 3  # Gauss-Newton iterations
GRID = 128  # swings in the grid of starts; own choice
TRIED = 3  # best grid points from which to descend, besides the given swing; own choice
WAYS = 32  # posterior samples of a swing, whose mean prediction is used; own choice
SPANS = (4.0, 8.0)  # growing lengths of a flight over which its swing is fitted [s]


class SwingFit:
    """Whitened misfit of term i on `rows` (m,) of a flight as a function of its swing there.

    The term is a payload that begins at `onset`. A swing (size,) holds angles [rad] and rates
    [rad/s] at the start, and jumps at outliers (`hidden_size`).

    Args:
        terms: terms of a model, with their onsets and hidden states.
        onset: time at which the payload begins [s]; None: from the start.
        rows: (m,) bool, rows that count.
    Source: nonlinear least squares from a grid; the grid is own choice.
    """

    def __init__(
        self,
        terms: Sequence[Term],
        i: int,
        flight: FlightResiduals,
        noise: NoiseModel,
        onset: float | None,
        rows: np.ndarray,
        priors: Priors,
    ):
        self._term = dc.replace(terms[i], onset={**terms[i].onset, flight.name: onset})
        order = noise.phi.shape[1]
        indices = np.flatnonzero(rows)
        first, last = (indices[0], indices[-1]) if len(indices) else (0, 0)
        begin = max(first - order, 0)
        self._raw = slice(begin, max(last + 1, begin + order))
        self._scored = rows[self._raw][order:]
        self._flight = flight.head(self._raw.stop)
        self._noise = noise
        others = predicted_residual(self._flight, [*terms[:i], *terms[i + 1 :]])
        self._target = self._white(self._flight.y - others)
        self.size = hidden_size(flight, onset)
        rate = np.sqrt(flight.vehicle.gravity / terms[i].effect.payload.length)  # type: ignore[attr-defined]
        unit = swing_units(self.size, rate)
        self._prior = priors.swing * unit
        self._limit = WIDEST * unit

    @property
    def known(self) -> np.ndarray:
        """(size,) swing of the term as given."""
        return padded(self._term.hidden.get(self._flight.name), self.size)

    def term(self, swing: np.ndarray) -> Term:
        """Return the payload with this swing (size,) alone."""
        return dc.replace(self._term, hidden={self._flight.name: swing})

    def costs(self, swings: np.ndarray) -> np.ndarray:
        """Return the whitened squares plus prior (k,) of swings (k, size)."""
        return np.sum(self._misses(swings) ** 2, axis=1) + np.sum(
            (swings / self._prior) ** 2, axis=1
        )

    def descend_from_grid(self, swing: np.ndarray, free: slice) -> np.ndarray:
        """Return the best swing (size,) after descents from `swing` and from the best points of a
        grid about it.

        Args:
            swing: (size,) centre of the grid.
        """
        start = np.arange(self.size)[free]
        grid = np.tile(swing, (GRID, 1))
        grid[:, start] += self._limit[start] * (
            2 * scipy.stats.qmc.Halton(len(start), scramble=False).random(GRID) - 1
        )
        promising = grid[np.argsort(self.costs(grid))[:TRIED]]
        ends = np.array([self.descend(s, free) for s in (swing, *promising)])
        return ends[np.argmin(self.costs(ends))]

    def descend(self, swing: np.ndarray, free: slice = slice(None)) -> np.ndarray:
        """Return the best swing (size,) on the path of Gauss-Newton in the free entries.

        Args:
            swing: (size,) to begin with.
        """
        best = swing
        least = np.inf
        for _ in range(DESCENT_STEPS + 1):
            miss, X, A = self._normal(swing, free)
            cost = float(miss @ miss + np.sum((swing / self._prior) ** 2))
            if cost < least:
                best = swing
                least = cost
            # Gauss-Newton on the normal equations A step = X'miss - prior, clipped to swings that
            # are possible.
            step = np.linalg.solve(A, X.T @ miss - swing[free] / self._prior[free] ** 2)
            swing = np.clip(swing + step @ np.eye(self.size)[free], -self._limit, self._limit)
        return best

    def posterior_swings(self, free: slice) -> np.ndarray:
        """Return deviations (`WAYS`, size) from the term's own swing, quasi-random draws of its
        posterior.

        Source: Laplace approximation.
        """
        covariance = np.linalg.inv(self._normal(self.known, free)[2])
        normal = scipy.stats.qmc.MultivariateNormalQMC(
            np.zeros(len(covariance)), covariance, rng=free.indices(self.size)[0]
        )
        return normal.random(WAYS) @ np.eye(self.size)[free]

    def _normal(self, swing: np.ndarray, free: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return misfits (n,), their negative derivatives (n, f) by the free entries, and the
        normal matrix (f, f).
        """
        moved = np.eye(self.size)[free]
        miss, *shifted = self._misses(
            swing + SMALL * np.concatenate([np.zeros((1, self.size)), moved])
        )
        X = (miss - np.array(shifted)).T / SMALL
        return miss, X, X.T @ X + np.diag(self._prior[free] ** -2)

    def _misses(self, swings: np.ndarray) -> np.ndarray:
        """Return the whitened misfits (k, n) of swings (k, size)."""
        wrench = swing_wrenches(self._flight, [self.term(s) for s in swings]) * self._flight.shown
        channels = np.zeros((len(wrench), self._flight.y.shape[1], len(swings)))
        channels[:, WRENCH] = np.moveaxis(wrench, 1, 2)
        return (self._target[..., None] - self._white(channels)).reshape(-1, len(swings)).T

    def _white(self, values: np.ndarray) -> np.ndarray:
        return self._noise.whiten(self._flight.bridged(values)[self._raw], self._flight.name)[
            self._scored
        ]


def fitted_to_whole_flight(
    terms: Sequence[Term], flight: FlightResiduals, noise: NoiseModel, priors: Priors
) -> list[Term]:
    """Return the terms with hidden states, jumps included, that fit the whole flight; they are no
    prediction.

    Args:
        terms: terms of a model, with their onsets and hidden states.
    """
    terms = list(terms)
    for i, term in enumerate(terms):
        begin = term.begins(flight.name)
        if not term.effect.has_hidden_state or begin == NEVER:
            continue
        start = flight.t[0] if begin is None else begin
        full_fit = SwingFit(terms, i, flight, noise, begin, flight.t >= start, priors)
        swing = full_fit.known
        for span in SPANS:
            rows = (flight.t >= start) & (flight.t < start + span)
            swing = SwingFit(terms, i, flight, noise, begin, rows, priors).descend(swing)
        ends = np.array([full_fit.descend(full_fit.known), full_fit.descend(swing)])
        terms[i] = full_fit.term(ends[np.argmin(full_fit.costs(ends))])
    return terms
