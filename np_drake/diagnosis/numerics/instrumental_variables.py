"""Least squares under gusts with instrumental variables.

A vehicle yields to a gust, so that its velocity correlates with the force of the gust, and ordinary least squares is
biased. A gust changes the velocity within its own bin; the instrument is the velocity extrapolated from earlier bins.

Source: generalised least squares with instrumental variables.
"""

from collections.abc import Iterable

import numpy as np
from scipy import linalg

Block = tuple[np.ndarray, np.ndarray, np.ndarray]  # columns (n, k), force (n,), root (n, n) of its covariance


def instrumented(blocks: Iterable[Block]) -> tuple[np.ndarray, np.ndarray]:
    """Estimate coefficients with instruments that earlier bins predict.

    Args:
        blocks: for each block, columns (n, k), force (n,) and a lower triangular root (n, n) of its covariance.
    Returns: (k, k) precision of the estimate, and (k,) precision times estimate.
    """
    pieces, instruments = [], []
    for X, f, root in blocks:
        pieces.append(_whitened(X, f, root))
        instruments.append(pieces[-1][:, :-1] - (X - _known_before(X)) / np.diag(root)[:, None])
    white, instrument = np.concatenate(pieces), np.concatenate(instruments)
    both = instrument.T @ white
    weighted = np.linalg.lstsq(instrument.T @ instrument, both, rcond=None)[0]
    return both[:, :-1].T @ weighted[:, :-1], both[:, :-1].T @ weighted[:, -1]


def plain(blocks: Iterable[Block]) -> tuple[np.ndarray, np.ndarray]:
    """Estimate coefficients by generalised least squares without instruments.

    The estimate is biased towards less drag, because the vehicle yields to gusts.

    Args:
        blocks: for each block, columns (n, k), force (n,) and a lower triangular root (n, n) of its covariance.
    Returns: (k, k) precision of the estimate, and (k,) precision times estimate.
    """
    white = np.concatenate([_whitened(*block) for block in blocks])
    both = white[:, :-1].T @ white
    return both[:, :-1], both[:, -1]


def _whitened(X: np.ndarray, f: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Return columns and force (n, k + 1), whitened."""
    return linalg.solve_triangular(root, np.column_stack([X, f]), lower=True)


def _known_before(X: np.ndarray) -> np.ndarray:
    """Return columns (n, k) extrapolated linearly from the two rows before each."""
    early = X[:1].repeat(min(2, len(X)), axis=0)
    return np.concatenate([early, 2 * X[1:-1] - X[:-2]])[: len(X)]
