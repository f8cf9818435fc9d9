"""Effect `gyro_bias`: a constant error of the gyroscope."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Measurement, Parameter, SensorEffect
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

    named = "a gyroscope bias"
    drawn = (0.003, 0.15)
    bench_check = "calibrate the gyroscope at rest"
    excited_by = "rest on the ground for ten seconds"
    requires = ("attitude",)
    tolerance = "rate"
    corrupts = ("wx", "wy", "wz")
    parameters = tuple(
        Parameter(
            axis,
            "rad/s",
            0.0,
            -1.0,
            1.0,
            0.05,
            departure=f"gyroscope reads {{signed}} about {axis}",
        )
        for axis in "xyz"
    )

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the reading with the bias on the body rates."""
        x = np.array(truth.x, float)
        x[..., W] += [self.x, self.y, self.z]
        return dc.replace(truth, x=x)
