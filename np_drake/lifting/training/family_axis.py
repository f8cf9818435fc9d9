"""Training of the arrays of a `ModalAxis` and of each flight's theta, on moments of flights."""

from collections.abc import Callable

import numpy as np
import torch

from np_drake.lifting.model.modal_axis import ModalAxis
from np_drake.lifting.training.family_moments import WindowMoments

ARRAYS = ("frequency", "damping", "decay", "inputs", "encoder")


class TrainedAxis:
    """Arrays of a `ModalAxis` as tensors in single precision, its modes a sample.

    Args:
        horizons: (h,) of the moments [steps].
        modes: (p,) frequencies of the pairs at first [rad/sample].
        decays: (q,) of the real modes at first [1/sample].
    """

    def __init__(
        self,
        moments: WindowMoments,
        horizons: np.ndarray,
        *,
        modes: tuple[float, ...],
        decays: tuple[float, ...],
        size: int,
        rng: np.random.Generator,
    ):
        self.horizons, self.whitening = horizons, moments.whitening
        n, H = len(moments.whitening), int(horizons[-1])
        K, coming = 2 * len(modes) + len(decays), (moments.gram.shape[1] - n) // H

        def slopes(first: np.ndarray, spread: float) -> torch.Tensor:
            drawn = spread * rng.standard_normal((*first.shape, size))
            return (
                torch.from_numpy(np.concatenate([first[..., None], drawn], axis=-1))
                .float()
                .requires_grad_()
            )

        # A new pair has lost a third of its swing after one period, a start from which it may lose
        # more or none.
        self.frequency = slopes(np.log(modes), 0.05)
        self.damping = slopes(np.log(np.array(modes) / 15.0), 0.0)
        self.decay = slopes(np.log(decays), 0.0)
        self.inputs = slopes(0.02 * rng.standard_normal((K, coming)), 0.005)
        self.encoder = slopes(np.zeros((K, n)), 0.0)
        weight = 1.0 / np.maximum(
            moments.power, (0.02**2 * moments.power.max(axis=1, keepdims=True))
        )
        self._gram, self._cross = _single(moments.gram), _single(moments.cross)
        self._square, self._weight = _single(moments.square), _single(weight / weight.shape[1])
        # Input j acts on the force h steps ahead through C A^(h-1-j) B
        since = horizons[:, None] - 1 - np.arange(H)
        self._since, self._acts = (
            torch.from_numpy(np.maximum(since, 0)),
            torch.from_numpy(since >= 0),
        )

    @property
    def parameters(self) -> list[torch.Tensor]:
        """What is fitted."""
        return [getattr(self, name) for name in ARRAYS]

    def loss(self, some: torch.Tensor, theta: torch.Tensor) -> torch.Tensor:
        """Return the mean square error of flights over that of persistence, mean over the horizons,
        (b,).

        Args:
            some: (b,) numbers of the flights.
            theta: (b, r) of each.
        """
        G, cross = self._forecasts(theta), self._cross[some]
        with torch.no_grad():
            M = self._gram[some] @ G
            of_gradient = (M * G).sum(1)
        # G' M - 2 G' cross, M = gram G; its gradient 2 (M - cross) needs no second product with
        # gram
        error = (2 * (M - cross) * G).sum(1) - of_gradient + self._square[some]
        return (error * self._weight[some]).sum(1)

    def _forecasts(self, theta: torch.Tensor) -> torch.Tensor:
        """Return the map from [window, coming inputs] to the force at the horizons, (F, p, h)."""
        at = torch.cat([torch.ones(len(theta), 1), theta], dim=1)
        ahead = torch.arange(int(self.horizons[-1]) + 1, dtype=theta.dtype)
        CA = readouts(at, self.frequency, self.damping, self.decay, ahead)
        encoder = torch.einsum("knr,fr->fnk", self.encoder, at)
        inputs = torch.einsum("kcr,fr->fck", self.inputs, at)
        response = inputs @ CA[..., :-1]  # (F, c - 1, H)
        drive = torch.where(self._acts, response[..., self._since], 0.0)  # (F, c - 1, h, H)
        driven = drive.permute(0, 3, 1, 2).flatten(1, 2)
        return torch.cat([encoder @ CA[..., self.horizons], driven], dim=1)

    def export(self, channels: np.ndarray, readout: np.ndarray, step: float) -> ModalAxis:
        """Return the axis, its modes a second.

        Args:
            channels: (V, c, 12), see `ModalAxis`.
            readout: (V, 6) [N].
            step: [s].
        """
        arrays = {name: getattr(self, name).detach().numpy().astype(float) for name in ARRAYS}
        for name in ("frequency", "damping", "decay"):
            arrays[name][..., 0] -= np.log(step)
        arrays["encoder"] = np.einsum("knr,nd->kdr", arrays["encoder"], self.whitening)
        return ModalAxis(channels, readout, **arrays)


def readouts(
    at: torch.Tensor,
    frequency: torch.Tensor,
    damping: torch.Tensor,
    decay: torch.Tensor,
    ahead: torch.Tensor,
) -> torch.Tensor:
    """Return C A^j at the times j ahead, (n, K, len(ahead)).

    Args:
        at: (n, 1 + r) [1, theta].
        frequency: (p, 1 + r) logarithms, see `ModalAxis`, in the unit of `ahead`.
        damping: (p, 1 + r), likewise.
        decay: (q, 1 + r), likewise.
    """
    turn = torch.exp(at @ frequency.T)[..., None] * ahead
    shrink = torch.exp(-torch.exp(at @ damping.T)[..., None] * ahead)
    real = torch.exp(-torch.exp(at @ decay.T)[..., None] * ahead)
    pairs = torch.stack([shrink * torch.cos(turn), -shrink * torch.sin(turn)], dim=2).flatten(1, 2)
    return torch.cat([pairs, real], dim=1)


def _single(values: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(values).float()


def descend(
    loss: Callable[[torch.Tensor], torch.Tensor],
    arrays: list[torch.Tensor],
    theta: torch.Tensor,
    *,
    steps: int,
    batch: int,
    rate: float,
    seed: int,
    on_step: Callable[[int, float], None],
) -> list[float]:
    """Minimise by Adam over some flights a step, and return the losses.

    Args:
        theta: (F, r), likewise, five times as fast.
        rate: of learning, falling to a hundredth along a cosine.
        on_step: called with (number, loss).
    """
    optimiser = torch.optim.Adam(
        [{"params": arrays, "lr": rate}, {"params": [theta], "lr": 5 * rate}]
    )
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps, eta_min=0.01 * rate)
    generator, losses = torch.Generator().manual_seed(seed), []
    for number in range(steps):
        some = torch.randperm(len(theta), generator=generator)[:batch]
        optimiser.zero_grad()
        value = loss(some)
        value.backward()
        torch.nn.utils.clip_grad_norm_([*arrays, theta], 1.0)
        optimiser.step()
        schedule.step()
        losses.append(value.item())
        on_step(number, losses[-1])
    return losses
