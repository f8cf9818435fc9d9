"""Blocks of time of whitened flights, and robust log scores of their prediction by a linear model.

y = X c + n with c ~ N(0, 1), n white. A block of N values whose own noise level is uncertain is
predicted by a Student t density of `DEGREES` degrees of freedom, so that no block counts for more
than it tells.
Source: prequential analysis (Dawid 1984); multivariate t density.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import linalg

from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.residuals import FlightResiduals

LENGTH = 1.5  # of a block [s]
DEGREES = 8.0  # of freedom of the noise level of a block [1]


@dc.dataclass(frozen=True)
class Block:
    """Gram matrix (k + 1, k + 1) of columns and target in a block of a flight, and the number of
    its values.
    """

    gram: np.ndarray
    values: int


@dc.dataclass(frozen=True)
class Blocks:
    """Blocks of a flight in order of time; its first `shared` columns are those of all flights."""

    flight: str
    parts: list[Block]
    shared: int

    @property
    def own(self) -> int:
        """Number of columns of the flight alone."""
        return self.parts[0].gram.shape[0] - 1 - self.shared

    def of_others(self, shared: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Return the Gram matrix (k + 1, k + 1) of shared columns and target, those of the flight
        integrated out.

        Args:
            shared: (k,) indices of shared columns.
        """
        total = np.sum([part.gram for part in self.parts], axis=0)
        kept, gone = np.append(shared, -1), self.shared + own
        factor = linalg.cholesky(
            total[np.ix_(gone, gone)] + np.eye(len(gone)), lower=True, check_finite=False
        )
        B = linalg.solve_triangular(
            factor, total[np.ix_(gone, kept)], lower=True, check_finite=False
        )
        return total[np.ix_(kept, kept)] - B.T @ B


def blocks_of(
    e: FlightResiduals, noise: NoiseModel, shared: np.ndarray, own: np.ndarray, target: np.ndarray
) -> Blocks:
    """Return the blocks of a flight.

    Args:
        shared: (m, 15, k) columns of all flights, in units of their prior.
        own: (m, 15, k') those of this flight.
        target: (m, 15) channels.
    """
    white = e.white(noise, np.concatenate([shared, own, target[..., None]], axis=-1))[
        :, noise.active
    ]
    count = max(1, round(len(white) * e.grid.step / LENGTH))
    parts = [part.reshape(-1, part.shape[-1]) for part in np.array_split(white, count) if len(part)]
    return Blocks(e.name, [Block(part.T @ part, len(part)) for part in parts], shared.shape[-1])


def scores(
    following: Blocks, known: Sequence[np.ndarray], shared: np.ndarray, own: np.ndarray
) -> np.ndarray:
    """Return the log score (n,) of each block of a flight, predicted from other flights and the
    blocks before it [nat].

    Args:
        known: Gram matrices of other flights (`Blocks.of_others`) of the same shared columns.
        shared: (k,) indices of shared columns.
        own: (k',) indices among the columns of the flight.
    """
    k, size = len(shared), len(shared) + len(own)
    at = np.ix_(*[np.concatenate([shared, following.shared + own, [-1]])] * 2)
    total = np.zeros((size + 1, size + 1))
    total[:-1, :-1] = np.eye(size)
    place = np.ix_(*[np.append(np.arange(k), -1)] * 2)
    for gram in known:
        total[place] += gram
    before, found = _fitted(total), []
    for block in following.parts:
        total = total + block.gram[at]
        after = _fitted(total)
        # Of a Gaussian y = X c + n: the quadratic form and the determinant of a prediction are
        # differences of those of all that is known after and before it.
        square, logdet = after[0] - before[0], after[1] - before[1]
        n = block.values
        found.append(-0.5 * logdet - 0.5 * (DEGREES + n) * np.log1p(max(square, 0.0) / DEGREES))
        before = after
    return np.array(found)


def _fitted(gram: np.ndarray) -> tuple[float, float]:
    """Return the least squared misfit y'y - b'A^-1 b and log det A of a Gram matrix with its
    prior.
    """
    factor = linalg.cholesky(gram[:-1, :-1], lower=True, check_finite=False)
    b = linalg.solve_triangular(factor, gram[:-1, -1], lower=True, check_finite=False)
    return float(gram[-1, -1] - b @ b), float(2.0 * np.log(np.diag(factor)).sum())
