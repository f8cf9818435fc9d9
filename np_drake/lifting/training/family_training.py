"""Training of `lifted`: one family of lifted linear systems over many flights, with theta of each.

    mean over flights and horizons h of mean_k (f_(k+h) - C z_(k+h|k))² / (that of persistence) +
    penalty |theta|²

(a hierarchical model, its maximum a posteriori by Adam). The prior of theta is its spread over the
flights. The noise of its update in flight is what the forecasts are wrong by at each flight's own
theta, times the correlation between updates. Flights of one vehicle with many payloads, simulated
ones too, make a family that a minute with one's own payload then places (`placed`).
"""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np
import scipy.linalg
import torch

from np_drake.lifting.model.adaptive_family import EVERY, AdaptiveFamily, ModalAxis
from np_drake.lifting.model.lifted_model import LIFTED, LiftedModel
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.excitation import (
    Block,
    View,
    measure_excitation,
    symmetric_blocks,
    training_summary,
    turns,
)
from np_drake.lifting.training.linear_fits import horizon_grid
from np_drake.training_data.segments import Segment, check_segments, group_scale

MOST_WINDOWS = 40_000  # over which the principal components are taken [1]


@dc.dataclass(frozen=True)
class WindowMoments:
    """Moments of F flights along one axis, its views pooled.

    whitening: (n, D c) map of a window to its principal components, of unit variance over all
        flights.
    gram: (F, p, p) of [white window (n), coming inputs (H (c - 1))], the variance of white noise in
        them added.
    cross: (F, p, h) with the force at the horizons.
    square: (F, h) of the force.
    power: (F, h) mean square of the error of persistence, the variance of the noise added.
    """

    whitening: np.ndarray
    gram: np.ndarray
    cross: np.ndarray
    square: np.ndarray
    power: np.ndarray


