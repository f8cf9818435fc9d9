"""Training of `lifted` and `neural`: one family of lifted linear systems over many flights, theta of each among them.

    sum over flights, origins k and horizons h of (weight_h (f_(k+h) - C z_(k+h|k)))² + |theta|² of each flight

(a hierarchical model, its maximum a posteriori by gradient descent). The prior of theta is its spread over the flights;
the noise of its update in flight is what the forecasts are wrong by at each flight's own theta, times the correlation
between updates. `neural` then puts a network on the encoder, fitted on what is left, and keeps of it the share that is
best on flights that took no part: it is never worse there than the linear map.
"""

import dataclasses as dc

import numpy as np
import torch

from np_drake.lifting.model.adaptive_family import EVERY, AdaptiveFamily
from np_drake.lifting.model.channel_views import symmetric_blocks
from np_drake.lifting.training.family_module import AxisModule
from np_drake.lifting.training.horizon_ridge import horizon_grid
from np_drake.training_data.segments import Segment, check_segments, group_scale


@dc.dataclass(frozen=True)
class FamilyConfig:
    """Parameters of `lifted` and `neural`. Force, v and omega are each divided by one scale."""

    network: bool = False  # whether a network is put on top of the linear encoder
    delay: int = 50  # samples that the encoder sees [1]
    horizon: int = 40  # longest prediction in the loss [steps]
    horizons: int = 10  # how many of it, closer together near 0 [1]
    size: int = 3  # entries of theta [1]
    frequencies: tuple[float, ...] = (3.2, 8.0)  # of the lateral pairs at first, scaled to the vehicle [rad/s]
    decays: tuple[float, ...] = (0.02, 5.0)  # of the real modes at first [1/s]
    width: int = 64  # neurons of a layer of the network [1]
    steps: int = 3000  # of gradient descent, the network as many again [1]
    batch: int = 2048  # windows of a step [1]
    learning_rate: float = 1e-2  # of Adam, falling to nothing along a cosine; theta five times as much [1]
    zeta_noise: float = 0.01  # white noise added to the coming zeta, which keeps B from amplifying it [1]
    label_noise: float = 0.01  # white noise added to the encoder's samples [1]
    theta_noise: float = 0.1  # added to theta, in deviations of its prior, as the estimate in flight has some [1]
    lags: tuple[int, ...] = (12, 25)  # over which forecasts are compared in flight [steps]
    memory: float = 20.0  # time constant with which theta returns to its prior; the payload may change [s]
    held_out: float = 0.2  # share of the flights that weigh the network [1]
    seed: int = 0


