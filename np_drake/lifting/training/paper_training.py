"""Training of the `paper` configuration: Algorithm 1 of five samples, made well-posed.

What the paper leaves open is settled as follows (docs/reference/predictor.md lists it with reasons
and effects):
- Phi takes [chi, zeta] at five times of the last 0.66 s in place of chi now: one instant of the
  wrench does not show the phase of a swing. (Arrays in body axes, without payload: one sample.)
  Its first layer starts at the directions of these samples that foresee most.
- The window's least squares for A, B has 30 columns and 39 rows of median rank 15: it is Bayesian
  regression about a prior A_0, B_0 shared by all windows: least squares over all of them, renewed
  every epoch, and in flight the offline model.
- Stable: A_0 and each window's A are made stable as in flight before they are iterated.
- Backward in time, A^-1 of a stable A grows like |lambda|^-40. A is inverted in the least-squares
  sense: the window fit of z_k on z_(k+1) and zeta_k, about a backward prior, made stable the same
  way.
- mu carries the trajectory index in the paper, so that late trajectories count less; here it
  discounts the prediction step: mean over j of mu^j |z_j - z_hat_j|².
- Samples enter Phi over one scale for force, torque, v and omega each; gamma is the Lipschitz
  constant there.
- Every window is turned by quarter turns about the vertical or mirrored: a circle in one direction
  locks force and velocity in a relation that no other flight has.
"""

import dataclasses as dc
import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import torch
from torch import nn

from np_drake.lifting.model.lifted_linear_system import (
    RADIUS,
    Encoder,
    LiftedLinearSystem,
    Taps,
    stabilized,
)
from np_drake.lifting.model.lifted_model import PAPER, LiftedModel
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.excitation import TURNS, excitation
from np_drake.training_data.segments import Segment, check_segments, group_scale

# Of the samples that Phi sees, the newest 0, half a second in all at 50 Hz; own choice: a swing of
# 0.56 Hz has turned by a third
LAGS = (0, 8, 16, 24, 32)
# Of the offline A, B in a window's fit [samples of unit size]; own choice: a fourth of the window,
# so that forty samples outweigh the prior where they say something, and only there
RIDGE = 10.0


class PhiModule(nn.Module):
    """Spectrally normalised perceptron, W_hat = W / sigma(W) gamma^(1/(L+1)) in every layer.

    Its inputs are scaled, and gamma is the Lipschitz constant in those coordinates. sigma and its
    gradient u v^T come from a singular value decomposition, so that the bound holds for close
    singular values too, where a power iteration stands still early; training takes as long with
    either (own measurement).   Source: Jin et al. 2025, eq. (sn).

    Args:
        start: (k, inputs) map that its first k <= K outputs are at first, up to a factor.
        K: outputs.
        gamma: [1].
    """

    def __init__(
        self, *, start: np.ndarray, K: int, width: int, layers: int, gamma: float, seed: int
    ):
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        sizes = [start.shape[1], *[width] * layers, K]
        weights = _initial_weights(torch.from_numpy(start), sizes, generator)
        self.raw = nn.ParameterList(map(nn.Parameter, weights))
        self._layer_gain = gamma ** (1.0 / len(self.raw))

    def weights(self) -> list[torch.Tensor]:
        """Return the normalised weights, each of largest singular value gamma^(1/(L+1))."""
        return [normalised(W, self._layer_gain) for W in self.raw]

    def forward(self, samples: torch.Tensor) -> torch.Tensor:
        """Return z (..., K) of samples (..., inputs), scaled."""
        *hidden, last = self.weights()
        for W in hidden:
            samples = torch.relu(samples @ W.T)
        return samples @ last.T

    def export(self) -> tuple[np.ndarray, ...]:
        """Return the weights in numpy."""
        return tuple(W.detach().numpy() for W in self.weights())


def normalised(W: torch.Tensor, gain: float) -> torch.Tensor:
    """Return a matrix of largest singular value `gain` along W, with its gradient.

    Args:
        gain: [1].
    """
    with torch.no_grad():
        U, _, Vh = torch.linalg.svd(W, full_matrices=False)
    return W * (gain / (U[:, 0] @ W @ Vh[0]))


def gradient_step(
    loss: torch.Tensor, optimisers: Sequence[Any], parameters: Iterable[Any], *, longest: float
) -> float:
    """Take one step of all optimisers down the gradient of the loss, and return the loss.

    Args:
        parameters: whose gradients, taken together, are cut to the length `longest`.
    """
    for optimiser in optimisers:
        optimiser.zero_grad()
    loss.backward()
    nn.utils.clip_grad_norm_(parameters, longest)
    for optimiser in optimisers:
        optimiser.step()
    return loss.item()


