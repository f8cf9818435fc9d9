"""Encoders of the lifted state in numpy, as used in flight."""

import dataclasses as dc

import numpy as np


@dc.dataclass(frozen=True)
class Phi:
    """Multilayer perceptron without bias, z = W^(L+1) relu(W^L … relu(W^1 chi / scale)).

    Source: Jin et al. 2025, eq. (dnn).
    """

    weights: tuple[np.ndarray, ...]  # (out, in) matrices
    scale: np.ndarray  # (6,) of chi [N, N·m]; gamma bounds the Lipschitz constant in chi / scale

    @property
    def K(self) -> int:
        """Number of lifted states."""
        return len(self.weights[-1])

    @property
    def lipschitz_bound(self) -> float:
        """Product of the layers' largest singular values, per unit of chi / scale [1]."""
        return float(np.prod([np.linalg.norm(W, 2) for W in self.weights]))

    def __call__(self, chi: np.ndarray) -> np.ndarray:
        """Return z (..., K) of chi (..., 6) [N, N·m]."""
        z = chi / self.scale
        for W in self.weights[:-1]:
            z = np.maximum(z @ W.T, 0.0)
        return z @ self.weights[-1].T


@dc.dataclass(frozen=True)
class DelayEncoder:
    """Linear encoder z = E w + offset of the last D samples w of [chi, zeta], oldest first."""

    E: np.ndarray  # (K, 12 D) per [N, N·m, m/s, rad/s]
    delay: int  # D, samples of the window [1]
    offset: np.ndarray | None = None  # (K,), None for zero

    def __post_init__(self):
        if self.offset is not None and self.offset.shape != (len(self.E),):
            raise ValueError(
                f"DelayEncoder: offset must be ({len(self.E)},); got {self.offset.shape}."
            )
        if self.E.ndim != 2 or self.E.shape[1] != 12 * self.delay:
            raise ValueError(f"DelayEncoder: E must be (K, {12 * self.delay}); got {self.E.shape}.")

    @property
    def K(self) -> int:
        """Number of lifted states."""
        return len(self.E)

    def __call__(self, window: np.ndarray) -> np.ndarray:
        """Return z (..., K) of a window (..., D, 12) [N, N·m, m/s, rad/s]."""
        z = window.reshape(window.shape[:-2] + (-1,)) @ self.E.T
        return z if self.offset is None else z + self.offset

    def along(self, samples: np.ndarray) -> np.ndarray:
        """Return z (n - D + 1, K) of every full window of samples (n, 12)."""
        count = len(samples) - self.delay + 1
        z = np.zeros((count, self.K)) if self.offset is None else np.tile(self.offset, (count, 1))
        for d, E in enumerate(self.E.reshape(self.K, self.delay, 12).transpose(1, 2, 0)):
            z += samples[d : d + count] @ E
        return z
