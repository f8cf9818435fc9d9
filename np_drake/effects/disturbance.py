"""Random wrench with the statistics of what a model leaves unexplained."""

import dataclasses as dc
from functools import cached_property, lru_cache

import numpy as np

from np_drake.compiled import compiled
from np_drake.effects.base import Motion, WrenchEffect
from np_drake.files.yaml_file import POSITIVE, check_fields, number
from np_drake.vehicle import Vehicle

LINES = 60  # sinusoids an axis, of equal power


@dc.dataclass
class DisturbanceConfig:
    """Standard deviation and correlation time of a random force and torque, on each body axis."""

    force: list[float] = number([0.0, 0.0, 0.0], "N", 0.0)  # standard deviations
    torque: list[float] = number([0.0, 0.0, 0.0], "N·m", 0.0)  # standard deviations
    force_time: list[float] = number([1.0, 1.0, 1.0], "s", POSITIVE)  # correlation times
    torque_time: list[float] = number([1.0, 1.0, 1.0], "s", POSITIVE)  # correlation times
    seed: int = 0  # of the draw

    def check(self) -> "DisturbanceConfig":
        """Return self after checking all values; ValueError on no deviation or no time."""
        check_fields(self, "disturbance")
        return self

    @property
    def acts(self) -> bool:
        """Whether there is any."""
        return any(self.force) or any(self.torque)


@dc.dataclass(frozen=True)
class Disturbance(WrenchEffect):
    """First-order Gauss-Markov force and torque on each body axis.

    Spectrum of an axis 2 deviation² T / (1 + w² T²), as a sum of sinusoids with phases by `seed`,
    so that it can be evaluated at any t. No part of the library: it is what remains once its
    effects are found.

    deviation: (6,) force, torque [N, N·m].   time: (6,) correlation times T [s].
    """

    deviation: tuple[float, ...]
    time: tuple[float, ...]
    seed: int = 0

    role = ""
    parameters = ()

    @staticmethod
    def of_config(config: DisturbanceConfig) -> "Disturbance":
        """Return the disturbance of a scenario."""
        return Disturbance(
            (*config.force, *config.torque), (*config.force_time, *config.torque_time), config.seed
        )

    @cached_property
    def _waves(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angular rates [rad/s] and phases [rad], (6, LINES), and amplitudes (6,) [N, N·m]."""
        frequency, phase = lines(self.seed, len(self.deviation))
        size = np.array(self.deviation) * np.sqrt(2.0 / LINES)
        return frequency / np.array(self.time)[:, None], phase, size

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return force and torque in B, (..., 6) [N, N·m]."""
        return super().body_wrench(vehicle, motion) + along(motion.t, *self._waves)


def along(
    t: np.ndarray | float, rate: np.ndarray, phase: np.ndarray, size: np.ndarray
) -> np.ndarray:
    """Return the sums of sinusoids at times t (...,), (..., axes).

    Args:
        rate: (axes, LINES) angular [rad/s]; phase is as large [rad].
        size: (axes,) amplitude of each.
    """
    times = np.asarray(t, float)
    return _sums(times.ravel(), rate, phase, size).reshape(*times.shape, len(size))


@compiled
def _sums(t, rate, phase, size):
    """Return `along` at times (n,), (n, axes)."""
    out = np.empty((len(t), len(size)))
    for i in range(len(t)):
        out[i] = size * np.cos(t[i] * rate + phase).sum(axis=1)
    return out


@lru_cache(maxsize=64)
def lines(seed: int, axes: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Return angular frequency times correlation time [1], and phase [rad], (axes, LINES) each.

    A first-order Gauss-Markov process is their sum, so that it can be evaluated at any time. The
    share (2/π) atan(w T) of a first-order process' power lies below w: one line in each of
    `LINES` equal shares.
    """
    rng = np.random.default_rng(seed)
    share = (np.arange(LINES) + rng.uniform(0.1, 0.9, (axes, LINES))) / LINES
    return np.tan(0.5 * np.pi * share), rng.uniform(0.0, 2 * np.pi, (axes, LINES))
