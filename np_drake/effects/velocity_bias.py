"""Effect `velocity_bias`: a constant error of the velocity estimate."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake import attitude
from np_drake.effects.base import Measurement, Parameter, SensorEffect
from np_drake.effects.random_sizes import direction, log_uniform
from np_drake.rigid_body import Q, V
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class VelocityBias(SensorEffect):
    """Constant velocity bias in body axes, v_read = v + R [x, y, z].

    Source: own choice: an optical-flow or air-data error.
    """

    x: float = 0.2  # [m/s]
    y: float = 0.0  # [m/s]
    z: float = 0.0  # [m/s]

    identifier: ClassVar[str] = "velocity_bias"
    named: ClassVar[str] = "a velocity bias"
    excited_by: ClassVar[str] = "hover in place, then long straight legs"
    tolerance: ClassVar[str] = "velocity"
    corrupts: ClassVar[tuple[str, ...]] = ("vx", "vy", "vz")
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(axis, "m/s", 0.0, -3.0, 3.0, 0.2) for axis in "xyz"
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        size = log_uniform(rng, 0.01, 0.5)
        return dict(zip("xyz", size * direction(rng), strict=True))

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the reading with the bias on the velocity."""
        x = np.array(truth.x, float)
        bias_B = np.broadcast_to([self.x, self.y, self.z], (*x.shape[:-1], 3))
        x[..., V] += attitude.rotate(x[..., Q], bias_B)
        return dc.replace(truth, x=x)
