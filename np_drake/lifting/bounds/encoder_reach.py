"""Reach of z within n steps, given by how much chi and zeta change over 1, 2, … steps.

All in scaled coordinates: |chi_(k+j) - chi_k| / chi_scale <= change of chi over j steps, and so for
zeta.
"""

import dataclasses as dc

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from np_drake.lifting.model.encoders import Phi
from np_drake.lifting.model.lifted_model import LiftedModel

_DOUBLINGS = 60  # of the exponent, before a power below one is given up


@dc.dataclass(frozen=True)
class Change:
    """Largest change of chi / scale and of zeta / scale over j = 1 … N steps, (N,) each [1]."""

    chi: np.ndarray
    zeta: np.ndarray

    def __post_init__(self):
        for name in ("chi", "zeta"):
            value = np.asarray(getattr(self, name), float)
            if value.shape != np.shape(self.chi) or not np.all((value >= 0) & np.isfinite(value)):
                raise ValueError(
                    f"bound: alpha_{name} must be finite and not negative; got {value}."
                )


@dc.dataclass(frozen=True)
class EncoderReach:
    """Bounds on how far z moves within n = 1 … N steps.

    radius: (N,) bound on the distance of z_n from where it would be if chi and zeta stood still
    from now on.
    """

    lipschitz: (
        float  # constant of the encoder in scaled coordinates, of chi (Phi) or of the window [1]
    )
    radius: np.ndarray
    travel: np.ndarray  # (N,) bound on the distance of z_(k+n) from z_k


def chi_scale(model: LiftedModel) -> np.ndarray:
    """Return the (6,) scale by which chi is divided before the encoder sees it [N, N·m]."""
    return model.encoder.scale if isinstance(model.encoder, Phi) else model.chi_scale


def encoder_reach(model: LiftedModel, change: Change) -> EncoderReach:
    """Return the reach of the model's encoder under a change of chi and zeta.

    Phi: L |dchi|, L the product of the layers' spectral norms.
    Delay encoder: sum over lags d of |E_d| |dx|, where the sample at lag d has moved for n - d
        steps only since now.

    Args:
        model: with an encoder that is linear in its window.
    """
    if isinstance(model.encoder, Phi):
        L = model.encoder.lipschitz_bound
        return EncoderReach(L, L * change.chi, L * change.chi)
    encoder = model.linear_encoder
    E = encoder.E.reshape(encoder.K, encoder.delay, 12).swapaxes(0, 1)[::-1]  # by lag
    gain_chi, gain_zeta = (
        spectral_norms(E[..., :6] * model.chi_scale),
        spectral_norms(E[..., 6:] * model.zeta_scale),
    )
    N = len(change.chi)
    radius = np.convolve(gain_chi, change.chi)[:N] + np.convolve(gain_zeta, change.zeta)[:N]
    travel = gain_chi.sum() * change.chi + gain_zeta.sum() * change.zeta
    scales = np.tile(np.concatenate([model.chi_scale, model.zeta_scale]), encoder.delay)
    return EncoderReach(float(spectral_norms(encoder.E * scales)), radius, travel)


def standing_still(model: LiftedModel, window: np.ndarray, horizon: int) -> np.ndarray:
    """Return z_n (horizon, K) for n = 1 …, if chi and zeta kept the values of the window's last
    row.

    Args:
        window: (W, 12) last [chi, zeta], oldest first.
        horizon: number of steps [1].
    """
    W = model.window
    if isinstance(model.encoder, Phi):
        return np.broadcast_to(model.lift(window), (horizon, model.system.K))
    future = np.concatenate([window[-W:], np.broadcast_to(window[-1], (horizon, 12))])
    return model.lift(sliding_window_view(future, W, axis=0)[1:].swapaxes(1, 2))


def spectral_norms(matrices: np.ndarray) -> np.ndarray:
    """Return the largest singular values (...,) of matrices (..., m, n), from the smaller Gram
    matrix.
    """
    M = matrices if matrices.shape[-2] >= matrices.shape[-1] else matrices.swapaxes(-1, -2)
    if M.shape[-1] == 0:
        return np.zeros(M.shape[:-2])
    return np.sqrt(np.maximum(np.linalg.eigvalsh(M.swapaxes(-1, -2) @ M)[..., -1], 0.0))


def powers(A: np.ndarray, first: np.ndarray, count: int) -> np.ndarray:
    """Return first, A first, A² first, …, stacked to (count, K, m).

    Args:
        A: (K, K).
        first: (K, m).
        count: of the powers [1].
    """
    out = np.empty((count, *first.shape))
    for i in range(count):
        out[i] = first
        first = A @ first
    return out


def contracts(A: np.ndarray) -> bool:
    """Return whether some power of A (K, K) has a norm below one.

    That proves stability without trust in computed eigenvalues.
    """
    for _ in range(_DOUBLINGS):
        size = np.linalg.norm(A)
        if not size < 1e100:
            return False
        if size < 1.0:
            return True
        A = A @ A
    return False