def descend(
    optimiser: torch.optim.Optimizer,
    loss: Callable[[torch.Tensor], torch.Tensor],
    count: int,
    config: Any,
    *,
    on_epoch: OnEpoch,
    before_epoch: Callable[[], None] = lambda: None,
) -> list[float]:
    """Return the mean loss of each epoch, one pass over the windows in an order drawn from (seed,
    epoch); a step is no longer than 1 in all parameters together.

    Args:
        optimiser: its rate falls to a tenth along a cosine.
        loss: of the windows of these numbers.
        count: of windows.
        config: with epochs, batch, learning_rate and seed.
    """
    rate = torch.optim.lr_scheduler.CosineAnnealingLR(
        optimiser, max(config.epochs, 1), config.learning_rate / 10
    )
    history = list[float]()
    for epoch in range(config.epochs):
        before_epoch()
        order = torch.from_numpy(np.random.default_rng([config.seed, epoch]).permutation(count))
        losses = []
        for rows in order.split(config.batch):
            parameters = optimiser.param_groups[0]["params"]
            losses.append(gradient_step(loss(rows), [optimiser], parameters, longest=1.0))
        rate.step()
        history.append(float(np.mean(losses)))
        on_epoch(epoch + 1, config.epochs, history[-1])
    return history


def _initial_weights(
    start: torch.Tensor, sizes: list[int], generator: torch.Generator
) -> list[torch.Tensor]:
    """Return layers whose first outputs carry y = `start` x (k, inputs) as relu(y) - relu(-y),
    beside random features.

    So training need not find first what foresees. Own choice: one step ahead on a real flight the
    error is 0.8 of persistence's this way, and 8 times it from a plain random start.
    """
    eye = torch.eye(len(start), dtype=start.dtype)
    signs = torch.cat([eye, -eye])
    between = torch.eye(2 * len(start), dtype=start.dtype)
    carriers = [signs @ start, *[between] * (len(sizes) - 3), signs.T]
    weights = []
    for (inputs, outputs), carrier in zip(itertools.pairwise(sizes), carriers, strict=True):
        raw = torch.randn(outputs, inputs, generator=generator, dtype=start.dtype)
        raw = raw / torch.linalg.matrix_norm(raw, 2)
        raw[: len(carrier)] = 0.0
        raw[: len(carrier), : carrier.shape[1]] = carrier
        weights.append(raw)
    return weights


def foreseeing(past: np.ndarray, drive: np.ndarray, future: np.ndarray, count: int) -> np.ndarray:
    """Return directions of the past that foresee most of the future at known drive, (count, p), of
    unit variance, strongest first.

    future = past W' + drive V' + rest by least squares; the principal axes of past W'.
    Source: subspace identification, Van Overschee & De Moor 1996.

    Args:
        past: (n, p).
        drive: (n, q) from now on.
        future: (n, r).
    """
    X = np.hstack([past, drive])
    p = past.shape[1]
    normal = X.T @ X / len(X)
    normal += NULL * np.diag(np.diag(normal)) + FLOOR * np.eye(len(normal))
    W = np.linalg.solve(normal, X.T @ future / len(X))[:p]
    L = np.linalg.cholesky(normal[:p, :p])
    U = np.linalg.svd(L.T @ W, full_matrices=False)[0][:, :count]
    return np.linalg.solve(L.T, U).T


NULL = 1e-4  # of the mean power, added to that of every direction: Phi may have null directions [1]
FLOOR = 1e-6  # power of a direction that counts as still, of scaled samples [1]


