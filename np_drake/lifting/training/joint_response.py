"""Encoder and B of a mode dictionary in one least-squares problem, for a known coming motion.

`zeta_response` first fits the best forecast for a held zeta and then what a departure from it adds. On a periodic
flight the past determines the coming motion, the first fit explains all of it, and B learns nothing: on another track
the forecast goes on circling. A controller knows the motion it plans; here E and B explain the wrench together,
    chi_hat_h = sum over modes of lambda^h E w + sum over j < h of lambda^(h-1-j) B (zeta_(k+j) - zeta_k),
which is linear in both: the modes are fixed.       Source: own choice.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
import scipy.linalg

from np_drake.lifting.model.delay_taps import DelayTaps
from np_drake.lifting.training.horizon_ridge import CONSTANT, GROUPS, TURNS
from np_drake.lifting.training.mode_dictionary import ModeDictionary
from np_drake.lifting.training.zeta_response import departures

PRIOR = 1e-4  # weight of the prior on B against the mean square error over `power` [1]
OVERLAP = 1e-6  # ridge of the modes' Gram matrix over its mean: neighbours are all but parallel [1]


@dc.dataclass(frozen=True)
class JointPiece:
    """Data of one flight, scaled.

    samples: (n, 12) [chi, zeta].   goal: (n, 6) target.   power: (H, 2) of force and torque, see `Moments`.
    """

    samples: np.ndarray
    goal: np.ndarray
    power: np.ndarray


def fit_jointly(
    flights: Sequence[JointPiece], modes: ModeDictionary, horizons: np.ndarray, taps: DelayTaps,
    *, noise: float, input_noise: float, strength: float, symmetry: float, max_origins: int,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return the encoder (K, p) of the p features, the last of which is 1, and B (K, 6), scaled.

    Args: noise … symmetry: as in `DictionaryConfig`.   max_origins: of a flight; thinned evenly beyond.
    """
    encoders, responses = [], []
    for k, group in enumerate(GROUPS):
        poles = modes.poles[group.start]
        parts = [
            _moments(
                flight, flight.power[:, k], group, poles, horizons, taps,
                noise=noise, input_noise=input_noise, max_origins=max_origins,
            )
            for flight in flights
        ]  # fmt: skip
        gram, cross = (np.mean([part[i] for part in parts], axis=0) for i in (0, 1))
        gram, cross = _symmetrised(gram, cross, group, len(poles), symmetry)
        settled = 1.0 / (1.0 - poles) / strength  # of a mode, per unit of B and of zeta held
        n = len(gram) - 6 * len(poles)
        gram[range(n, len(gram)), range(n, len(gram))] += PRIOR * np.repeat(settled**2, 6)
        unit = np.sqrt(np.diag(gram))  # equilibrates the normal matrix
        factor = scipy.linalg.cho_factor(gram / np.outer(unit, unit))
        solution = scipy.linalg.cho_solve(factor, cross / unit[:, None]) / unit[:, None]
        encoders.append(solution[:n].T.reshape(3 * len(poles), -1))
        responses.append(solution[n:].T.reshape(3 * len(poles), 6))
    return np.concatenate(encoders), np.concatenate(responses)


def _moments(
    flight: JointPiece, power: np.ndarray, group: slice, poles: np.ndarray, horizons: np.ndarray, taps: DelayTaps,
    *, noise: float, input_noise: float, max_origins: int,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return normal matrix, M p + 6 M square, and right-hand side (M p + 6 M, 3) of one flight, with pseudo-noise."""
    first, last = taps.delay - 1, len(flight.samples) - int(horizons[-1])
    origins = np.arange(first, last, max(1, -(-(last - first) // max_origins)))
    F = np.hstack([taps.features(flight.samples, origins), np.ones((len(origins), 1))])
    u = departures(flight.samples[:, 6:], origins, horizons, poles).reshape(len(origins), len(horizons), -1)
    Y = flight.goal[origins[:, None] + horizons, group]
    weight = 1.0 / (power * len(horizons))
    decay = poles[None] ** horizons[:, None]  # (H, M)
    overlap = (decay * weight[:, None]).T @ decay
    overlap[np.diag_indices(len(overlap))] += OVERLAP * np.trace(overlap) / len(overlap)
    own = F.T @ F / len(F) + np.diag(np.append(np.full(F.shape[1] - 1, noise**2), CONSTANT))
    steered = u * (weight / len(F))[:, None]
    product = poles[:, None] * poles
    noisy = sum(w * (1 - product**h) / (1 - product) for w, h in zip(weight, horizons, strict=True))
    driven = np.einsum("ohp,ohq->pq", steered, u, optimize=True) + input_noise**2 * np.kron(noisy, np.eye(6))
    mixed = np.einsum("hm,op,ohq->mpq", decay, F, steered, optimize=True).reshape(-1, u.shape[2])
    gram = np.block([[np.kron(overlap, own), mixed], [mixed.T, driven]])
    explained = np.einsum("hm,op,ohc->mpc", decay * weight[:, None] / len(F), F, Y, optimize=True)
    return gram, np.vstack([explained.reshape(-1, 3), np.einsum("ohp,ohc->pc", steered, Y, optimize=True)])


def _symmetrised(
    gram: np.ndarray, cross: np.ndarray, group: slice, modes: int, symmetry: float
) -> tuple[np.ndarray, np.ndarray]:
    """Average the share `symmetry` of the moments over the turns, each a signed permutation of features and inputs."""
    p = len(gram) // modes - 6
    mean_gram, mean_cross = np.zeros_like(gram), np.zeros_like(cross)
    for turn in TURNS:
        source, sign = np.argmax(np.abs(turn), axis=0), turn.sum(axis=0)
        feature = np.append((6 * np.arange((p - 1) // 6)[:, None] + source).ravel(), p - 1)
        signs = np.append(np.tile(sign, (p - 1) // 6), 1.0)
        place = np.concatenate(
            [(p * np.arange(modes)[:, None] + feature).ravel(),
             p * modes + (6 * np.arange(modes)[:, None] + source).ravel()]
        )  # fmt: skip
        s = np.concatenate([np.tile(signs, modes), np.tile(sign, modes)])
        mean_gram += s[:, None] * s * gram[np.ix_(place, place)] / len(TURNS)
        mean_cross += s[:, None] * cross[place] @ turn[group, group] / len(TURNS)
    return (1 - symmetry) * gram + symmetry * mean_gram, (1 - symmetry) * cross + symmetry * mean_cross
