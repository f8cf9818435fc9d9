"""Information of a flight about explanations, from the inner products of whitened columns alone.

Under explanation i the whitened residual is y = r_i + A_i z + D s + n with z, s and n standard
normal: its predicted residual r_i, how its parameters move that (A_i), and sensor errors (D) that
every explanation has. So y is normal with mean r_i and covariance S_i = 1 + A_i A_i^T + D D^T, of
which all that follows needs only C^T C, C = [r, A, D].
"""

import dataclasses as dc
from functools import cached_property
from itertools import combinations

import numpy as np

from np_drake.effects.explanation import STANDS

DRAWS = 400  # of each explanation; own choice
SEED = 1


@dc.dataclass(frozen=True)
class Outlook:
    """What is expected of a flight, by draws.

    entropy: expected posterior entropy over the explanations [nat].
    named: probability that only one stands afterwards, the right one [1].
    each: (n,) the same if explanation i is the true one [1].
    """

    entropy: float
    named: float
    each: tuple[float, ...]

    @property
    def worst(self) -> float:
        """Probability that only the right one stands, whichever explanation is true, at least
        [1].
        """
        return min(self.each)


@dc.dataclass(frozen=True)
class Information:
    """Inner products (K, K) of the whitened columns C = [r_1 … r_n, A_1 … A_n, D].

    sizes: (n,) columns of each A_i.   prior: (n,) probability of each explanation [1].
    """

    gram: np.ndarray
    sizes: tuple[int, ...]
    prior: np.ndarray

    def spread(self, i: int) -> np.ndarray:
        """Return the positions of A_i."""
        start = len(self.sizes) + sum(self.sizes[:i])
        return np.arange(start, start + self.sizes[i])

    @property
    def drift(self) -> np.ndarray:
        """Positions of D."""
        return np.arange(len(self.sizes) + sum(self.sizes), len(self.gram))

    @cached_property
    def distances(self) -> np.ndarray:
        """(n, n) Bhattacharyya distance of each pair [nat]; 0: they expect the same.

        The probability to name the wrong one of a pair that is as probable is at most
        exp(-distance) / 2.
        Source: Kailath, T.: The divergence and Bhattacharyya distance measures in signal selection,
            1967.
        """
        n = len(self.sizes)
        out = np.zeros((n, n))
        for i, j in combinations(range(n), 2):
            out[i, j] = out[j, i] = self._distance(i, j)
        return out

    def _distance(self, i: int, j: int) -> float:
        """Return 1/8 d^T S^-1 d + 1/2 ln(|S| / sqrt(|S_i| |S_j|)), S the mean of the covariances
        S_i and S_j.
        """
        own = [self.spread(i), self.spread(j), self.drift]
        columns = np.concatenate(own)
        scale = np.repeat([np.sqrt(0.5), np.sqrt(0.5), 1.0], [len(part) for part in own])
        M = self.gram[np.ix_(columns, columns)] * np.outer(scale, scale) + np.eye(len(columns))
        b = (self.gram[columns, i] - self.gram[columns, j]) * scale
        square = self.gram[i, i] - 2 * self.gram[i, j] + self.gram[j, j]
        # Woodbury's identity and the determinant lemma: S^-1 and |S| from M, a matrix of a few
        # columns.
        apart = square - b @ np.linalg.solve(M, b)
        volume = _logdet(M) - 0.5 * (self._volume(i) + self._volume(j))
        return float(max(0.0, 0.125 * apart + 0.5 * volume))

    def _volume(self, i: int) -> float:
        """Return ln |S_i|."""
        return _logdet(self._posterior_precision(i))

    def _posterior_precision(self, i: int) -> np.ndarray:
        columns = np.concatenate([self.spread(i), self.drift])
        return np.eye(len(columns)) + self.gram[np.ix_(columns, columns)]

    def posterior(self, i: int) -> np.ndarray:
        """Return the covariance (k_i, k_i) of z under explanation i after the flight; before it is
        1.
        """
        return np.linalg.inv(self._posterior_precision(i))[: self.sizes[i], : self.sizes[i]]

    def parameters(self, i: int) -> float:
        """Return the information about the parameters of explanation i: 1/2 ln of prior over
        posterior volume [nat].

        Source: Fisher information of the linear model, sensor errors marginalised.
        """
        rest = np.eye(len(self.drift)) + self.gram[np.ix_(self.drift, self.drift)]
        return 0.5 * (self._volume(i) - _logdet(rest))

    @property
    def weakest(self) -> tuple[int, int] | None:
        """Pair of explanations that is told apart the least; None of a single one."""
        n = len(self.sizes)
        return min(combinations(range(n), 2), key=lambda ij: self.distances[ij], default=None)

    def log_posterior(self, seen: np.ndarray) -> np.ndarray:
        """Return the log probability (..., n) of the explanations.

        seen: (..., K) products C^T y of the columns with the whitened readings y of a flight.
        """
        scores = []
        for j in range(len(self.sizes)):
            columns = np.concatenate([self.spread(j), self.drift])
            M = self._posterior_precision(j)
            b = seen[..., columns] - self.gram[columns, j]
            fitted = np.sum(b * np.linalg.solve(M, b[..., None])[..., 0], axis=-1)
            misfit = -2 * seen[..., j] + self.gram[j, j] - fitted
            scores.append(-0.5 * (misfit + _logdet(M)) + np.log(max(self.prior[j], 1e-300)))
        score = np.stack(scores, axis=-1)
        return score - np.logaddexp.reduce(score, axis=-1, keepdims=True)

    @cached_property
    def outlook(self) -> Outlook:
        """What is expected of the flight, over draws of explanation, parameters and noise."""
        rng = np.random.default_rng(SEED)
        root = square_root(self.gram)
        entropy, each = 0.0, list[float]()
        for i, p in enumerate(self.prior):
            columns = np.concatenate([self.spread(i), self.drift])
            moved = rng.standard_normal((DRAWS, len(columns))) @ self.gram[columns]
            noise = rng.standard_normal((DRAWS, len(root))) @ root.T
            log_p = self.log_posterior(self.gram[i] + moved + noise)
            entropy -= p * float(np.mean(np.sum(np.exp(log_p) * log_p, axis=1)))
            others = np.delete(log_p, i, axis=1).max(axis=1, initial=-np.inf)
            each.append(float(np.mean(log_p[:, i] - others > np.log(STANDS))))
        return Outlook(float(entropy), float(self.prior @ each), tuple(each))


def square_root(C: np.ndarray) -> np.ndarray:
    """Return R with R R^T = C (k, k), by eigenvalues, so that C may be singular."""
    value, vector = np.linalg.eigh(C) if len(C) else (np.zeros(0), C)
    return vector * np.sqrt(np.maximum(value, 0.0))


def _logdet(M: np.ndarray) -> float:
    return float(np.linalg.slogdet(M)[1])
