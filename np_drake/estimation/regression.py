"""Bayesian linear regression on the Gram matrices of its columns.

y = X c + n, n white with unit variance, c ~ N(0, 1) for each column, which carries the scale of the
prior. log p(y) = -1/2 (y'y - b' A^-1 b) - 1/2 log det A + const, with A = X'X + 1 and b = X'y.
Source: standard.
"""

import dataclasses as dc
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np
import scipy


def places(sizes: Iterable[int], first: int = 0) -> list[slice]:
    """Return the places of groups of columns that follow one another, from column `first` on."""
    return [slice(*ends) for ends in pairwise(np.cumsum([first, *sizes]).tolist())]


AT_ONCE = 200_000  # matrix entries of the sets that are solved together


@dc.dataclass(frozen=True)
class Gram:
    """Statistics of a regression on which its posterior depends: X'X (k, k) and X'y (k,)."""

    XX: np.ndarray
    Xy: np.ndarray

    def __add__(self, other: "Gram") -> "Gram":
        return Gram(self.XX + other.XX, self.Xy + other.Xy)

    def tempered(self, temperature: float) -> "Gram":
        """Return the statistics as if the noise had `temperature` times its variance."""
        return Gram(self.XX / temperature, self.Xy / temperature)

    def given(self, n: int) -> "Gram":
        """Return the statistics of the other columns when every model holds the first n.

        The log evidence of a set together with the first n is that of the set here plus that of the
        n alone; the posterior of its coefficients is the same.
        """
        # Block elimination: the Schur complement of the first n columns is the Gram matrix of what
        # they leave.
        factor = np.linalg.cholesky(self.XX[:n, :n] + np.eye(n))
        B = np.linalg.solve(factor, self.XX[:n, n:])
        b = np.linalg.solve(factor, self.Xy[:n])
        return Gram(self.XX[n:, n:] - B.T @ B, self.Xy[n:] - B.T @ b)

    def log_evidence(self, index: np.ndarray) -> float:
        """Return the log evidence of the columns `index`, less that of the empty model [nat]."""
        factor = np.linalg.cholesky(self.XX[index[:, None], index] + np.eye(len(index)))
        b = scipy.linalg.solve_triangular(factor, self.Xy[index], lower=True, check_finite=False)
        return float(0.5 * b @ b - np.log(factor.diagonal()).sum())

    def evidence_of_sets(
        self, sets: Sequence[Sequence[np.ndarray]], wide: Sequence[Sequence[bool]]
    ) -> np.ndarray:
        """Return the log evidence (n,) of n sets of column groups, less that of the empty model
        [nat].

        Args:
            sets: for each set, the column indices of its groups.
            wide: for each set, by group, whether its prior may widen to the size of its estimate.
        Source: local empirical Bayes (Liang et al. 2008, Mixtures of g priors); one width for each
            group, at least 1.
        """
        evidence = np.zeros(len(sets))
        for same_size in _alike([sum(map(len, groups)) for groups in sets]):
            evidence[same_size] = self._evidence(
                [sets[i] for i in same_size], [wide[i] for i in same_size]
            )
        return evidence

    def _evidence(
        self, sets: Sequence[Sequence[np.ndarray]], wide: Sequence[Sequence[bool]]
    ) -> np.ndarray:
        """Return the log evidence (n,) of sets that all have k columns."""
        index = np.stack([np.concatenate(groups) for groups in sets])
        XX = self.XX[index[:, :, None], index[:, None, :]]
        Xy = self.Xy[index]
        one = np.eye(index.shape[1])
        mean = np.linalg.solve(XX + one, Xy[..., None])[..., 0]
        counts = np.array([len(g) for groups in sets for g in groups])
        group = np.repeat(np.arange(len(counts)), counts)
        size = np.sqrt(np.bincount(group, mean.ravel() ** 2, len(counts)) / np.maximum(counts, 1))
        size = np.where(np.concatenate(wide), np.maximum(size, 1.0), 1.0)
        width = np.repeat(size, counts).reshape(mean.shape)
        factor = np.linalg.cholesky(XX * width[:, :, None] * width[:, None, :] + one)
        b = np.linalg.solve(factor, (Xy * width)[..., None])[..., 0]
        logdet = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
        return 0.5 * np.sum(b**2, axis=1) - logdet

    def posterior(self, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the posterior mean (k,) and covariance (k, k) of the coefficients of the columns
        `index`.
        """
        return self.posteriors([index])[0]

    def posteriors(self, indices: Sequence[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return `posterior` for each of many sets of columns."""
        results = [(np.zeros(0), np.zeros((0, 0)))] * len(indices)
        for same_size in _alike([len(index) for index in indices]):
            index = np.stack([indices[i] for i in same_size])
            covariance = np.linalg.inv(
                self.XX[index[:, :, None], index[:, None, :]] + np.eye(index.shape[1])
            )
            means = (covariance @ self.Xy[index][..., None])[..., 0]
            for i, mean, covariance_i in zip(same_size, means, covariance, strict=True):
                results[i] = (mean, covariance_i)
        return results


def _alike(sizes: Sequence[int]) -> Iterator[np.ndarray]:
    """Yield positions of nonempty sets of equal size, at most `AT_ONCE` matrix entries at a
    time.
    """
    for size in set(sizes) - {0}:
        same = np.flatnonzero(np.equal(sizes, size))
        most = max(1, AT_ONCE // size**2)
        yield from (same[first : first + most] for first in range(0, len(same), most))
