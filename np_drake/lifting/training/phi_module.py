"""Phi for training: a perceptron without bias whose Lipschitz constant is at most gamma by
construction.
"""

import itertools

import numpy as np
import torch
from torch import nn

from np_drake.lifting.model.encoders import Phi


class PhiModule(nn.Module):
    """Spectrally normalised perceptron, W_hat = W / sigma(W) gamma^(1/(L+1)) in every layer.

    The input is chi / scale, so gamma is the Lipschitz constant in those scaled coordinates; in N
    and N·m it is at most gamma / min(scale). sigma and its gradient u v^T come from a singular
    value decomposition, so that the bound holds for close singular values too, where a power
    iteration stands still early; training takes as long with
    either (own measurement).   Source: Jin et al. 2025, eq. (sn).

    Args:
        gamma: [1].
        scale: (6,) of chi [N, N·m].
    """

    def __init__(
        self, *, width: int, layers: int, K: int, gamma: float, scale: np.ndarray, seed: int
    ):
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        start = _initial_weights([6] + [width] * layers + [K], generator)
        self.raw = nn.ParameterList(nn.Parameter(raw) for raw in start)
        self._layer_gain = gamma ** (1.0 / len(self.raw))
        self._scale = torch.from_numpy(scale)

    def weights(self) -> list[torch.Tensor]:
        """Return the normalised weights, each of largest singular value gamma^(1/(L+1))."""
        return [normalised(W, self._layer_gain) for W in self.raw]

    def forward(self, chi: torch.Tensor) -> torch.Tensor:
        """Return z (..., K) of chi (..., 6) [N, N·m]."""
        z = chi / self._scale
        *hidden, last = self.weights()
        for W in hidden:
            z = torch.relu(z @ W.T)
        return z @ last.T

    def export(self) -> Phi:
        """Return the map in numpy, normalised once more with exact singular values."""
        exact = []
        for W in self.weights():
            array = W.detach().numpy()
            exact.append(array * (self._layer_gain / np.linalg.norm(array, 2)))
        return Phi(tuple(exact), self._scale.numpy().copy())


def normalised(W: torch.Tensor, gain: float) -> torch.Tensor:
    """Return a matrix of largest singular value `gain` along W, with its gradient.

    Args:
        gain: [1].
    """
    with torch.no_grad():
        U, _, Vh = torch.linalg.svd(W, full_matrices=False)
    return W * (gain / (U[:, 0] @ W @ Vh[0]))


def _initial_weights(sizes: list[int], generator: torch.Generator) -> list[torch.Tensor]:
    """Return layers whose first outputs carry chi itself, as relu(chi) - relu(-chi), beside random
    features.

    So chi = C z holds from the start and training need not find the identity first. Own choice: one
    step ahead on a real flight the error is 0.8 of persistence's this way, and 8 times it from a
    plain random start.
    """
    weights = []
    for layer, (inputs, outputs) in enumerate(itertools.pairwise(sizes)):
        raw = torch.randn(outputs, inputs, generator=generator, dtype=torch.float64)
        raw = raw / torch.linalg.matrix_norm(raw, 2)
        eye = torch.eye(6, dtype=torch.float64)
        if layer == 0:
            carrier = torch.cat([eye, -eye])
        elif layer < len(sizes) - 2:
            carrier = torch.eye(12, dtype=torch.float64)
        else:
            carrier = torch.cat([eye, -eye], dim=1)
        raw[: len(carrier)] = 0.0
        raw[: len(carrier), : carrier.shape[1]] = carrier
        weights.append(raw)
    return weights
