"""`ModalAxis` for training: the same map as a differentiable function of its arrays and of theta."""

import numpy as np
import torch
from torch import nn

from np_drake.lifting.model.modal_axis import ModalAxis

ARRAYS = ("frequency", "damping", "decay", "inputs", "encoder")


class AxisModule(nn.Module):
    """Differentiable `ModalAxis` in double precision.

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
            return nn.Parameter(torch.from_numpy(np.concatenate([first[..., None], drawn], axis=-1)))

        # A new pair has lost a third of its swing after one period, a start from which it may lose more or none.
        self.frequency = slopes(np.log(frequencies), 0.05)
        self.damping = slopes(np.log(np.array(frequencies) / 15.0), 0.0)
        self.decay = slopes(np.log(decays), 0.0)
        self.inputs = slopes(0.02 * rng.standard_normal((K, c - 1)), 0.005)
        self.encoder = slopes(np.zeros((K, delay * c)), 0.0)
        self.layers = nn.ParameterList()
        self.channels, self.readout = channels, readout
        C = np.concatenate([np.tile([1.0, 0.0], p), np.ones(q)])
        self.register_buffer("C", torch.from_numpy(C))

    def add_network(self, width: int, seed: int) -> None:
        """Put a network of two hidden layers on top, whose output is zero at first.

        Args:
            width: neurons of a layer.
            seed: of the weights.
        """
        K, n = self.encoder.shape[:2]
        generator = torch.Generator().manual_seed(seed)
        for out, into in ((width, n + self.encoder.shape[2] - 1), (width, width)):
            W = torch.randn(out, into, generator=generator, dtype=torch.float64) / into**0.5
            self.layers.append(nn.Parameter(W))
        self.layers.append(nn.Parameter(torch.zeros(K, width, dtype=torch.float64)))

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

        C A^h z + sum over j < h of C A^(h-1-j) B u_j in closed form, as A is modal.

        Args:
            z: (b, K).
            u: (b, N, c - 1), scaled.
            theta: (b, r).
            horizons: (H,) up to N [steps].
            step: [s].
        """
        at = torch.cat([torch.ones_like(theta[:, :1]), theta], dim=1)
        p, n = len(self.frequency), u.shape[1]
        k = torch.arange(n + 1, dtype=z.dtype)[None, :, None]
        turn, shrink = (torch.exp(at @ self.frequency.T) * step)[:, None], torch.exp(at @ self.damping.T)[:, None]
        size = torch.exp(-k * shrink * step)
        cos, sin = size * torch.cos(k * turn), size * torch.sin(k * turn)
        real = torch.exp(-k * torch.exp(at @ self.decay.T)[:, None] * step)
        B = torch.einsum("kir,br->bki", self.inputs, at)
        impulse = torch.einsum("bnp,bpi->bni", cos, B[:, 0 : 2 * p : 2])
        impulse = impulse - torch.einsum("bnp,bpi->bni", sin, B[:, 1 : 2 * p : 2])
        impulse = impulse + torch.einsum("bnq,bqi->bni", real, B[:, 2 * p :])
        h = torch.as_tensor(horizons)
        free = (cos[:, h] * z[:, None, 0 : 2 * p : 2] - sin[:, h] * z[:, None, 1 : 2 * p : 2]).sum(-1)
        free = free + (real[:, h] * z[:, None, 2 * p :]).sum(-1)
        before = h[:, None] - 1 - torch.arange(n)[None]
        response = impulse[:, before.clamp(min=0)] * (before >= 0).to(z.dtype)[None, :, :, None]
        return free + torch.einsum("bhni,bni->bh", response, u)

    def export(self, share: float = 1.0) -> ModalAxis:
        """Return the axis in numpy.

        Args:
            share: of the network's output that is kept [1].
        """
        arrays = {name: getattr(self, name).detach().numpy().copy() for name in ARRAYS}
        weights = [W.detach().numpy().copy() for W in self.layers]
        if weights and share > 0:
            weights[-1] = share * weights[-1]
        return ModalAxis(self.channels, self.readout, **arrays, layers=tuple(weights) if share > 0 else ())