def window_moments(
    seen: list[np.ndarray],
    goals: list[np.ndarray],
    *,
    delay: int,
    horizons: np.ndarray,
    noise: tuple[float, float],
) -> WindowMoments:
    """Return the moments of flights.

    Args:
        seen: of each flight, (V, n, c) samples as the views see them, the force first [scaled].
        goals: of each flight, (V, n) the force that is to be foreseen [scaled].
        horizons: (h,) ascending [steps].
        noise: deviation of white noise that the window and the coming inputs are taken to have
            [scaled].
    """
    H, total = int(horizons[-1]), sum(s.shape[0] * s.shape[1] for s in seen)
    stride = max(1, total // MOST_WINDOWS)
    some = np.concatenate(
        [_windows(s, delay)[:, ::stride].reshape(-1, delay * s.shape[2]) for s in seen]
    )
    power, directions = np.linalg.eigh(some.T @ some / len(some))
    told = power > noise[0] ** 2
    scale = 1.0 / np.sqrt(power[told] + noise[0] ** 2)
    whitening = scale[:, None] * directions[:, told].T
    coming = seen[0].shape[2] - 1
    variance = np.concatenate([(noise[0] * scale) ** 2, np.full(H * coming, noise[1] ** 2)])
    rows: list[tuple] = []
    for s, goal in zip(seen, goals, strict=True):
        now = np.arange(delay - 1, s.shape[1] - H)
        w = _windows(s, delay)[:, : len(now)].reshape(s.shape[0], len(now), -1) @ whitening.T
        u = s[:, now[:, None] + np.arange(H), 1:].reshape(s.shape[0], len(now), -1)
        X = np.concatenate([w, u], axis=2).reshape(-1, len(variance))
        Y = goal[:, now[:, None] + horizons].reshape(-1, len(horizons))
        still = np.mean((Y - s[:, now, 0].reshape(-1, 1)) ** 2, axis=0) + noise[0] ** 2
        rows.append(
            (X.T @ X / len(X) + np.diag(variance), X.T @ Y / len(X), np.mean(Y**2, axis=0), still)
        )
    return WindowMoments(whitening, *(np.stack(part) for part in zip(*rows, strict=True)))


def _windows(seen: np.ndarray, delay: int) -> np.ndarray:
    """Return every window of (V, n, c), oldest sample first, (V, n - D + 1, D, c)."""
    return np.lib.stride_tricks.sliding_window_view(seen, delay, axis=1).swapaxes(2, 3)


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
        self._gram, self._cross = single(moments.gram), single(moments.cross)
        self._square, self._weight = single(moments.square), single(weight / weight.shape[1])
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


def single(values: np.ndarray) -> torch.Tensor:
    """Return an array in single precision."""
    return torch.from_numpy(np.ascontiguousarray(values)).float()


def descend_once(optimiser: torch.optim.Optimizer, loss: torch.Tensor) -> None:
    """Take one step of gradient descent, no longer than 1 in all parameters together."""
    optimiser.zero_grad()
    loss.backward()
    parameters = [value for group in optimiser.param_groups for value in group["params"]]
    torch.nn.utils.clip_grad_norm_(parameters, 1.0)
    optimiser.step()


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
        value = loss(some)
        descend_once(optimiser, value)
        schedule.step()
        losses.append(value.item())
        on_step(number, losses[-1])
    return losses


LEAST = 1e-12  # variance of what an axis misses, where nothing ever acts along it [scaled]
NOISE_FLIGHTS = 40  # over which the noise of theta's update is measured, at most [1]


@dc.dataclass(frozen=True)
class LiftedConfig:
    """Parameters of `lifted`. Force, v and omega are each divided by one scale.

    Modes start between the swing of long tethers and twice that of short ones.
    """

    delay: int = 50  # samples that the encoder sees [1]
    horizon: int = 40  # longest prediction in the loss [steps]
    horizons: int = 10  # how many of it, closer together near 0 [1]
    size: int = 12  # entries of theta, fewer than flights [1]
    torque: bool = False  # predict the torque too; else the predictor holds it
    lateral: tuple[float, ...] = (0.064, 0.1, 0.16)  # of the pairs of x and y at first [rad/sample]
    vertical: tuple[float, ...] = (0.12, 0.3)  # of those of z [rad/sample]
    decays: tuple[float, ...] = (4e-4, 0.1)  # of the real modes at first [1/sample]
    steps: int = 2500  # of gradient descent [1]
    batch: int = 96  # flights of a step [1]
    rate: float = (
        5e-3  # of learning, falling to a hundredth along a cosine; theta five times as much [1]
    )
    penalty: float = 1e-3  # of theta, which sets its unit [1]
    zeta_noise: float = (
        0.01  # that the coming zeta is taken to have; it keeps B from amplifying noise [scaled]
    )
    label_noise: float = 0.01  # that the encoder's samples are taken to have [scaled]
    lags: tuple[int, ...] = (12, 25)  # over which forecasts are compared in flight [steps]
    memory: float = (
        1000.0  # samples after which theta has returned to its prior; the payload may change
    )
    seed: int = 0


def train_lifted(
    segments: list[Segment], config: LiftedConfig, on_epoch: OnEpoch
) -> tuple[LiftedModel, list[float]]:
    """Return (model, loss after each step) of the `lifted` configuration.

    Args:
        segments: uninterrupted flights at one step, theta of each its own.
    """
    segments = check_segments(
        segments, max(config.delay + config.horizon, config.delay + max(config.lags)) + 1
    )
    step = float(np.median([segment.step for segment in segments]))
    chi_scale = group_scale([segment.goal for segment in segments], centred=True)
    zeta_scale = group_scale([segment.zeta for segment in segments], centred=True)
    rng = np.random.default_rng(config.seed)
    config = dc.replace(config, size=min(config.size, len(segments) - 1))
    views: list[tuple[np.ndarray, np.ndarray]] = []
    axes: list[TrainedAxis] = []
    images = [image for segment in segments for image in turns(segment.zeta)]
    seen = measure_excitation(images, step=step).shrink
    for block in symmetric_blocks(torque=config.torque):
        views.append(_views(block, chi_scale, zeta_scale, seen))
        axes.append(_trained_axis(block, views[-1][0], segments, chi_scale, config, rng))
    theta = (
        torch.from_numpy(0.1 * rng.standard_normal((len(segments), config.size)))
        .float()
        .requires_grad_()
    )

    def loss(some: torch.Tensor) -> torch.Tensor:
        each = torch.stack([axis.loss(some, theta[some]) for axis in axes]).sum(0)
        return each.mean() + config.penalty * theta[some].pow(2).sum() / max(theta[some].numel(), 1)

    arrays = [array for axis in axes for array in axis.parameters]
    losses = descend(
        loss,
        arrays,
        theta,
        steps=config.steps,
        batch=config.batch,
        rate=config.rate,
        seed=config.seed,
        on_step=lambda number, value: on_epoch(number + 1, config.steps, value),
    )
    trained = [axis.export(*view, step) for axis, view in zip(axes, views, strict=True)]
    family = _family(trained, theta.detach().numpy().astype(float), config, segments, step)
    summary = training_summary(segments, losses[-1], step) | {"flights": len(segments)}
    system = family.system(family.mean, step)
    return LiftedModel(
        LIFTED, system, family, family.window, chi_scale, zeta_scale, config.torque, summary
    ), losses


def placed(model: LiftedModel, segments: Sequence[Segment]) -> LiftedModel:
    """Return the model with theta's mean where these flights leave it; its covariance stays, as
    payloads may change.
    """
    family = model.encoder
    if not isinstance(family, AdaptiveFamily):
        raise ValueError(
            f"prior: must be a family of systems, {LIFTED}; got {model.configuration}."
        )
    segments = check_segments(list(segments), family.window + EVERY)
    if abs(segments[0].step / model.step - 1) > 0.02:
        raise ValueError(
            f"prior: was trained at {model.step:g} s a sample; the flights have "
            f"{segments[0].step:g} s."
        )
    found = []
    for segment in segments:
        *_, (_, theta) = family.estimates(np.hstack([segment.chi, segment.zeta]), model.step)
        found.append(theta)
    weights = [len(segment) for segment in segments]
    family = dc.replace(family, mean=np.average(found, axis=0, weights=weights))
    return dc.replace(model, encoder=family, system=family.system(family.mean, model.step))


def _views(
    block: Block, chi_scale: np.ndarray, zeta_scale: np.ndarray, seen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return channels (V, c, 12), of zeta the part `seen` (6, 6), and readout (V, 6) of views, see
    `ModalAxis`.
    """
    scaled = scipy.linalg.block_diag(np.diag(1.0 / chi_scale), seen / zeta_scale[:, None])
    readout = np.stack([view.output for view in block.views]) * chi_scale
    return np.stack([_channels(view) for view in block.views]) @ scaled, readout


def _channels(view: View) -> np.ndarray:
    """Return (c, 12) what a view takes of [chi, zeta]."""
    return np.vstack(
        [
            np.concatenate([view.output, np.zeros(6)]),
            np.hstack([np.zeros((len(view.inputs), 6)), view.inputs]),
        ]
    )


def _trained_axis(
    block: Block,
    channels: np.ndarray,
    segments: list[Segment],
    chi_scale: np.ndarray,
    config: LiftedConfig,
    rng: np.random.Generator,
) -> TrainedAxis:
    """Return the axis of a block before its descent."""
    c = config
    seen = [np.hstack([s.chi, s.zeta]) @ channels.swapaxes(1, 2) for s in segments]
    goals = [np.stack([s.goal / chi_scale @ view.output for view in block.views]) for s in segments]
    horizons = horizon_grid(c.horizon, c.horizons)
    noise = (c.label_noise, c.zeta_noise)
    moments = window_moments(seen, goals, delay=c.delay, horizons=horizons, noise=noise)
    modes = c.lateral if block.lateral else c.vertical
    return TrainedAxis(moments, horizons, modes=modes, decays=c.decays, size=c.size, rng=rng)


def _family(
    axes: list[ModalAxis],
    theta: np.ndarray,
    config: LiftedConfig,
    segments: list[Segment],
    step: float,
) -> AdaptiveFamily:
    """Return the family as fitted, the prior of theta (F, r) and the noise of its update."""
    lags = np.array(config.lags, float)
    away = theta - theta.mean(0)
    covariance = away.T @ away / max(len(theta) - 1, 1) + 1e-9 * np.eye(config.size)
    noise = np.ones((len(axes), len(lags)))
    if config.size:
        noise = np.stack([_update_noise(axis, segments, theta, config.lags, step) for axis in axes])
    return AdaptiveFamily(tuple(axes), theta.mean(0), covariance, lags, noise, config.memory * step)


def _update_noise(
    axis: ModalAxis, segments: list[Segment], theta: np.ndarray, lags: tuple[int, ...], step: float
) -> np.ndarray:
    """Return the deviations (l,) of `AdaptiveFamily.update`: of e_h at each flight's theta, times
    its correlation.

    n updates of correlated errors tell as much as n / (1 + 2 sum of their autocorrelations); errors
    of different lags are alike, and share what they tell.
    """
    steps, window = np.array(lags), axis.delay + max(lags)
    courses = []
    for s, own in list(zip(segments, theta, strict=True))[:NOISE_FLIGHTS]:
        samples = np.hstack([s.chi, s.zeta])
        ends = range(window, len(samples) + 1, EVERY)
        courses.append(
            np.stack(
                [axis.departures(own[None], samples[k - window : k], steps, step)[0] for k in ends]
            )
        )
    courses = [course for course in courses if len(course) > 1]
    return np.sqrt(
        [len(lags) * _spread([course[:, :, j] for course in courses]) for j in range(len(lags))]
    )


def _spread(series: list[np.ndarray]) -> float:
    """Return the variance of courses (n, V) about zero, times their correlation time in samples."""
    power = max(float(np.mean(np.concatenate([np.mean(s**2, axis=1) for s in series]))), LEAST)
    total, lag = 1.0, 1
    while lag < 200:
        pairs = [s[lag:] * s[:-lag] for s in series if len(s) > lag]
        if (
            not pairs
            or (now := float(np.mean(np.concatenate([np.mean(p, axis=1) for p in pairs])) / power))
            <= 0
        ):
            break
        total, lag = total + 2 * now, lag + 1
    return power * total
