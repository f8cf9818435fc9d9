"""Training of `lifted`: one family of lifted linear systems over many flights, theta of each among them.

    sum over flights, horizons h of mean_k (f_(k+h) - C z_(k+h|k))² / (that of persistence) + penalty |theta|²

(a hierarchical model, its maximum a posteriori by L-BFGS). The prior of theta is its spread over the flights; the noise
of its update in flight is what the forecasts are wrong by at each flight's own theta, times the correlation between
updates.
"""

import dataclasses as dc

import numpy as np
import torch

from np_drake.lifting.model.adaptive_family import EVERY, AdaptiveFamily
from np_drake.lifting.model.channel_views import View, symmetric_blocks
from np_drake.lifting.training.family_axis import TrainedAxis, descend
from np_drake.lifting.training.family_moments import flight_moments
from np_drake.lifting.training.horizon_ridge import horizon_grid
from np_drake.training_data.segments import Segment, check_segments, group_scale


@dc.dataclass(frozen=True)
class FamilyConfig:
    """Parameters of `lifted`. Force, v and omega are each divided by one scale."""

    delay: int = 50  # samples that the encoder sees [1]
    horizon: int = 40  # longest prediction in the loss [steps]
    horizons: int = 10  # how many of it, closer together near 0 [1]
    size: int = 4  # entries of theta [1]
    frequencies: tuple[float, ...] = (3.2, 8.0)  # of the lateral pairs at first, scaled to the vehicle [rad/s]
    vertical: tuple[float, ...] = (15.0,)
    decays: tuple[float, ...] = (0.02, 5.0)  # of the real modes at first [1/s]
    steps: int = 400  # of the descent [1]
    batch: int = 96
    rate: float = 1e-2
    penalty: float = 1e-3  # of theta, which sets its unit [1]
    zeta_noise: float = 0.01  # of the coming zeta, which keeps B from amplifying it [scaled]
    label_noise: float = 0.01  # of the encoder's samples [scaled]
    lags: tuple[int, ...] = (12, 25)  # over which forecasts are compared in flight [steps]
    memory: float = 20.0  # time constant with which theta returns to its prior; the payload may change [s]
    seed: int = 0


def fit_family(segments: list[Segment], config: FamilyConfig, on_step=lambda *_: None):
    """Return (family, step, scales of chi and zeta, losses)."""
    c = config
    segments = check_segments(segments, c.delay + c.horizon + 1)
    step = float(np.median([s.step for s in segments]))
    chi_scale = group_scale([s.goal for s in segments], centred=True)
    zeta_scale = group_scale([s.zeta for s in segments], centred=True)
    horizons = horizon_grid(c.horizon, c.horizons)
    scale = 1.0 / np.concatenate([chi_scale, zeta_scale])
    rng = np.random.default_rng(c.seed)
    axes, exports = [], []
    lateral, vertical = symmetric_blocks(4, torque=False)
    for block, frequencies in ((lateral, c.frequencies), (vertical, c.vertical)):
        channels = np.stack([_channels(view) for view in block.views]) * scale
        readout = np.stack([view.selected[0] for view in block.views]) * chi_scale
        seen = [np.hstack([s.chi, s.zeta]) @ channels.swapaxes(1, 2) for s in segments]
        goals = [np.stack([s.goal / chi_scale @ view.selected[0] for view in block.views]) for s in segments]
        moments = flight_moments(
            seen, goals, delay=c.delay, horizons=horizons, noise=(c.label_noise, c.zeta_noise)
        )  # fmt: skip
        axes.append(
            TrainedAxis(moments, horizons, step, frequencies=frequencies, decays=c.decays, size=c.size, rng=rng)
        )  # fmt: skip
        exports.append((channels, readout))
    theta = torch.from_numpy(0.1 * rng.standard_normal((len(segments), c.size))).float().requires_grad_()

    def loss(some: torch.Tensor) -> torch.Tensor:
        chosen = theta[some]
        return sum(axis.loss(some, chosen).mean() for axis in axes) + c.penalty * chosen.pow(2).mean()

    arrays = [p for a in axes for p in a.parameters]
    losses = descend(
        loss, arrays, theta, steps=c.steps, batch=c.batch, rate=c.rate, seed=c.seed, on_step=on_step
    )
    family = _family([a.export(*e) for a, e in zip(axes, exports, strict=True)], theta, c, segments, step)
    return family, step, chi_scale, zeta_scale, losses, theta.detach().numpy()


def _channels(view: View) -> np.ndarray:
    """Return (c, 12) what a view takes of [chi, zeta]."""
    labels = np.hstack([view.selected, np.zeros((1, 6))])
    return np.vstack([labels, np.hstack([np.zeros((len(view.inputs), 6)), view.inputs])])


def _family(axes, theta, config, segments, step):
    """Return the family as fitted, its prior and the noise of its update."""
    theta = theta.detach().numpy().astype(float)
    lags = np.array(config.lags, float)
    covariance = np.atleast_2d(np.cov(theta.T)) + 1e-9 * np.eye(config.size)
    ones = np.ones((len(axes), len(lags)))
    family = AdaptiveFamily(tuple(axes), theta.mean(0), covariance, lags, ones, config.memory)
    return dc.replace(family, noise=_update_noise(family, segments, theta, step))


def _update_noise(family: AdaptiveFamily, segments: list[Segment], theta: np.ndarray, step: float) -> np.ndarray:
    """Return the deviations of `AdaptiveFamily.update`: those of e_h at each flight's theta, and their correlation.

    n updates of correlated errors tell as much as n / (1 + 2 sum of their autocorrelations); errors of different lags
    are alike, and share what they tell.
    """
    lags = family.lags.astype(int)
    noise = np.empty((len(family.axes), len(lags)))
    for a, axis in enumerate(family.axes):
        courses = []
        for s, own in list(zip(segments, theta, strict=True))[:40]:
            samples = np.hstack([s.chi, s.zeta])
            ends = range(family.window, len(samples) + 1, EVERY)
            courses.append(
                np.array([axis.departures(own[None], samples[k - family.window : k], lags, step)[0] for k in ends])
            )
        for j in range(len(lags)):
            noise[a, j] = np.sqrt(len(lags) * _spread([course[:, :, j] for course in courses if len(course) > 1]))
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
