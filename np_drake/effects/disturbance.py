"""Random wrench with the statistics of what a model leaves unexplained."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.effects.base import Motion, WrenchEffect
from np_drake.effects.gauss_markov_lines import LINES, lines
from np_drake.rigid_body import Q
from np_drake.vehicle import Vehicle


@dc.dataclass
class DisturbanceConfig:
    """Standard deviation and correlation time of a random force and torque, on each body axis."""

    force: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])  # [N]
    torque: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])  # [N·m]
    force_time: list[float] = dc.field(default_factory=lambda: [1.0, 1.0, 1.0])  # [s]
    torque_time: list[float] = dc.field(default_factory=lambda: [1.0, 1.0, 1.0])  # [s]
    seed: int = 0  # of the draw

    def check(self) -> "DisturbanceConfig":
        """Return self after checking all values.

        Raises: ValueError: on one that is no deviation or no time.
        """
        for name in ("force", "torque"):
            if np.shape(getattr(self, name)) != (3,) or not all(
                0 <= v < np.inf for v in getattr(self, name)
            ):
                raise ValueError(
                    f"disturbance: {name} must be three deviations, none negative; got "
                    f"{getattr(self, name)}."
                )
            times = getattr(self, f"{name}_time")
            if np.shape(times) != (3,) or not all(0 < v < np.inf for v in times):
                raise ValueError(
                    f"disturbance: {name}_time must be three positive times [s]; got {times}."
                )
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

    identifier = "disturbance"
    role = ""
    feels_rotor_rate = False
    parameters = ()

    @staticmethod
    def of_config(config: DisturbanceConfig) -> "Disturbance":
        """Return the disturbance of a scenario."""
        return Disturbance(
            (*config.force, *config.torque), (*config.force_time, *config.torque_time), config.seed
        )

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi = [f in W, tau in B] (..., 6) [N, N·m]."""
        frequency, phase = lines(self.seed, len(self.deviation))
        t = np.asarray(motion.t, float)[..., None, None]
        angle = t * (frequency / np.array(self.time)[:, None]) + phase
        body = np.array(self.deviation) * np.sqrt(2.0 / LINES) * np.cos(angle).sum(axis=-1)
        chi = np.broadcast_to(body, (*motion.x.shape[:-1], 6)).copy()
        chi[..., :3] = attitude.rotate(motion.x[..., Q], chi[..., :3])
        return chi
