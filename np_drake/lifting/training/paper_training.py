"""Training of the `paper` configuration: Algorithm 1, made well-posed.

What the paper leaves open is settled as follows (docs/reference/predictor.md lists it with reasons
and effects):
- The window's least squares for A, B has 30 columns and 39 rows of median rank 15: it is Bayesian
  regression about a prior A_0, B_0 shared by all windows: least squares over all of them, renewed
  every epoch, and in flight the offline model. How far windows stray from it is the evidence of the
  windows themselves (`most_likely_ridge`).
- B_0 is shrunk along directions of zeta that the flights do not excite.
- Stable: A_0 and each window's A are made stable as in flight before they are iterated.
- Backward in time, A^-1 of a stable A grows like |lambda|^-40. A is inverted in the least-squares
  sense: the window fit of z_k on z_(k+1) and zeta_k, about a backward prior, made stable the same
  way.
- mu carries the trajectory index in the paper, so that late trajectories count less; here it
  discounts the
  prediction step: mean over j of mu^j |z_j - z_hat_j|².
- chi enters Phi over one scale for force and one for torque; gamma is the Lipschitz constant there.
- A causal label lags behind its zero-phase target, and Phi, which sees one instant, cannot undo
  that: each label stands beside the zeta of its own time, in training and in flight.
- Every window is turned by quarter turns about the vertical or mirrored: a circle in one direction
  locks force and velocity in a relation that no other flight has. So the mean wrench is vertical,
  and the A that flies forgets departures from it within a window: one instant of chi does not show
  the phase of a swing, and a forecast that holds one pumps it.
"""

import dataclasses as dc
import itertools

import numpy as np
import torch
from torch import nn

from np_drake.lifting.model.lifted_linear_system import RADIUS, LiftedLinearSystem, Phi, stabilized
from np_drake.lifting.model.lifted_model import PAPER, LiftedModel
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.excitation import measure_excitation, turns
from np_drake.training_data.segments import Segment, check_segments, group_scale


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
        """Return the map in numpy."""
        weights = tuple(W.detach().numpy() for W in self.weights())
        return Phi(weights, self._scale.numpy().copy())


def normalised(W: torch.Tensor, gain: float) -> torch.Tensor:
    """Return a matrix of largest singular value `gain` along W, with its gradient.

    Args:
        gain: [1].
    """
    with torch.no_grad():
        U, _, Vh = torch.linalg.svd(W, full_matrices=False)
    return W * (gain / (U[:, 0] @ W @ Vh[0]))


def descend_once(optimiser: torch.optim.Optimizer, loss: torch.Tensor) -> None:
    """Take one step of gradient descent, no longer than 1 in all parameters together."""
    optimiser.zero_grad()
    loss.backward()
    parameters = [value for group in optimiser.param_groups for value in group["params"]]
    torch.nn.utils.clip_grad_norm_(parameters, 1.0)
    optimiser.step()


def _initial_weights(sizes: list[int], generator: torch.Generator) -> list[torch.Tensor]:
    """Return layers whose first outputs carry chi itself, as relu(chi) - relu(-chi), beside random
    features.

    So chi = C z holds from the start and training need not find the identity first. Own choice: one
    step ahead on a real flight the error is 0.8 of persistence's this way, and 8 times it from a
    plain random start.
    """
    weights, eye = [], torch.eye(6, dtype=torch.float64)
    between = [torch.eye(12, dtype=torch.float64)] * (len(sizes) - 3)
    carriers = [torch.cat([eye, -eye]), *between, torch.cat([eye, -eye], dim=1)]
    for (inputs, outputs), carrier in zip(itertools.pairwise(sizes), carriers, strict=False):
        raw = torch.randn(outputs, inputs, generator=generator, dtype=torch.float64)
        raw = raw / torch.linalg.matrix_norm(raw, 2)
        raw[: len(carrier)] = 0.0
        raw[: len(carrier), : carrier.shape[1]] = carrier
        weights.append(raw)
    return weights


