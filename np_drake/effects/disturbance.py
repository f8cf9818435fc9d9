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

    def __post_init__(self) -> None:
        """Raises: ValueError: as `check`."""
        self.check()

    def check(self) -> "DisturbanceConfig":
        """Return self after checking all values; ValueError on no deviation or no time."""
        check_fields(self, "disturbance")
        return self

    @property
    def acts(self) -> bool:
        """Whether there is any."""
        return any(self.force) or any(self.torque)


@dc.dataclass(frozen=True, eq=False)
class Disturbance(WrenchEffect):
    """First-order Gauss-Markov force and torque on each body axis.

    Spectrum of an axis 2 deviation² T / (1 + w² T²), as a sum of sinusoids with phases by `seed`,
    so that it can be evaluated at any t. No part of the library: it is what remains once its
    effects are found.
    """

    config: DisturbanceConfig

    role = ""
    parameters = ()

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return force and torque in B, (..., 6) [N, N·m]."""
        size, time = self._spread
        return along(motion.t, size, time, self.config.seed)

    @cached_property
    def _spread(self) -> np.ndarray:
        """Deviations [N, N·m] and correlation times [s] of the axes, (2, 6)."""
        config = self.config
        return np.array(
            [[*config.force, *config.torque], [*config.force_time, *config.torque_time]]
        )


def along(t: np.ndarray | float, deviation: np.ndarray, time: np.ndarray, seed: int) -> np.ndarray:
    """Return first-order Gauss-Markov processes at times t (...,), (..., axes), each as a sum of
    sinusoids, so that it can be evaluated at any time.

    Args:
        t: [s].
        deviation: (axes,) standard deviations.
        time: (axes,) correlation times [s].
        seed: of the draw.
    """
    times = np.asarray(t, float)
    rate, phase = _lines(seed, len(time))
    size = deviation * np.sqrt(2.0 / LINES)
    return _sums(times.ravel(), rate, time, phase, size).reshape(*times.shape, len(size))


@compiled
def _sums(t, rate, time, phase, size):
    """Return `along` at times (n,), (n, axes)."""
    out = np.empty((len(t), len(size)))
    for i in range(len(t)):
        out[i] = size * np.cos((t[i] / time.reshape(-1, 1)) * rate + phase).sum(axis=1)
    return out


@lru_cache(maxsize=64)
def _lines(seed: int, axes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return angular frequency times correlation time [1], and phase [rad], (axes, LINES) each.

    The share (2/π) atan(w T) of a first-order process' power lies below w: one line in each of
    `LINES` equal shares.
    """
    rng = np.random.default_rng(seed)
    share = (np.arange(LINES) + rng.uniform(0.1, 0.9, (axes, LINES))) / LINES
    return np.tan(0.5 * np.pi * share), rng.uniform(0.0, 2 * np.pi, (axes, LINES))
