"""Tuning of the weights by gradient: the estimate is a linear recursion whose gains are smooth in
the weights.
"""

import dataclasses as dc
import logging
import math

import numpy as np
import torch

from np_drake.estimation.mhe_config import MheConfig, MheWeights, window_gains
from np_drake.estimation.motion import Motion

_SPAN = 1e3  # each weight may change by this factor [1]
_LEAST = 0.2  # least forgetting factor: below it a window forgets all but its last two samples [1]
_LOG = logging.getLogger(__name__)


def tune(
    motion: Motion, wrench: np.ndarray, config: MheConfig | None = None, *, iterations: int = 20
) -> MheConfig:
    """Return the configuration whose estimates fit the labels of a training flight best, starting
    from `config`.

    Loss: mean over the six channels of squared error over that of `config`. `measurement` stays,
    since only ratios within a channel matter. L-BFGS, each weight within a factor of 1000 of where
    it starts; the best weights found on the way are returned, hence never worse ones than `config`.

    Args:
        wrench: (n, 6) labels [N, N·m].
    Raises:  ValueError: if the flight has gaps, or no more samples than a window.
    """
    config = (config or MheConfig()).check()
    if len(wrench) <= config.horizon + 1 or not (
        np.isfinite(motion.y).all() and np.isfinite(wrench).all()
    ):
        raise ValueError("tune: the training flight must be longer than a window and without gaps.")
    parameters = _Parameters(config)
    data = _Data(motion, wrench, config.horizon)
    optimizer = torch.optim.LBFGS(
        parameters.leaves, max_iter=iterations, line_search_fn="strong_wolfe"
    )
    with torch.no_grad():
        before = data.errors(MheWeights.of(config))
    best = [(1.0, config)]

    def closure() -> torch.Tensor:
        optimizer.zero_grad()
        loss = (data.errors(parameters.weights()) / before).mean()
        loss.backward()
        _LOG.info("tune: loss %.6g", loss.item())
        if loss.item() < best[0][0]:
            best[0] = (loss.item(), parameters.config())
        return loss

    optimizer.step(closure)
    return best[0][1].check()


class _Parameters:
    """Unbounded parameters of the weights: the weights at the start times factors up to `_SPAN`.

    One factor for velocity and one for body rates: the axes of an inertial frame are arbitrary.
    """

    def __init__(self, config: MheConfig):
        self._start, self._weights = config, MheWeights.of(config)
        factors = torch.stack(
            [self._weights.forgetting_measurement, self._weights.forgetting_process]
        )
        share = ((factors - _LEAST) / (1 - _LEAST)).clamp(0.01, 0.99)
        start = torch.zeros(2, 2), torch.zeros(2), share.logit()
        self.leaves = [value.double().requires_grad_() for value in start]

    def weights(self) -> MheWeights:
        """Return the weights as tensors that carry the gradient."""
        groups = (torch.exp(math.log(_SPAN) * torch.tanh(leaf)) for leaf in self.leaves[:2])
        arrival, process = (group.repeat_interleave(3, dim=0) for group in groups)
        factors = _LEAST + (1 - _LEAST) * self.leaves[2].sigmoid()
        w = self._weights
        return MheWeights(w.arrival * arrival, w.measurement, w.process * process, *factors)

    def config(self) -> MheConfig:
        """Return the configuration in plain numbers."""
        w = self.weights()
        return dc.replace(
            self._start,
            arrival_motion=w.arrival[:, 0].tolist(),
            arrival_acceleration=w.arrival[:, 1].tolist(),
            process=w.process.tolist(),
            forgetting_measurement=w.forgetting_measurement.item(),
            forgetting_process=w.forgetting_process.item(),
        )


class _Data:
    """A flight with the effect of its known inputs subtracted, so that no input remains."""

    def __init__(self, motion: Motion, wrench: np.ndarray, horizon: int):
        self._n, self._step = horizon, motion.step
        known = np.concatenate([np.zeros((1, 6)), motion.step * np.cumsum(motion.u[:-1], axis=0)])
        y = torch.as_tensor(motion.y - known)
        d = torch.as_tensor(motion.acceleration(wrench))
        self._start = torch.stack(
            [y[0], d[0]], dim=1
        )  # (6, 2), as published: training starts at the label
        self._windows = y.unfold(0, horizon + 1, 1)  # (n - N, 6, N + 1)
        self._d = d[horizon:]

    def errors(self, weights: MheWeights) -> torch.Tensor:
        """Return the mean squared error of d, (6,)."""
        n = self._n
        from_arrival, from_samples = window_gains(weights, self._step, n)
        second, last = (
            [1, n + 2],
            2 * n + 1,
        )  # [y_1, d_1] is the arrival of the next window; d_n the estimate
        A, drive = (
            from_arrival[:, second],
            torch.einsum("crk,tck->tcr", from_samples[:, second], self._windows),
        )
        arrival, arrivals = self._start, []
        for term in drive.unbind():
            arrivals.append(arrival)
            arrival = (A @ arrival[..., None])[..., 0] + term
        d = torch.einsum("ck,tck->tc", from_samples[:, last], self._windows)
        d = d + torch.einsum("ci,tci->tc", from_arrival[:, last], torch.stack(arrivals))
        return ((d - self._d) ** 2).mean(dim=0)
