"""Effect `accelerometer_bias`: a constant error of the accelerometer."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake import attitude
from np_drake.effects.base import Measurement, Parameter, SensorEffect
from np_drake.effects.random_sizes import direction, log_uniform
from np_drake.rigid_body import Q
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class AccelerometerBias(SensorEffect):
    """Constant accelerometer bias in body axes, a_read = a + R [x, y, z].

    Source: the usual IMU model.
    """

    x: float = 0.2  # [m/s²]
    y: float = 0.0  # [m/s²]
    z: float = 0.0  # [m/s²]

    identifier: ClassVar[str] = "accelerometer_bias"
    named: ClassVar[str] = "an accelerometer bias"
    bench_check: ClassVar[str] = "calibrate the accelerometer"
    excited_by: ClassVar[str] = "hover with two opposite headings"
    tolerance: ClassVar[str] = "acceleration"
    corrupts: ClassVar[tuple[str, ...]] = ("ax", "ay", "az")
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(axis, "m/s²", 0.0, -3.0, 3.0, 0.3) for axis in "xyz"
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        size = log_uniform(rng, 0.03, 1.0)
        return dict(zip("xyz", size * direction(rng), strict=True))

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the reading with the bias on `a`."""
        bias_B = np.broadcast_to([self.x, self.y, self.z], truth.a.shape)
        return dc.replace(truth, a=truth.a + attitude.rotate(truth.x[..., Q], bias_B))
