"""Bayesian linear regression on Gram matrices: evidence and posterior of any subset of columns.

y = X c + n, n white with unit variance, c ~ N(0, 1) column by column (columns carry the prior's scale).
log p(y) = -1/2 (y'y - b' A^-1 b) - 1/2 log det A + const, with A = X'X + 1, b = X'y.      Source: standard.
"""

import dataclasses as dc
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import lapack

AT_ONCE = 200_000  # figures in the matrices of the sets that are solved together


@dc.dataclass(frozen=True)
class Gram:
    """X'X (k, k), X'y (k,), y'y and the number of samples."""

    XX: np.ndarray
    Xy: np.ndarray
    yy: float
    samples: int

    def __add__(self, other: "Gram") -> "Gram":
        return Gram(self.XX + other.XX, self.Xy + other.Xy, self.yy + other.yy, self.samples + other.samples)

    def tempered(self, temperature: float) -> "Gram":
        """As if noise had `temperature` times the variance."""
        return Gram(self.XX / temperature, self.Xy / temperature, self.yy / temperature, self.samples)

    def only(self, index: np.ndarray) -> "Gram":
        """Of these columns."""
        return Gram(self.XX[np.ix_(index, index)], self.Xy[index], self.yy, self.samples)

    def given(self, n: int) -> tuple["Gram", float]:
        """Of the other columns when the first n are in every model, and the log evidence of these n alone.

        The log evidence of any set beside them is that of the set here, and that of the n; so with its posterior.
        """
        factor = np.linalg.cholesky(self.XX[:n, :n] + np.eye(n))
        B = np.linalg.solve(factor, self.XX[:n, n:])
        b = np.linalg.solve(factor, self.Xy[:n])
        rest = Gram(self.XX[n:, n:] - B.T @ B, self.Xy[n:] - B.T @ b, float(self.yy - b @ b), self.samples)
        return rest, float(0.5 * b @ b - np.log(np.diag(factor)).sum())

    def log_evidence(self, index: np.ndarray) -> float:
        """Of the model with these columns, less that of the empty model."""
        if len(index) == 0:
            return 0.0
        return _solved(self.XX[index[:, None], index], self.Xy[index])[1]

    def evidence_of_sets(
        self, sets: Sequence[Sequence[np.ndarray]], wide: Sequence[Sequence[bool]]
    ) -> np.ndarray:
        """(n,) the same of n sets of groups of columns, whose prior, where `wide`, is as wide as they ask for.

        An effect may be ten times what is usual: a normal prior would rather have two effects of the usual size.
        Source: local empirical Bayes (Liang et al. 2008, Mixtures of g priors); one width a group, at least 1.
        """
        evidence = np.zeros(len(sets))
        for some in _alike([sum(map(len, groups)) for groups in sets]):
            evidence[some] = self._evidence([sets[i] for i in some], [wide[i] for i in some])
        return evidence

    def _evidence(self, sets: Sequence[Sequence[np.ndarray]], wide: Sequence[Sequence[bool]]) -> np.ndarray:
        """(n,) of sets with k columns each."""
        index = np.stack([np.concatenate(groups) for groups in sets])
        XX, Xy = self.XX[index[:, :, None], index[:, None, :]], self.Xy[index]
        one = np.eye(index.shape[1])
        mean = np.linalg.solve(XX + one, Xy[..., None])[..., 0]
        counts = np.array([len(g) for groups in sets for g in groups])
        group = np.repeat(np.arange(len(counts)), counts)
        own = np.sqrt(np.bincount(group, mean.ravel() ** 2, len(counts)) / np.maximum(counts, 1))
        own = np.where(np.concatenate(wide), np.maximum(own, 1.0), 1.0)
        width = np.repeat(own, counts).reshape(mean.shape)
        factor = np.linalg.cholesky(XX * width[:, :, None] * width[:, None, :] + one)
        b = np.linalg.solve(factor, (Xy * width)[..., None])[..., 0]
        logdet = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
        return 0.5 * np.sum(b**2, axis=1) - logdet

    def posterior(self, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k,) mean and (k, k) covariance of the coefficients of these columns."""
        return self.posteriors([index])[0]

    def posteriors(self, indices: Sequence[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
        """`posterior` of many sets of columns."""
        found = [(np.zeros(0), np.zeros((0, 0)))] * len(indices)
        for some in _alike([len(index) for index in indices]):
            index = np.stack([indices[i] for i in some])
            covariance = np.linalg.inv(self.XX[index[:, :, None], index[:, None, :]] + np.eye(index.shape[1]))
            mean = (covariance @ self.Xy[index][..., None])[..., 0]
            for i, *one in zip(some, mean, covariance, strict=True):
                found[i] = (one[0], one[1])
        return found


def _alike(sizes: Sequence[int]) -> Iterator[np.ndarray]:
    """Positions of sets with as many columns, as many at a time as `AT_ONCE` allows; empty sets apart."""
    for size in set(sizes) - {0}:
        same = np.flatnonzero(np.equal(sizes, size))
        most = max(1, AT_ONCE // size**2)
        yield from (same[first : first + most] for first in range(0, len(same), most))


def _solved(XX: np.ndarray, Xy: np.ndarray) -> tuple[np.ndarray, float]:
    """Posterior mean (k,) and log evidence by one factor."""
    A = XX.copy()
    A[np.diag_indices(len(A))] += 1.0
    factor, failed = lapack.dpotrf(A, lower=1)
    if failed:
        raise np.linalg.LinAlgError("the Gram matrix of a set of columns is not positive definite")
    mean, _ = lapack.dpotrs(factor, Xy, lower=1)
    return mean, float(0.5 * Xy @ mean - np.log(factor.diagonal()).sum())


def loss_beside(residual: np.ndarray, columns: np.ndarray) -> float:
    """Sum of squares of what is left (n,), white, less what columns (n, k) take of it, with prior N(0, 1) each.

    Minus half of it is a log likelihood, whatever their coefficients are, but for what does not depend on `left`.
    """
    factor = np.linalg.cholesky(columns.T @ columns + np.eye(columns.shape[1]))
    return float(residual @ residual) - float(np.sum(np.linalg.solve(factor, columns.T @ residual) ** 2))
