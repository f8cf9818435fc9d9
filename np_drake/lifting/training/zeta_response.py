"""Response of the wrench to a departure of zeta from its last value: B of a mode dictionary, by least squares.

The forecast for a held zeta is the encoder's alone. z therefore carries the last zeta as well (z_zeta), and B acts on
the difference: a+ = A a + B (zeta - z_zeta). So a held zeta leaves the held forecast untouched, and B is free to learn
only what the coming motion adds. In one lifted linear system: [[A, -B], [0, level]], [[B], [0]].
"""

from collections.abc import Sequence

import numpy as np

from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.training.horizon_ridge import GROUPS, TURNS
from np_drake.lifting.training.mode_dictionary import ModeDictionary


def departures(zeta: np.ndarray, origins: np.ndarray, horizons: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """Return the state of each mode at each horizon, driven by zeta_(k+j) - zeta_k with unit gain, (o, H, modes, 6).

    Args: zeta: (n, 6).   origins: (o,) sample indices.   horizons: (H,) [steps].   poles: (modes,) [1].
    """
    wanted = {int(h): i for i, h in enumerate(horizons)}
    out = np.zeros((len(origins), len(horizons), len(poles), 6))
    state = np.zeros((len(origins), len(poles), 6))
    for j in range(int(horizons[-1]) + 1):
        if j in wanted:
            out[:, wanted[j]] = state
        state = poles[:, None] * state + (zeta[origins + j] - zeta[origins])[:, None]
    return out


def fit_response(
    flights: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]],
    modes: ModeDictionary, horizons: np.ndarray, *, noise: float, strength: float, symmetry: float,
) -> np.ndarray:  # fmt: skip
    """Return B (K, 6), scaled, that minimises the error of the forecast for known zeta.

    Args:
        flights: of each (zeta (n, 6), origins (o,), residual of the held forecast (o, H, 6), power (H, 2)), scaled.
        noise: deviation of white noise in the coming zeta [scaled]: keeps B from differentiating it.
        strength: prior deviation of what one unit of zeta, held, adds to chi through each mode [scaled]. Errors at
            horizon h count as one in h samples, because so few of them are independent.
        symmetry: as in `flight_moments`.
    """
    B = np.zeros((modes.K, 6))
    for k, group in enumerate(GROUPS):
        poles = modes.poles[group.start]
        size = 6 * len(poles)
        gram, cross = np.zeros((size, size)), np.zeros((size, 3))
        for zeta, origins, rest, power in flights:
            u = departures(zeta, origins, horizons, poles).reshape(len(origins), len(horizons), size)
            left = np.maximum(np.mean(np.sum(rest[..., group] ** 2, axis=-1), axis=0), 1e-6 * power[:, k])
            left /= len(zeta) / np.maximum(horizons, 1.0)  # so many windows of a flight are independent
            weighted = u / (left * len(origins))[:, None]
            one = np.einsum("ohp,ohq->pq", weighted, u, optimize=True)
            two = np.einsum("ohp,ohc->pc", weighted, rest[..., group], optimize=True)
            gram, cross = gram + one, cross + two
            energy = np.array(
                [[np.sum((p * q) ** np.arange(h)) for h in horizons] for p in poles for q in poles]
            )
            floor = (energy @ (1.0 / left)).reshape(len(poles), len(poles))
            gram = gram + noise**2 * np.kron(floor, np.eye(6))
        gram, cross = _symmetrised(gram, cross, group, symmetry)
        settled = (1.0 / (1.0 - poles)) / strength  # of a mode, per unit of B and of zeta held
        solution = np.linalg.solve(gram + np.diag(np.repeat(settled**2, 6)), cross)
        for i, channel in enumerate(range(*group.indices(6))):
            B[modes.places[channel]] = solution[:, i].reshape(-1, 6)
    return B


def coupled(modes: ModeDictionary, B: np.ndarray, level: float, step: float) -> LiftedLinearSystem:
    """Return the system of z = [amplitudes; last zeta].

    Args: B: (K, 6) in physical units.   level: pole of the last zeta [1].   step: [s].
    """
    K = modes.K
    A = np.zeros((K + 6, K + 6))
    A[:K, :K], A[:K, K:], A[K:, K:] = modes.A, -B, level * np.eye(6)
    return LiftedLinearSystem(
        A, np.vstack([B, np.zeros((6, 6))]), np.hstack([modes.C, np.zeros((6, 6))]), step
    )


def _symmetrised(
    gram: np.ndarray, cross: np.ndarray, group: slice, symmetry: float
) -> tuple[np.ndarray, np.ndarray]:
    modes = len(gram) // 6
    grams, crosses = [], []
    for turn in TURNS:
        T = np.kron(np.eye(modes), turn)
        grams.append(T.T @ gram @ T)
        crosses.append(T.T @ cross @ turn[group, group])
    share = symmetry
    return (1 - share) * gram + share * np.mean(grams, axis=0), (1 - share) * cross + share * np.mean(
        crosses, axis=0
    )
