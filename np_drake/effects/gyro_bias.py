"""Effect `gyro_bias`: a constant error of the gyroscope."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.effects.base import Measurement, Parameter, SensorEffect
from np_drake.effects.random_sizes import direction, log_uniform
from np_drake.rigid_body import W
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class GyroBias(SensorEffect):
    """Constant gyroscope bias in body axes, w_read = w + [x, y, z].

    Source: the usual IMU model.
    """

    x: float = 0.05  # [rad/s]
    y: float = 0.0  # [rad/s]
    z: float = 0.0  # [rad/s]

    identifier: ClassVar[str] = "gyro_bias"
    named: ClassVar[str] = "a gyroscope bias"
    bench_check: ClassVar[str] = "calibrate the gyroscope at rest"
    excited_by: ClassVar[str] = "rest on the ground for ten seconds"
    tolerance: ClassVar[str] = "rate"
    corrupts: ClassVar[tuple[str, ...]] = ("wx", "wy", "wz")
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(axis, "rad/s", 0.0, -1.0, 1.0, 0.05) for axis in "xyz"
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        size = log_uniform(rng, 0.003, 0.15)
        return dict(zip("xyz", size * direction(rng), strict=True))

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the reading with the bias on the body rates."""
        x = np.array(truth.x, float)
        x[..., W] += [self.x, self.y, self.z]
        return dc.replace(truth, x=x)
