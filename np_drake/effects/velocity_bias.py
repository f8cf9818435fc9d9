"""Effect `velocity_bias`: a constant error of the velocity estimate."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.effects.base import Measurement, Parameter, SensorEffect
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

    requires = ("velocity",)
    named = "a velocity bias"
    drawn = (0.01, 0.5)
    excited_by = "hover in place, then long straight legs"
    tolerance = "velocity"
    corrupts = ("vx", "vy", "vz")
    parameters = tuple(
        Parameter(
            axis, "m/s", 0.0, -3.0, 3.0, 0.2, departure=f"velocity reads {{signed}} along {axis}"
        )
        for axis in "xyz"
    )

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the reading with the bias on the velocity."""
        x = np.array(truth.x, float)
        bias_B = np.broadcast_to([self.x, self.y, self.z], (*x.shape[:-1], 3))
        x[..., V] += attitude.rotate(x[..., Q], bias_B)
        return dc.replace(truth, x=x)
