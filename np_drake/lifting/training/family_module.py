"""`ModalAxis` for training: the same map as a differentiable function of its arrays and of theta."""

import numpy as np
import torch
from torch import nn

from np_drake.lifting.model.modal_axis import ModalAxis

ARRAYS = ("frequency", "damping", "decay", "inputs", "encoder")


class AxisModule(nn.Module):
    """Differentiable `ModalAxis` in single precision.

    Args:
        channels: (V, c, 12) what a view takes of a sample, scaled.
        readout: (V, 6) force along a view [N].
        delay: samples of the window, D.
        frequencies: (p,) of the pairs at first [rad/s].
        decays: (q,) of the real modes at first [1/s].
        size: entries of theta, r.
        seed: of what is drawn.
    """

    def __init__(
        self, channels: np.ndarray, readout: np.ndarray, *, delay: int, frequencies: tuple[float, ...],
        decays: tuple[float, ...], size: int, seed: int,
    ):  # fmt: skip
        super().__init__()
        rng = np.random.default_rng(seed)
        p, q, c = len(frequencies), len(decays), channels.shape[1]
        K = 2 * p + q

        def slopes(first: np.ndarray, spread: float) -> nn.Parameter:
            drawn = spread * rng.standard_normal((*first.shape, size))
            return nn.Parameter(torch.from_numpy(np.concatenate([first[..., None], drawn], axis=-1)).float())

        # A new pair has lost a third of its swing after one period, a start from which it may lose more or none.
        self.frequency = slopes(np.log(frequencies), 0.05)
        self.damping = slopes(np.log(np.array(frequencies) / 15.0), 0.0)
        self.decay = slopes(np.log(decays), 0.0)
        self.inputs = slopes(0.02 * rng.standard_normal((K, c - 1)), 0.005)
        self.encoder = slopes(np.zeros((K, delay * c)), 0.0)
        self.layers = nn.ParameterList()
        self.channels, self.readout = channels, readout

    def add_network(self, width: int, seed: int) -> None:
        """Put a network of two hidden layers on top, whose output is zero at first.

        Args:
            width: neurons of a layer.
            seed: of the weights.
        """
        K, n = self.encoder.shape[:2]
        generator = torch.Generator().manual_seed(seed)
        for out, into in ((width, n + self.encoder.shape[2] - 1), (width, width)):
            W = torch.randn(out, into, generator=generator, dtype=torch.float32) / into**0.5
            self.layers.append(nn.Parameter(W))
        self.layers.append(nn.Parameter(torch.zeros(K, width, dtype=torch.float32)))

    def lift(self, w: torch.Tensor, theta: torch.Tensor) -> torch.Tensor:
        """Return z (b, K) of windows (b, D c) and theta (b, r)."""
        K, n, both = self.encoder.shape
        parts = (w @ self.encoder.permute(0, 2, 1).reshape(K * both, n).T).reshape(len(w), K, both)
        z = parts[..., 0] + torch.einsum("bkr,br->bk", parts[..., 1:], theta)
        if len(self.layers) == 0:
            return z
        hidden = torch.cat([w, theta], dim=1)
        for W in self.layers[:-1]:
            hidden = torch.relu(hidden @ W.T)
        return z + hidden @ self.layers[-1].T

    def forecast(self, z: torch.Tensor, u: torch.Tensor, theta: torch.Tensor, horizons: np.ndarray, step: float):
        """Return the scaled force (b, H) at the horizons, from z (b, K) and the coming inputs (b, N, c - 1).

        z+ = A z + B u step by step; A is modal, so that a step is a few products.

        Args:
            z: (b, K).
            u: (b, N, c - 1), scaled.
            theta: (b, r).
            horizons: (H,) up to N [steps].
            step: [s].
        """
        at = torch.cat([torch.ones_like(theta[:, :1]), theta], dim=1)
        p = len(self.frequency)
        turn = torch.exp(at @ self.frequency.T) * step
        shrink = torch.exp(-torch.exp(at @ self.damping.T) * step)
        cos, sin = shrink * torch.cos(turn), shrink * torch.sin(turn)
        real = torch.exp(-torch.exp(at @ self.decay.T) * step)
        drive = torch.einsum("bki,bni->bnk", torch.einsum("kir,br->bki", self.inputs, at), u)
        x, y, rest = z[:, 0 : 2 * p : 2], z[:, 1 : 2 * p : 2], z[:, 2 * p :]
        dx, dy, d_rest = drive[..., 0 : 2 * p : 2], drive[..., 1 : 2 * p : 2], drive[..., 2 * p :]
        course = [x.sum(1) + rest.sum(1)]
        for i in range(int(horizons[-1])):
            x, y = cos * x - sin * y + dx[:, i], sin * x + cos * y + dy[:, i]
            rest = real * rest + d_rest[:, i]
            course.append(x.sum(1) + rest.sum(1))
        return torch.stack([course[int(h)] for h in horizons], dim=1)

    def export(self, share: float = 1.0) -> ModalAxis:
        """Return the axis in numpy.

        Args:
            share: of the network's output that is kept [1].
        """
        arrays = {name: getattr(self, name).detach().numpy().astype(float) for name in ARRAYS}
        weights = [W.detach().numpy().astype(float) for W in self.layers]
        if weights and share > 0:
            weights[-1] = share * weights[-1]
        return ModalAxis(self.channels, self.readout, **arrays, layers=tuple(weights) if share > 0 else ())