class FamilyTrainer:
    """Windows of all flights, and the modules that are fitted to them.

    Args:
        segments: one a flight, at one step.
        config: of the training.
    """

    def __init__(self, segments: list[Segment], config: FamilyConfig):
        self.config = config
        self.segments = check_segments(segments, config.delay + config.horizon + 1)
        self.step = float(np.median([s.step for s in self.segments]))
        self.chi_scale = group_scale([s.goal for s in self.segments], centred=True)
        self.zeta_scale = group_scale([s.zeta for s in self.segments], centred=True)
        self.horizons = horizon_grid(config.horizon, config.horizons)
        scale = 1.0 / np.concatenate([self.chi_scale, self.zeta_scale])
        lateral, vertical = symmetric_blocks(4, torque=False)
        self.axes: list[AxisModule] = []
        for number, (block, frequencies) in enumerate(((lateral, config.frequencies), (vertical, ()))):
            channels = np.stack([_channels(view) for view in block.views]) * scale
            readout = np.stack([view.selected[0] for view in block.views]) * self.chi_scale
            self.axes.append(
                AxisModule(
                    channels,
                    readout,
                    delay=config.delay,
                    frequencies=frequencies or (15.0,),
                    decays=config.decays,
                    size=config.size,
                    seed=config.seed + number,
                )
            )
        rng = np.random.default_rng(config.seed)
        self.theta = torch.nn.Parameter(
            torch.from_numpy(0.1 * rng.standard_normal((len(self.segments), config.size))).float()
        )
        self.data = [self._windows(axis) for axis in self.axes]
        self.weights = [_weights(data) for data in self.data]

    def _windows(self, axis: AxisModule) -> "_Windows":
        parts = []
        for number, s in enumerate(self.segments):
            seen = np.hstack([s.chi, s.zeta]) @ axis.channels.swapaxes(1, 2)
            goals = np.stack([s.goal @ (row > 0) / self.chi_scale[0] for row in np.abs(axis.readout)])
            for view, goal in zip(seen, goals, strict=True):
                parts.append((number, torch.from_numpy(view).float(), torch.from_numpy(goal).float()))
        return _Windows.of(parts, self.config, self.horizons)

    def loss(self, axis: int, chosen: torch.Tensor, generator: torch.Generator | None = None) -> torch.Tensor:
        """Return the mean square of the weighted forecast errors of some windows.

        Args:
            axis: number.
            chosen: (b,) of its windows.
            generator: of the noise of training; None: without.
        """
        data, c = self.data[axis], self.config
        w, u, y, flight = data.rows(chosen)
        theta = self.theta[flight]
        if generator is not None:

            def noise(like: torch.Tensor) -> torch.Tensor:
                return torch.randn(like.shape, generator=generator, dtype=like.dtype)

            w, u = w + c.label_noise * noise(w), u + c.zeta_noise * noise(u)
            theta = theta + c.theta_noise * self.theta.detach().std(0) * noise(theta)
        module = self.axes[axis]
        z = module.lift(w, theta)
        return ((module.forecast(z, u, theta, self.horizons, self.step) - y) * self.weights[axis][flight]).pow(2).mean()

    def descend(self, parameters: list[torch.nn.Parameter], windows: list[torch.Tensor], on_step) -> list[float]:
        """Run Adam on `parameters`, and return the losses.

        Args:
            parameters: that change.
            windows: of each axis that take part.
            on_step: called with (number, loss).
        """
        c, losses = self.config, []
        others = [p for p in parameters if p is not self.theta]
        groups = [{"params": others, "lr": c.learning_rate}]
        if len(others) < len(parameters):
            groups.append({"params": [self.theta], "lr": 5 * c.learning_rate})
        optimiser = torch.optim.Adam(groups)
        rates = [group["lr"] for group in optimiser.param_groups]
        generator = torch.Generator().manual_seed(c.seed)
        for number in range(c.steps):
            for group, rate in zip(optimiser.param_groups, rates, strict=True):
                group["lr"] = rate * (0.505 + 0.495 * np.cos(np.pi * number / c.steps))
            loss = 1e-3 * self.theta.pow(2).mean()
            for axis, some in enumerate(windows):
                drawn = some[torch.randint(len(some), (c.batch,), generator=generator)]
                loss = loss + self.loss(axis, drawn, generator)
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(parameters, 1.0)
            optimiser.step()
            losses.append(loss.item())
            on_step(number, losses[-1])
        return losses


@dc.dataclass(frozen=True)
class _Windows:
    """Origins of an axis over all flights and views, as places in one long array."""

    seen: torch.Tensor  # (n, c)
    goal: torch.Tensor  # (n,)
    origin: torch.Tensor  # (o,)
    flight: torch.Tensor  # (o,)
    delay: int
    horizons: torch.Tensor

    @classmethod
    def of(cls, parts: list, config: FamilyConfig, horizons: np.ndarray) -> "_Windows":
        origin, flight, start = [], [], 0
        for number, seen, _ in parts:
            here = torch.arange(config.delay - 1, len(seen) - config.horizon)
            origin.append(start + here)
            flight.append(torch.full_like(here, number))
            start += len(seen)
        seen, goal = torch.cat([p[1] for p in parts]), torch.cat([p[2] for p in parts])
        return cls(seen, goal, torch.cat(origin), torch.cat(flight), config.delay, torch.from_numpy(horizons))

    def rows(self, chosen: torch.Tensor):
        """Return windows (b, D c), coming inputs (b, H, c - 1), goals (b, horizons) and flights (b,)."""
        k = self.origin[chosen]
        w = self.seen[k[:, None] + torch.arange(1 - self.delay, 1)].reshape(len(k), -1)
        u = self.seen[k[:, None] + torch.arange(int(self.horizons[-1]))][..., 1:]
        return w, u, self.goal[k[:, None] + self.horizons], self.flight[chosen]


