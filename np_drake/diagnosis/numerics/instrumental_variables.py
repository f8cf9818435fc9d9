"""Least squares under gusts: a vehicle yields to a gust, and what it then does is no cause of the force.

Source: generalised least squares with instrumental variables. A gust changes the velocity within its own bin, so that
each bin's velocity is known from those before it.
"""

from collections.abc import Iterable

import numpy as np
from scipy import linalg

Block = tuple[np.ndarray, np.ndarray, np.ndarray]  # columns (n, k), force (n,), root (n, n) of its covariance


def instrumented(blocks: Iterable[Block]) -> tuple[np.ndarray, np.ndarray]:
    """Precision (k, k) of the estimate, and times it the estimate (k,)."""
    pieces, instruments = [], []
    for X, f, root in blocks:
        pieces.append(_whitened(X, f, root))
        instruments.append(pieces[-1][:, :-1] - (X - _known_before(X)) / np.diag(root)[:, None])
    white, instrument = np.concatenate(pieces), np.concatenate(instruments)
    both = instrument.T @ white
    weighted = np.linalg.lstsq(instrument.T @ instrument, both, rcond=None)[0]
    return both[:, :-1].T @ weighted[:, :-1], both[:, :-1].T @ weighted[:, -1]


def plain(blocks: Iterable[Block]) -> tuple[np.ndarray, np.ndarray]:
    """The same without instruments, which takes the yielding for less of what slows a vehicle."""
    white = np.concatenate([_whitened(*block) for block in blocks])
    both = white[:, :-1].T @ white
    return both[:, :-1], both[:, -1]


def _whitened(X: np.ndarray, f: np.ndarray, root: np.ndarray) -> np.ndarray:
    """(n, k + 1) columns and force."""
    return linalg.solve_triangular(root, np.column_stack([X, f]), lower=True)


def _known_before(X: np.ndarray) -> np.ndarray:
    """(n, k) columns as the two rows before each foretell it, by the line through them."""
    early = X[:1].repeat(min(2, len(X)), axis=0)
    return np.concatenate([early, 2 * X[1:-1] - X[:-2]])[: len(X)]
