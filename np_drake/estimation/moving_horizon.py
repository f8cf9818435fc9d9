"""Moving-horizon estimation of the wrench from velocity and body rates.

    min  |x_0 - x_bar|²_P + sum_k g1^(n-k) |y_k - Y_k|²_R + sum_k g2^(n-1-k) |w_k|²_Q
    s.t. y_(k+1) = y_k + h (d_k + u_k) + h²/2 w_k,   d_(k+1) = d_k + h w_k,   x = [y, d]

y: velocity in an inertial frame and body rates; d: the acceleration that the wrench causes in them,
a random walk; u: the known inputs, gravity and the gyroscopic term. x_bar is the estimate of the
last window for the first sample of this one. Source: Wang et al. 2024 (NeuroMHE), eq. (4) and
section VII-A, with fixed weights; their F = m d and tau = J d, and exact integration of the chain
is their Runge-Kutta step.
"""

import dataclasses as dc
import time
from typing import Protocol

import numpy as np
import torch

from np_drake.estimation.mhe_config import CHANNELS, MheConfig, MheWeights, window_gains
from np_drake.estimation.motion import Motion

Memory = dict[str, np.ndarray]


@dc.dataclass(frozen=True)
class MheEstimate:
    """Estimate of one window.

    x: (n + 1, 2, 6) trajectory of [y, d] over the window; its last row is the estimate of now.
    held: whether the solver failed, and this is the last estimate, one step on, without noise.
    """

    x: np.ndarray
    held: bool

    @property
    def acceleration(self) -> np.ndarray:
        """Estimated d of now, (6,) [m/s², rad/s²]."""
        return self.x[-1, 1]