def _weights(data: _Windows) -> torch.Tensor:
    """Return 1 / RMSE of persistence of each flight at each horizon, limited to 1 / (2 % of the largest), (flights, H).

    So every flight counts alike, that of a light payload as that of a heavy one.
    """
    rows = []
    for flight in range(int(data.flight.max()) + 1):
        k = data.origin[data.flight == flight]
        k = k[:: max(1, len(k) // 500)]
        rmse = (data.goal[k[:, None] + data.horizons] - data.seen[k, :1]).pow(2).mean(0).sqrt()
        rows.append(1.0 / rmse.clamp(min=max(0.02 * float(rmse.max()), 1e-9)))
    return torch.stack(rows)


def _channels(view) -> np.ndarray:
    """Return (c, 12) what a view takes of [chi, zeta]."""
    labels = np.hstack([view.selected, np.zeros((1, 6))])
    return np.vstack([labels, np.hstack([np.zeros((len(view.inputs), 6)), view.inputs])])


def make_family(trainer: FamilyTrainer, share: float = 1.0) -> AdaptiveFamily:
    """Return the family as fitted, its prior and the noise of its update.

    Args:
        trainer: after its descents.
        share: of the network that is kept [1].
    """
    c = trainer.config
    theta = trainer.theta.detach().numpy().astype(float)
    axes = tuple(axis.export(share) for axis in trainer.axes)
    lags = np.array(c.lags, float)
    covariance = np.atleast_2d(np.cov(theta.T)) + 1e-9 * np.eye(c.size)
    family = AdaptiveFamily(axes, theta.mean(0), covariance, lags, np.ones((len(axes), len(lags))), c.memory)
    return dc.replace(family, noise=_update_noise(family, trainer.segments, theta, trainer.step))


def _update_noise(family: AdaptiveFamily, segments: list[Segment], theta: np.ndarray, step: float) -> np.ndarray:
    """Return the deviations of `AdaptiveFamily.update`: those of e_h at each flight's theta, and their correlation.

    n updates of correlated errors tell as much as n / (1 + 2 sum of their autocorrelations); errors of different lags
    are alike, and share what they tell.
    """
    courses: list[list[np.ndarray]] = []
    for s, own in list(zip(segments, theta, strict=True))[:40]:
        samples = np.hstack([s.chi, s.zeta])
        ends = range(family.window, len(samples) + 1, EVERY)
        courses.append([family._departures(own, samples[k - family.window : k], step) for k in ends])
    views = [len(axis.channels) for axis in family.axes]
    noise, place = np.empty((len(family.axes), len(family.lags))), 0
    for a, V in enumerate(views):
        for j in range(len(family.lags)):
            series = [np.array(course)[:, place : place + V] for course in courses if len(course) > 1]
            noise[a, j] = np.sqrt(len(family.lags) * _spread(series))
            place += V
    return noise


def _spread(series: list[np.ndarray]) -> float:
    """Return the variance of courses (n, V) about zero, times their correlation time in samples."""
    power = float(np.mean(np.concatenate([np.mean(s**2, axis=1) for s in series])))
    total, lag = 1.0, 1
    while lag < 200:
        pairs = [s[lag:] * s[:-lag] for s in series if len(s) > lag]
        if not pairs or (now := float(np.mean(np.concatenate([np.mean(p, axis=1) for p in pairs])) / power)) <= 0:
            break
        total, lag = total + 2 * now, lag + 1
    return power * total
