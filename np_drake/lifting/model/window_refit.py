"""Refit of A and B on the last samples in flight: Bayesian regression about the offline matrices,
projected stable.
"""

import numpy as np
from scipy.linalg import lapack

from np_drake.lifting.model.lifted_linear_system import Phi, stabilized, stabilized_all
from np_drake.lifting.model.lifted_model import LiftedModel

RADIUS = 0.9999  # largest |eigenvalue| of a refit A [1]


class WindowRefit:
    """Posterior mean of A and B after one window, with the offline A_0 and B_0 as the mean of the
    prior.

    The window is Y = X Theta + E with rows [z, zeta / scale] in X, the next z in Y, Theta = [A B]'.
    The prior is matrix normal, Theta ~ N(Theta_0, Sigma / p), with the covariance Sigma across z
    that the noise E has. So the mean is

        Theta = Theta_0 + (X'X + p)^-1 X'(Y - X Theta_0).

    p, the model's `ridge`, is learned from the training flights (`most_likely_ridge`). Directions
    that the window does not excite stay at the prior: forty samples cannot determine thirty columns
    (median rank 15 on real flights). Each label stands beside the zeta of its own time, `late`
    samples before it.
    Source: Jin et al. 2025, Algorithm 1; the prior is an own choice.
    """

    def __init__(self, model: LiftedModel):
        if not isinstance(model.encoder, Phi):
            raise ValueError(
                "WindowRefit: the encoder must be Phi; a delay encoder flies with its offline A, B."
            )
        if not model.ridge > 0:
            raise ValueError(f"WindowRefit: ridge must be positive; got {model.ridge}.")
        self.phi, self._ridge, self._late = model.encoder, model.ridge, model.late
        self._scale = model.zeta_scale
        self._pull = model.ridge * np.hstack([model.system.A, model.system.B * self._scale])

    def rows(self, samples: np.ndarray) -> np.ndarray:
        """Return the rows [z, zeta / scale] (n - late, K + 6) of the regression from samples [chi,
        zeta] (n, 12).
        """
        z = self.phi(samples[self._late :, :6])
        return np.concatenate([z, samples[: len(z), 6:] / self._scale], axis=-1)

    def solve(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return stable A (K, K) and B (K, 6) from the `rows` (W - late, K + 6) of a window.

        A flight keeps the rows, so that each sample is lifted once. The normal matrix is formed
        anew at every sample: one product of 2 us, which adding one row and removing one would not
        beat, and it accumulates no rounding error.
        """
        A, B = self._posterior(rows)
        return stabilized(A, RADIUS), B

    def along(self, samples: np.ndarray, W: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return A (o, K, K) and B (o, K, 6) of all o = n - W + 1 windows of an uninterrupted
        flight of samples (n, 12), and A's spectral radii (o,) before it was made stable [1].
        """
        rows, steps = self.rows(samples), W - self._late
        found = [self._posterior(rows[i : i + steps]) for i in range(len(rows) - steps + 1)]
        A, before = stabilized_all(np.stack([A for A, _ in found]), RADIUS)
        return A, np.stack([B for _, B in found]), before

    def _posterior(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return A and B of a window before A is made stable."""
        # (X'X + p) [A B]' = X'Y + p [A_0 B_0]', by Cholesky
        X, K = rows[:-1], self.phi.K
        normal = X.T @ X
        normal.flat[:: len(normal) + 1] += self._ridge
        moments = rows[1:, :K].T @ X + self._pull
        # Transposed: no copies
        solution = lapack.dposv(normal.T, moments.T, overwrite_a=1, overwrite_b=1)[1].T
        return solution[:, :K], solution[:, K:] / self._scale
