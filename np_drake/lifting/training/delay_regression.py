"""Multi-step prediction loss of a delay encoder, compressed so that its cost does not grow with the data.

With h the last D samples, u the coming zeta and y the coming targets, chi_hat = O E h + M * u is linear in E and the
loss is quadratic in the data: it depends on second moments only. The Cholesky factor of the moments of [h, u, y]
represents all origins: rows along h ("free", each with an initial state of its own, out of which E follows) and rows
orthogonal to h (initial state zero).   Source: own choice; variable projection, Golub 1973.
"""

import dataclasses as dc

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from np_drake.training_data.segments import white_noise

Piece = tuple[np.ndarray, np.ndarray, np.ndarray]  # labels (n, l), inputs (n, p), goals (n, m), scaled


@dc.dataclass(frozen=True)
class Regularisation:
    """Pseudo-data that regularises the fit where the flight is uninformative; deviations in scaled units [1]."""

    label_noise: float = 1.0  # white noise added to the encoder's labels, multiples of the noise they have
    smallest_label_noise: float = 3e-4  # but at least this
    zeta_noise: float = 0.01  # white noise added to the zeta the encoder sees
    input_noise: float = 0.01  # white noise added to the coming zeta: keeps B from amplifying it
    unknown_constant: float = 0.1  # constants added to label and target: an unknown constant wrench is held


@dc.dataclass(frozen=True)
class DelayRegression:
    """Compressed loss, with nh = D (l + p) history features, nu = H p coming inputs, ny = len(horizons) m goals."""

    delay: int  # D, samples of the history [1]
    horizons: np.ndarray  # [steps]
    weights: np.ndarray  # (len(horizons),) one over the error of persistence
    outputs: int  # m goals a sample [1]
    inputs: int  # p inputs a sample [1]
    whitener: np.ndarray  # (nh, nh) lower factor of the history's second moment
    free_u: np.ndarray  # (nh, nu) rows with a free initial state
    free_y: np.ndarray  # (nh, ny) of the same rows
    fixed_u: np.ndarray  # (nu, nu) rows that start at zero
    fixed_y: np.ndarray  # (nu, ny) of the same rows
    floor: float  # loss that no model of these inputs can remove
    count: float  # ny x origins


def compress(
    pieces: list[Piece], *, delay: int, horizons: np.ndarray, regularisation: Regularisation, max_origins: int
) -> DelayRegression:
    """Return the compressed loss of `pieces`.

    Args:
        pieces: labels, inputs and goals, scaled.
        delay: samples of the history [1].
        horizons: [steps].
        regularisation: noise of the labels that is allowed for.
        max_origins: of all pieces; thinned evenly beyond.
    """
    total = sum(len(labels) for labels, _, _ in pieces)
    stride = max(1, -(-total // max_origins))
    m, p = pieces[0][2].shape[1], pieces[0][1].shape[1]
    weights = horizon_weights(pieces, horizons)
    gram: np.ndarray | float = 0.0
    origins = 0
    for piece in pieces:
        h, u, y = _rows(piece, delay, horizons, stride)
        X = np.hstack([h, u, (y * weights[:, None]).reshape(len(y), -1)])
        gram, origins = gram + X.T @ X, origins + len(X)
    S = np.asarray(gram) / origins
    nh, nu = delay * (pieces[0][0].shape[1] + p), horizons[-1] * p
    noise = regularisation.label_noise * white_noise([labels for labels, _, _ in pieces])
    noise = np.maximum(noise, regularisation.smallest_label_noise)
    _add_pseudo_data(S, noise, (m, p), delay, horizons, weights, regularisation)
    # S = [[LL', LF], [F'L', F'F + R'R]]: F are the rows along the histories, R (a Schur complement) those beside them
    L = np.linalg.cholesky(S[:nh, :nh])
    free = np.linalg.solve(L, S[:nh, nh:])
    rest = S[nh:, nh:] - free.T @ free
    rest[np.diag_indices(len(rest))] += 1e-11 * np.trace(S) / len(S)
    R = np.linalg.cholesky(rest).T
    return DelayRegression(
        delay=delay, horizons=horizons, weights=weights, outputs=m, inputs=p, whitener=L,
        free_u=free[:, :nu], free_y=free[:, nu:], fixed_u=R[:nu, :nu], fixed_y=R[:nu, nu:],
        floor=float(np.sum(R[nu:, nu:] ** 2)), count=float(len(horizons) * m),
    )  # fmt: skip


def horizon_weights(pieces: list[Piece], horizons: np.ndarray) -> np.ndarray:
    """Return 1 / RMSE of persistence at each horizon, limited to 1 / (2 % of the largest RMSE), (len(horizons),).

    Every horizon counts by its ratio to persistence, so that errors far ahead do not drown those one step ahead.

    Args:
        pieces: scaled.
        horizons: [steps].
    """
    power, count = np.zeros(len(horizons)), 0
    for labels, _, goals in pieces:
        n, m = len(goals) - horizons[-1], goals.shape[1]
        error = [np.sum((goals[i : i + n] - labels[:n, :m]) ** 2) for i in horizons]
        power, count = power + np.array(error), count + n * m
    rmse = np.sqrt(power / count)
    return 1.0 / np.maximum(rmse, max(0.02 * rmse.max(), 1e-9))


def _rows(piece: Piece, delay: int, horizons: np.ndarray, stride: int):
    """Return (o, nh) histories, oldest sample first; (o, nu) coming inputs; (o, len(horizons), m) goals."""
    labels, inputs, goals = piece
    samples = np.hstack([labels, inputs])
    origin = np.arange(delay - 1, len(labels) - horizons[-1], stride)
    h = sliding_window_view(samples, delay, axis=0)[origin - delay + 1].transpose(0, 2, 1)
    u = sliding_window_view(inputs, horizons[-1], axis=0)[origin].transpose(0, 2, 1)
    return h.reshape(len(origin), -1), u.reshape(len(origin), -1), goals[origin[:, None] + horizons]


def _add_pseudo_data(
    S: np.ndarray,
    label_noise: np.ndarray,
    sizes: tuple[int, int],
    delay: int,
    horizons: np.ndarray,
    weights: np.ndarray,
    regularisation: Regularisation,
) -> None:
    """Add the second moments of `regularisation` to S, in place; sizes: outputs m and inputs p."""
    l, (m, p) = len(label_noise), sizes
    nh, nu = delay * (l + p), horizons[-1] * p
    for j in range(l):
        row = np.zeros(len(S))
        row[:nh].reshape(delay, l + p)[:, j] = regularisation.unknown_constant
        if j < m:
            row[nh + nu :].reshape(len(horizons), m)[:, j] = regularisation.unknown_constant * weights
        S += np.outer(row, row)
    noise = np.concatenate([label_noise, np.full(p, regularisation.zeta_noise)])
    diagonal = np.concatenate([np.tile(noise, delay), np.full(nu, regularisation.input_noise)])
    S[np.arange(nh + nu), np.arange(nh + nu)] += diagonal**2
