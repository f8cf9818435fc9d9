"""Effect `accelerometer_bias`: a constant error of the accelerometer."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.effects.base import Measurement, Parameter, SensorEffect
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

    requires = ("velocity",)
    named = "an accelerometer bias"
    drawn = (0.03, 1.0)
    bench_check = "calibrate the accelerometer"
    excited_by = "hover with two opposite headings"
    tolerance = "acceleration"
    corrupts = ("ax", "ay", "az")
    parameters = tuple(
        Parameter(
            axis,
            "m/s²",
            0.0,
            -3.0,
            3.0,
            0.3,
            departure=f"accelerometer reads {{signed}} along {axis}",
        )
        for axis in "xyz"
    )

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the reading with the bias on `a`."""
        bias_B = np.broadcast_to([self.x, self.y, self.z], truth.a.shape)
        return dc.replace(truth, a=truth.a + attitude.rotate(truth.x[..., Q], bias_B))
