"""A and B refit on the last samples in flight: ridge toward the offline prior, projected stable."""

import numpy as np
import scipy.linalg

from np_drake.lifting.encoders import Phi
from np_drake.lifting.lifted_linear_system import stabilized
from np_drake.lifting.lifted_model import LiftedModel

RADIUS = 0.9999  # largest |eigenvalue| of a refit A [1]


class WindowRefit:
    """min over A, B of |z_(k+1) - A z_k - B zeta_k|² + ridge |[A B] - [A_0 B_0]|² on one window.

    Forty samples cannot determine thirty columns (median rank 15 on real flights): the prior decides where
    they are silent. Zeta is scaled as in training. The normal matrix is at least `ridge` times the identity,
    so its Cholesky factor is well conditioned.   Source: Jin et al. 2025, Algorithm 1; own ridge.
    """

    def __init__(self, model: LiftedModel, ridge: float):
        if not ridge > 0:
            raise ValueError(f"WindowRefit: ridge must be positive; got {ridge}.")
        if not isinstance(model.encoder, Phi):
            raise ValueError(
                "WindowRefit: the encoder must be Phi; a delay encoder flies with its offline A, B."
            )
        self._phi, self._ridge = model.encoder, ridge
        self._scale = model.zeta_scale
        self._prior = np.hstack([model.system.A, model.system.B * self._scale]).T

    def __call__(self, window: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(W, 12) samples [chi, zeta], oldest first -> stable A (K, K), B (K, 6) in physical units."""
        z = self._phi(window[:, :6])
        K = z.shape[1]
        X = np.hstack([z[:-1], window[:-1, 6:] / self._scale])
        normal = X.T @ X
        normal[np.diag_indices(len(normal))] += self._ridge
        factor = scipy.linalg.cho_factor(normal, lower=True, check_finite=False)
        correction = X.T @ (z[1:] - X @ self._prior)
        solution = self._prior + scipy.linalg.cho_solve(factor, correction, check_finite=False)
        return stabilized(solution[:K].T, RADIUS), solution[K:].T / self._scale
