"""Fit, for one block of a trained model, of the effect of a jump of its modes on the window and on z."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
import scipy.linalg

from np_drake.lifting.model.onsets import Onsets
from np_drake.lifting.training.modal_fit import BlockMatrices

SLOWEST_LAG = 0.98  # of a label behind its target, beyond which nothing is believed [1]


@dc.dataclass(frozen=True)
class BlockOnsets:
    """Arrays watch (R, q, D c), cost (R,) and jump (R, k, q) of one block in scaled units, as in `Onsets`."""

    watch: np.ndarray
    cost: np.ndarray
    jump: np.ndarray


def label_lag(pieces: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Return a in [0, 1) of label[k] = a label[k - 1] + (1 - a) target[k], by least squares [1].

    A causal label follows its target late, and a jump is seen as late. 0 where both are the same, or constant.
    Args: pieces: (labels (n, c), targets (n, c)) each.
    """
    ahead, behind = 0.0, 1e-300
    for labels, targets in pieces:
        last = labels[:-1] - targets[1:]
        ahead += float(np.sum((labels[1:] - targets[1:]) * last))
        behind += float(np.sum(last**2))
    return float(np.clip(ahead / behind, 0.0, SLOWEST_LAG))


def fit_onsets(
    m: BlockMatrices,
    whitener: np.ndarray,
    *,
    modes: np.ndarray,
    ages: Sequence[int],
    delay: int,
    size: float,
    lag: float,
) -> BlockOnsets:
    """Fit the onsets of one block for jumps of `modes` by N(0, size²) each, `ages` samples ago.

    With S = L L^T the second moment of ordinary windows, and J_r d what a jump by d adds to a window: Q Q^T = 1 + J_r^T
    S^-1 J_r, M_r = Q^-1 J_r^T S^-1, c_r = log det Q. E w + G_r M_r w, with G_r = (A^r - E J_r) Q^-T, is the best linear
    z of a window in which such a jump happened. zeta is taken not to answer within the window: how the vehicle does is
    its controller's.

    Args:
        m: matrices A, C and E of the block.
        whitener: (D c, D c) L, lower; the first channels of a sample are the m outputs.
        modes: indices into z.
        ages: [steps]; an age >= D is before the window.
        delay: D [1].
        size: deviation of a jump [scaled].
        lag: see `label_lag` [1].
    """
    J = np.stack([_shown(m, delay, age, len(whitener), lag)[:, modes] for age in ages]) * size
    R, features, q = J.shape
    sides = J.transpose(1, 0, 2).reshape(features, -1)
    informed = scipy.linalg.cho_solve((whitener, True), sides).reshape(features, R, q)  # S^-1 J
    Q = np.linalg.cholesky(np.eye(q) + np.einsum("rnp,nrq->rpq", J, informed))
    powers = np.stack([np.linalg.matrix_power(m.A, age)[:, modes] for age in ages])
    left = size * powers - m.E @ J
    return BlockOnsets(
        watch=np.linalg.solve(Q, informed.transpose(1, 2, 0)),
        cost=np.log(np.diagonal(Q, axis1=1, axis2=2)).sum(axis=1),
        jump=np.linalg.solve(Q, left.swapaxes(1, 2)).swapaxes(1, 2),
    )


def _shown(m: BlockMatrices, delay: int, age: int, features: int, lag: float) -> np.ndarray:
    """Return what a jump of each mode by one adds to a window, `age` samples later, (D c, K)."""
    shown = np.zeros((max(delay, age + 1), features // delay, len(m.A)))
    label, jumped = np.zeros_like(m.C), np.eye(len(m.A))
    for row in shown[len(shown) - 1 - age :]:
        label = lag * label + (1.0 - lag) * (m.C @ jumped)
        row[: len(m.C)], jumped = label, m.A @ jumped
    return shown[-delay:].reshape(features, -1)


def stack_onsets(views: Sequence[tuple[np.ndarray, BlockOnsets]], odds: np.ndarray | float) -> Onsets:
    """Return the onsets of all views, each given with its channels (c, 12) of a sample.

    Zeros fill up where c or q differ.

    Args:
        views: channels and onsets of each.
        odds: as in `Onsets`.
    """
    c = max(len(channels) for channels, _ in views)
    q = max(found.jump.shape[2] for _, found in views)
    seen, watch, jump = [], [], []
    for channels, found in views:
        R, own = found.watch.shape[:2]
        watched = found.watch.reshape(R, own, -1, len(channels))
        seen.append(np.pad(channels, ((0, c - len(channels)), (0, 0))))
        watch.append(np.pad(watched, ((0, 0), (0, q - own), (0, 0), (0, c - len(channels)))).reshape(R, q, -1))
        jump.append(np.pad(found.jump, ((0, 0), (0, 0), (0, q - own))))
    cost = np.stack([found.cost for _, found in views])
    return Onsets(np.stack(seen), np.stack(watch), cost, np.stack(jump), odds)