def regression(
    z: torch.Tensor, zeta: torch.Tensor, *, backward: bool = False
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return regressors [z, zeta] (b, W-1, K+6) and targets (b, W-1, K): z_(k+1) from z_k, or z_k
    from z_(k+1).

    Args:
        z: (b, W, K).
        zeta: (b, W, 6).
    """
    before, after = (z[:, 1:], z[:, :-1]) if backward else (z[:, :-1], z[:, 1:])
    return torch.cat([before, zeta[:, :-1]], dim=-1), after


def global_fit(X: torch.Tensor, Y: torch.Tensor, ridge: float = NULL) -> torch.Tensor:
    """Return the least squares of Y (..., q) on X (..., d) over all rows, (d, q).

    Args:
        X: (..., d) regressors.
        Y: (..., q) targets.
        ridge: in units of the mean power [1].
    """
    X = X.reshape(-1, X.shape[-1])
    Y = Y.reshape(-1, Y.shape[-1])
    normal = X.T @ X
    normal += (ridge * normal.diagonal().mean() + 1e-12) * torch.eye(len(normal), dtype=X.dtype)
    return torch.linalg.solve(normal, X.T @ Y)


def window_fit(
    X: torch.Tensor, Y: torch.Tensor, prior: torch.Tensor, ridge: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return A' (b, K, K), stable, and B' (b, 6, K) of each window: the posterior mean, as
    `window_refit` has it.

    Args:
        X: (b, T, K + 6) regressors.
        Y: (b, T, K) targets.
        prior: (K + 6, K) mean of the prior, or one for each window.
        ridge: its precision [samples of unit size].
    """
    K = Y.shape[-1]
    normal = X.mT @ X + ridge * torch.eye(X.shape[-1], dtype=X.dtype)
    solution = prior + torch.cholesky_solve(X.mT @ (Y - X @ prior), torch.linalg.cholesky(normal))
    return stable(solution[:, :K]), solution[:, K:]


def stable(A: torch.Tensor) -> torch.Tensor:
    """Make A (..., K, K) stable as `stabilized` does in flight; what that adds is taken as a
    constant in gradients.

    Args:
        A: (..., K, K).
    """
    given = A.detach().numpy()
    each = [stabilized(one, RADIUS) for one in given.reshape(-1, *given.shape[-2:])]
    stabilised = np.reshape(each, given.shape)
    return A + torch.from_numpy(stabilised - given)


@dc.dataclass(frozen=True)
class PaperConfig:
    """Parameters of the `paper` configuration: Phi of five samples, A and B refit on a window."""

    size: int = 24  # K [1]
    lags: tuple[int, ...] = LAGS  # of the samples that Phi sees [samples]
    width: int = 128  # neurons of a hidden layer [1]
    layers: int = 2  # hidden layers, L [1]
    gamma: float = 1.0  # Lipschitz constant of Phi in scaled coordinates [1]
    window: int = 40  # samples of a window [1]
    # weights: forward, backward, reconstruction [1]
    beta: tuple[float, float, float] = 1.0, 1.0, 1.0
    mu: float = 0.999  # discount of a prediction step, forward and backward [1]
    # windows turned and mirrored, a horizontal force fades (in W, yaw near zero); else False
    symmetric: bool = True
    epochs: int = 8  # passes over the windows [1]
    batch: int = 32  # windows of a gradient step [1]
    spacing: int = 5  # samples between the starts of windows [1]
    learning_rate: float = 2e-3  # of Adam, falling to a tenth along a cosine [1]
    max_windows: int = 1000  # windows are thinned beyond [1]
    seed: int = 0  # of the initial weights and the order of windows


class PaperTrainer:
    """Phi, C and their priors, with the windows that they are trained on."""

    def __init__(self, segments: list[Segment], config: PaperConfig):
        # samples that Phi sees before a window
        self.config = config
        before = config.lags[-1]
        chi = [segment.chi for segment in segments]
        zeta = [segment.zeta for segment in segments]
        self.scale = np.concatenate([group_scale(of, centred=False) for of in (chi, zeta)])
        windows = _windows(segments, config) / self.scale
        lagged = [windows[:, before - lag : windows.shape[1] - lag] for lag in config.lags]
        self._samples = torch.from_numpy(np.concatenate(lagged, axis=-1))
        self.chi, self._zeta = torch.from_numpy(lagged[0]).split(6, dim=-1)
        self.phi = PhiModule(
            start=_start(lagged, config.size),
            K=config.size,
            width=config.width,
            layers=config.layers,
            gamma=config.gamma,
            seed=config.seed,
        )
        with torch.no_grad():
            self.C = nn.Parameter(self._best_readout())

    def loss(self, rows: torch.Tensor) -> torch.Tensor:
        """Return beta_1 L_forward + beta_2 L_backward + beta_3 L_recons of a batch of windows."""
        z = self.phi(self._samples[rows])
        zeta = self._zeta[rows]
        b1, b2, b3 = self.config.beta
        reconstruction = ((self.chi[rows] - z @ self.C.T) ** 2).mean()
        forward = rollout_error(z, zeta, self.forward_prior, self.config.mu, backward=False)
        backward = rollout_error(z, zeta, self.backward_prior, self.config.mu, backward=True)
        return b1 * forward + b2 * backward + b3 * reconstruction

    def model(self, step: float) -> LiftedModel:
        """Return the trained model, with C as the least-squares readout of the final Phi, as
        L_recons asks for.

        Args:
            step: between samples [s].
        """
        self.fit_priors()
        A, B = np.split(self.forward_prior.numpy().T, [self.config.size], axis=1)
        with torch.no_grad():
            C = self._best_readout().numpy() * self.scale[:6, None]
        unscaled = np.diag(1.0 / np.tile(self.scale, len(self.config.lags)))
        return LiftedModel(
            PAPER,
            LiftedLinearSystem(A, B / self.scale[6:], C, step),
            Encoder(Taps.at_lags(self.config.lags).expand(unscaled, 12), self.phi.export()),
            self.scale[6:],
            refit=self.config.window,
            ridge=RIDGE,
        )

    def fit_priors(self) -> None:
        """Fit the priors [A_0 B_0]' (K + 6, K) over all windows with the present Phi, A stable."""
        with torch.no_grad():
            z = self.phi(self._samples)
        self.forward_prior, self.backward_prior = (
            _prior(*regression(z, self._zeta, backward=backward)) for backward in (False, True)
        )

    def _best_readout(self) -> torch.Tensor:
        """Return the least squares of chi / scale on z over all windows, ridge 1e-6 of the mean
        power, (6, K).
        """
        return global_fit(self.phi(self._samples), self.chi, 1e-6).T


def _prior(X: torch.Tensor, Y: torch.Tensor) -> torch.Tensor:
    fit = global_fit(X, Y)
    K = Y.shape[-1]
    return torch.cat([stable(fit[:K]), fit[K:]])


def rollout_error(
    z: torch.Tensor, zeta: torch.Tensor, prior: torch.Tensor, mu: float, *, backward: bool
) -> torch.Tensor:
    """Return the discounted mean square of the multi-step error in z, with each window's own A and
    B.

    Args:
        z: (b, W, K).
        zeta: (b, W, 6), scaled.
        prior: (K + 6, K) of that direction of time.
        mu: discount of a step [1].
    """
    X, Y = regression(z, zeta, backward=backward)
    A, B = window_fit(X, Y, prior, RIDGE)
    drive = X[..., z.shape[-1] :] @ B
    if backward:
        z = z.flip(1)
        drive = drive.flip(1)
    state = z[:, 0]
    error = torch.zeros((), dtype=z.dtype)
    for j in range(drive.shape[1]):
        state = torch.baddbmm(drive[:, j, None], state[:, None], A)[:, 0]
        error = error + mu ** (j + 1) * ((state - z[:, j + 1]) ** 2).mean()
    return error / drive.shape[1]


def train_paper(
    segments: list[Segment], config: PaperConfig, on_epoch: OnEpoch
) -> tuple[LiftedModel, list[float]]:
    """Return (model, loss after each epoch)."""
    segments = check_segments(segments, config.window + config.lags[-1])
    trainer = PaperTrainer(segments, config)
    optimiser = torch.optim.Adam([*trainer.phi.raw, trainer.C], lr=config.learning_rate)
    history = descend(
        optimiser,
        trainer.loss,
        len(trainer.chi),
        config,
        on_epoch=on_epoch,
        before_epoch=trainer.fit_priors,
    )
    model = trainer.model(float(np.median([segment.step for segment in segments])))
    summary = {
        "samples": sum(map(len, segments)),
        "epochs": config.epochs,
        "loss": history[-1] if history else None,
        "gamma": config.gamma,
        "excitation": excitation(segments),
    }
    return dc.replace(model, summary=summary), history


def _windows(segments: list[Segment], config: PaperConfig) -> np.ndarray:
    """Return [chi, zeta] of all windows and the samples that Phi sees before, (b, n, 12)."""
    length = config.window + config.lags[-1]
    starts = [
        (np.hstack([segment.chi, segment.zeta]), k)
        for segment in segments
        for k in range(0, len(segment) - length + 1, config.spacing)
    ]
    starts = starts[:: max(1, -(-len(starts) // config.max_windows))]
    windows = np.stack([samples[k : k + length] for samples, k in starts])
    if config.symmetric:
        windows = windows @ IMAGES[np.random.default_rng(config.seed).integers(8, size=len(starts))]
    return windows


IMAGES = np.kron(np.eye(2), TURNS)  # (8, 12, 12) of rows [chi, zeta]


def _start(lagged: list[np.ndarray], count: int) -> np.ndarray:
    """Return orthonormal directions of the samples of windows (b, W, 12) at each lag that foresee
    most of the rest of the window, (count, inputs); all of them where there are fewer.
    """
    past = np.concatenate([one[:, 0] for one in lagged], axis=-1)
    now = lagged[0]
    drive = now[:, :-1, 6:]
    future = now[:, 1:, :6]
    directions = foreseeing(past, drive.reshape(len(now), -1), future.reshape(len(now), -1), count)
    return np.linalg.qr(directions.T)[0].T