RIDGES = tuple(
    10.0**k for k in range(9)
)  # that are tried, up to no refit at all [samples of unit size]
NULL = 1e-4  # of the mean power, added to that of every direction: Phi may have null directions [1]
EXACT = 1e-12  # variance of labels that are exact, over their scale [1]


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
    X, Y = X.reshape(-1, X.shape[-1]), Y.reshape(-1, Y.shape[-1])
    normal = X.T @ X
    normal += (ridge * normal.diagonal().mean() + 1e-12) * torch.eye(len(normal), dtype=X.dtype)
    return torch.linalg.solve(normal, X.T @ Y)


def window_fit(
    X: torch.Tensor, Y: torch.Tensor, prior: torch.Tensor, ridge: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return A' (b, K, K), stable, and B' (b, 6, K) of each window: the posterior mean, as
    `WindowRefit` has it.

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


def most_likely_ridge(
    z: torch.Tensor, zeta: torch.Tensor, goal: torch.Tensor, C: torch.Tensor, priors: torch.Tensor
) -> float:
    """Return the ridge under which what follows the windows of a training is most likely [samples
    of unit size].

    A window's own A, B, fitted under the ridge, forecast the next window from its first sample on.
    Of the error at every step ahead, normal with a covariance of its own, the log likelihood at its
    maximum is
    -n/2 log|covariance| + const; summed over the steps, it is the evidence of the ridge. The
    likelihood of the windows themselves, one step ahead, would ask for matrices of their own
    wherever the network is bent; these pump a swing.
    Source: prequential likelihood, Dawid 1984.

    Args:
        z: (n, 2 W, K) of a window and the next.
        zeta: (n, 2 W, 6).
        goal: (n, 2 W, 6) chi / scale.
        C: (6, K) reads it out of z.
        priors: (n, K + 6, K) mean of the prior of each, learned on windows at other times: about a
            prior that knows a window already, nothing would be left to learn in flight.
    """
    X, Y = regression(z, zeta)
    K, last = z.shape[-1], z.shape[1] // 2 - 1  # of the window
    evidence = []
    for ridge in RIDGES:
        A, B = window_fit(X[:, :last], Y[:, :last], priors, ridge)
        state, found = z[:, last], 0.0
        for j in range(last, X.shape[1]):
            state = (state[:, None] @ A + X[:, j, None, K:] @ B)[:, 0]
            error = state @ C.T - goal[:, j + 1]
            covariance = error.T @ error / len(error) + EXACT * torch.eye(
                error.shape[1], dtype=error.dtype
            )
            found -= 0.5 * len(error) * torch.logdet(covariance).item()
        evidence.append(found)
    return RIDGES[int(np.argmax(evidence))]


def forgetful(A: torch.Tensor, z: torch.Tensor, window: int) -> torch.Tensor:
    """Return A' (K, K) with modes that decay within a window, but for the level of z.

    z = m (l'z) + rest: m is its mean, and the level l'z, least squares of 1, stays.

    Args:
        A: (K, K), transposed.
        z: (..., K) of the training.
        window: time constant [samples].
    """
    Z = z.reshape(-1, z.shape[-1])
    mean, level = Z.mean(dim=0), global_fit(Z, torch.ones(len(Z), 1, dtype=Z.dtype))[:, 0]
    decaying = stable(A, np.exp(-1.0 / window))
    return stable(decaying + torch.outer(level / (level @ mean), mean - mean @ decaying))


def stable(A: torch.Tensor, radius: float = RADIUS) -> torch.Tensor:
    """Make A (..., K, K) stable as `stabilized` does in flight; what that adds is taken as a
    constant in gradients.

    Args:
        A: (..., K, K).
        radius: largest |eigenvalue| [1].
    """
    given = A.detach().numpy()
    each = [stabilized(one, radius) for one in given.reshape(-1, *given.shape[-2:])]
    found = np.reshape(each, given.shape)
    return A + torch.from_numpy(found - given)


BLOCKS = 4  # of time; the windows of one are judged about the prior of the others [1]


@dc.dataclass(frozen=True)
class PaperConfig:
    """Parameters of the `paper` configuration: Phi of the instantaneous chi, A and B refit on a
    window.
    """

    size: int = 24  # K [1]
    width: int = 128  # neurons of a hidden layer [1]
    layers: int = 2  # hidden layers, L [1]
    gamma: float = 1.0  # Lipschitz constant of Phi in scaled coordinates [1]
    window: int = 40  # samples of a window [1]
    beta: tuple[float, float, float] = (
        1.0,
        1.0,
        1.0,
    )  # weights: forward, backward, reconstruction [1]
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
    """State of one training run: Phi, C, priors, optimiser, epoch."""

    def __init__(self, segments: list[Segment], config: PaperConfig):
        self.config, self.late = config, max((segment.late for segment in segments), default=0)
        segments = [
            segment.in_time for segment in check_segments(segments, 2 * config.window + self.late)
        ]
        self.step = float(np.median([segment.step for segment in segments]))
        self.samples = sum(map(len, segments))
        self.chi_scale = group_scale([segment.chi for segment in segments], centred=False)
        self.zeta_scale = group_scale([segment.zeta for segment in segments], centred=False)
        self._scale = torch.from_numpy(self.chi_scale)
        zeta = [segment.zeta for segment in segments]
        if config.symmetric:
            zeta = [image for piece in zeta for image in turns(piece)]
        self.excitation = measure_excitation(zeta, step=self.step)
        self._seen = torch.from_numpy(
            self.excitation.shrink.T * self.zeta_scale[:, None] / self.zeta_scale
        )
        self._chi, self._zeta = _windows(segments, config, self.zeta_scale)
        pairs = dc.replace(config, window=2 * config.window, spacing=config.window)
        self._pairs = _windows(
            segments, pairs, self.zeta_scale
        )  # a window and the one that follows it
        self.phi = PhiModule(
            width=config.width,
            layers=config.layers,
            K=config.size,
            gamma=config.gamma,
            scale=self.chi_scale,
            seed=config.seed,
        )
        self.C = nn.Parameter(torch.zeros(6, config.size, dtype=torch.float64))
        with torch.no_grad():
            self.C.copy_(self._best_readout(self.phi(self._chi)))
        self.optimiser = torch.optim.Adam([*self.phi.raw, self.C], lr=config.learning_rate)
        self._rate = torch.optim.lr_scheduler.CosineAnnealingLR(
            self.optimiser, max(config.epochs, 1), config.learning_rate / 10
        )
        self.epoch, self.history = 0, list[float]()

    def run_epoch(self) -> float:
        """Make one pass over the windows in an order drawn from (seed, epoch) and return the mean
        loss.
        """
        order = np.random.default_rng([self.config.seed, self.epoch]).permutation(len(self._chi))
        losses = []
        self._fit_priors()
        for start in range(0, len(order), self.config.batch):
            batch = torch.from_numpy(order[start : start + self.config.batch])
            loss = self.loss(self._chi[batch], self._zeta[batch])
            descend_once(self.optimiser, loss)
            losses.append(loss.item())
        self._rate.step()
        self.epoch += 1
        self.history.append(float(np.mean(losses)))
        return self.history[-1]

    def loss(self, chi: torch.Tensor, zeta: torch.Tensor) -> torch.Tensor:
        """Return beta_1 L_forward + beta_2 L_backward + beta_3 L_recons of a batch of windows.

        Args:
            chi: (b, W, 6) [N, N·m].
            zeta: (b, W, 6), scaled.
        """
        z = self.phi(chi)
        reconstruction = ((chi / self._scale - z @ self.C.T) ** 2).mean()
        forward = self._rollout_error(z, zeta, self.forward_prior, backward=False)
        backward = self._rollout_error(z, zeta, self.backward_prior, backward=True)
        b = self.config.beta
        return b[0] * forward + b[1] * backward + b[2] * reconstruction

    def model(self) -> LiftedModel:
        """Return the trained model, with C as the least-squares readout of the final Phi, as
        L_recons asks for.
        """
        self._fit_priors()
        A, B = self.forward_prior[: self.config.size], self.forward_prior[self.config.size :]
        with torch.no_grad():
            z = self.phi(self._chi)
            C = self._best_readout(z).numpy() * self.chi_scale[:, None]
            if self.config.symmetric:
                A = forgetful(A, z, self.config.window)
        system = LiftedLinearSystem(A.numpy().T, B.numpy().T / self.zeta_scale, C, self.step)
        summary = {
            "samples": self.samples,
            "epochs": self.epoch,
            "loss": self.history[-1] if self.history else None,
            "gamma": self.config.gamma,
            "excitation": self.excitation.text,
        }
        return LiftedModel(
            PAPER,
            system,
            self.phi.export(),
            self.config.window + self.late,
            self.chi_scale,
            self.zeta_scale,
            summary,
            ridge=self.ridge,
            late=self.late,
        )

    def _fit_priors(self) -> None:
        """Fit the priors of this epoch, and how surely they hold in a window, with the present
        Phi.
        """
        with torch.no_grad():
            z, (chi, zeta) = self.phi(self._chi), self._pairs
            self.forward_prior, self.backward_prior = self._prior(z), self._prior(z, backward=True)
            others = torch.stack([self._prior(z, without=block) for block in range(BLOCKS)])
            self.ridge = most_likely_ridge(
                self.phi(chi), zeta, chi / self._scale, self.C, others[_blocks(len(chi))]
            )

    def _prior(self, z: torch.Tensor, *, backward: bool = False, without: int = -1) -> torch.Tensor:
        """Return [A_0 B_0]' (K + 6, K) over all windows, or all without those of a block of time.

        A is stable, B without zeta along unexcited directions.
        """
        kept = _blocks(len(z)) != without
        X, Y = regression(z[kept], self._zeta[kept], backward=backward)
        K = Y.shape[-1]
        fit = global_fit(torch.cat([X[..., :K], X[..., K:] @ self._seen], dim=-1), Y)
        return torch.cat([stable(fit[:K]), self._seen @ fit[K:]])

    def _best_readout(self, z: torch.Tensor) -> torch.Tensor:
        """Return the least squares of chi / scale on z over all windows, ridge 1e-6 of the mean
        power, (6, K).
        """
        return global_fit(z, self._chi / self._scale, 1e-6).T

    def _rollout_error(self, z, zeta, prior, *, backward: bool) -> torch.Tensor:
        """Return the discounted mean square of the multi-step error in z, with each window's own A
        and B.
        """
        X, Y = regression(z, zeta, backward=backward)
        A, B = window_fit(X, Y, prior, self.ridge)
        drive = X[..., z.shape[-1] :] @ B
        course = z.flip(1) if backward else z
        drive = drive.flip(1) if backward else drive
        state, error = course[:, 0], torch.zeros((), dtype=z.dtype)
        for j in range(drive.shape[1]):
            state = torch.baddbmm(drive[:, j, None], state[:, None], A)[:, 0]
            error = error + self.config.mu ** (j + 1) * ((state - course[:, j + 1]) ** 2).mean()
        return error / drive.shape[1]


def train_paper(
    segments: list[Segment], config: PaperConfig, on_epoch: OnEpoch
) -> tuple[LiftedModel, list[float]]:
    """Return (model, loss after each epoch)."""
    trainer = PaperTrainer(segments, config)
    while trainer.epoch < config.epochs:
        loss = trainer.run_epoch()
        on_epoch(trainer.epoch, config.epochs, loss)
    return trainer.model(), trainer.history


def _blocks(count: int) -> np.ndarray:
    """Return the block of time of each of so many windows, (count,)."""
    return np.arange(count) * BLOCKS // max(count, 1)


def _windows(
    segments: list[Segment], config: PaperConfig, zeta_scale: np.ndarray
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return chi in physical units and scaled zeta of all windows, (b, W, 6) each."""
    starts = [
        (segment, k)
        for segment in segments
        for k in range(0, len(segment) - config.window + 1, config.spacing)
    ]
    starts = starts[:: max(1, -(-len(starts) // config.max_windows))]
    chi = np.stack([segment.chi[k : k + config.window] for segment, k in starts])
    zeta = np.stack([segment.zeta[k : k + config.window] for segment, k in starts])
    if config.symmetric:
        image = np.array(turns(np.eye(6)))[
            np.random.default_rng(config.seed).integers(8, size=len(starts))
        ]
        chi, zeta = chi @ image, zeta @ image
    return torch.from_numpy(chi), torch.from_numpy(zeta / zeta_scale)