class WindowSolver(Protocol):
    """Interface of a solver of one window."""

    def solve(self, arrival: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray | None:
        """Return the trajectory (n + 1, 2, 6), or None where the solver failed.

        Args:
            arrival: (2, 6) x_bar.
            y: (n + 1, 6) samples, NaN where missing.
            u: (n, 6) known inputs.
        """
        ...


class LeastSquaresWindow:
    """Exact solver of a window by gains that depend only on which samples are missing.

    Args:
        step: between samples [s].
    """

    def __init__(self, config: MheConfig, step: float):
        self._weights, self._step = MheWeights.of(config.check()), step
        self._gains: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def solve(self, arrival: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray | None:
        """Return the trajectory, see `WindowSolver`."""
        # Superposition: the known inputs' part of y is taken out of the samples, and added to the
        # trajectory again.
        known = np.concatenate([np.zeros((1, CHANNELS)), self._step * np.cumsum(u, axis=0)])
        seen = np.isfinite(y)
        from_arrival, from_samples = self._of(seen)
        sample = np.where(seen, y - known, 0.0)
        x = from_arrival @ arrival.T[:, :, None] + from_samples @ sample.T[:, :, None]
        x = x.reshape(CHANNELS, 2, len(y)).transpose(2, 1, 0)
        x[:, 0] += known
        return x

    def _of(self, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        key = seen.tobytes()
        if key not in self._gains:
            gains = window_gains(
                self._weights, self._step, len(seen) - 1, torch.as_tensor(seen).double()
            )
            if len(self._gains) > 500:  # a stream of ever new gaps
                self._gains.clear()
            self._gains[key] = (gains[0].numpy(), gains[1].numpy())
        return self._gains[key]


class MovingHorizonEstimator:
    """Moving-horizon estimator that takes one sample at a time and keeps all memory in the caller's
    dictionary.

    A NaN in y takes that channel's sample out of the cost; a NaN in u stands for the input of the
    step before.

    Args:
        step: between samples [s].
    """

    def __init__(self, config: MheConfig, step: float, solver: WindowSolver | None = None):
        if not 0 < step < np.inf:
            raise ValueError(f"MovingHorizonEstimator: step must be positive [s]; got {step}.")
        self._samples, self._step = config.check().horizon + 1, step
        self._solver = solver or LeastSquaresWindow(config, step)

    def initial_memory(self, y: np.ndarray, d: np.ndarray) -> Memory:
        """Return the memory before any sample, from first guesses of y and d.

        Args:
            y: (6,) [m/s, rad/s].
            d: (6,) [m/s², rad/s²].
        Returns: x: (N + 1, 2, 6) last trajectory, the newest last.
        arrival: (2, 6) x_bar.
        y, u: (N + 1, 6) samples and inputs.
        count: (1,) samples in the window.
        Raises: ValueError: if a guess is not finite.
        """
        guess = np.array([y, d], float)
        if not np.isfinite(guess).all():
            raise ValueError(
                f"MovingHorizonEstimator: the first guesses must be finite; got {guess.tolist()}."
            )
        return {
            "x": np.repeat(guess[None], self._samples, axis=0),
            "arrival": guess,
            "y": np.full((self._samples, CHANNELS), np.nan),
            "u": np.zeros((self._samples, CHANNELS)),
            "count": np.zeros(1),
        }

    def update(self, memory: Memory, y: np.ndarray, u: np.ndarray) -> tuple[Memory, MheEstimate]:
        """Return (memory, estimate) after the sample y (6,) of now.

        Args:
            y: (6,) sample [m/s, rad/s].
            u: (6,) known input that acts from now on [m/s², rad/s²].
        """
        full = memory["count"][0] == self._samples
        count = self._samples if full else int(memory["count"][0]) + 1
        arrival = memory["x"][1] if full else memory["arrival"]
        samples = np.concatenate([memory["y"][1:], [y]])
        inputs = np.concatenate([memory["u"][1:], [np.where(np.isfinite(u), u, memory["u"][-1])]])
        x = self._solver.solve(arrival, samples[-count:], inputs[-count:-1])
        held = x is None or not np.isfinite(x).all()
        if x is None or held:
            x = self._held(memory["x"], inputs, first=count == 1)[-count:]
        memory = {
            "x": np.concatenate([memory["x"][count:], x]),
            "arrival": arrival,
            "y": samples,
            "u": inputs,
            "count": np.array([float(count)]),
        }
        return memory, MheEstimate(x, held)

    def _held(self, x: np.ndarray, u: np.ndarray, *, first: bool) -> np.ndarray:
        """Return the last trajectory one step on, by the model without noise; at first, the
        guess.
        """
        if first:
            return x
        y, d = x[-1]
        return np.concatenate([x[1:], [[y + self._step * (d + u[-2]), d]]])


@dc.dataclass(frozen=True)
class MheRun:
    """Estimates of one flight.

    wrench: (n, 6) estimate at each row from the rows up to it [N, N·m].
    held: rows without an answer of the solver. step_time: median of a step [s].
    """

    wrench: np.ndarray
    held: int
    step_time: float


def run_mhe(motion: Motion, config: MheConfig, solver: WindowSolver | None = None) -> MheRun:
    """Run the estimator over a flight, from the first sample of each channel in a hover.

    Source of the start: the published evaluation of Wang et al. 2024.
    Raises: ValueError: if a channel has no sample at all.
    """
    dut = MovingHorizonEstimator(config, motion.step, solver)
    first = np.argmax(np.isfinite(motion.y), axis=0)
    memory = dut.initial_memory(motion.y[first, np.arange(6)], motion.hover)
    d, seconds, held = np.empty_like(motion.y), np.empty(len(motion.y)), 0
    for k, (y, u) in enumerate(zip(motion.y, motion.u, strict=True)):
        start = time.perf_counter()
        memory, estimate = dut.update(memory, y, u)
        seconds[k] = time.perf_counter() - start
        d[k] = estimate.acceleration
        held += estimate.held
    return MheRun(motion.wrench(d), held, float(np.median(seconds)))
