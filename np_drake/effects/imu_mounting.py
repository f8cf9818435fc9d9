"""Effect `imu_mounting`: an autopilot whose axes are not those of the rotors."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.effects.base import Measurement, Parameter, SensorEffect
from np_drake.rigid_body import Q, W
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class ImuMounting(SensorEffect):
    """Rotation vector [roll, pitch, yaw] by which attitude and rates are read in turned axes.

    A nuisance of an autopilot's logs: never a cause. An `attitude_bias` turns the attitude alone.
    Source: own choice: a board that is mounted and levelled by hand.
    """

    roll: float = 0.02  # [rad]
    pitch: float = 0.0  # [rad]
    yaw: float = 0.0  # [rad]

    role = "nuisance"
    named = "a tilted IMU"
    linear = False
    small = True
    corrupts = ("qw", "qx", "qy", "qz", "wx", "wy", "wz")
    parameters = tuple(
        Parameter(
            name, "rad", 0.0, -0.2, 0.2, 0.02, departure=f"IMU mounted with {{signed}} of {name}"
        )
        for name in ("roll", "pitch", "yaw")
    )

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the reading with attitude and rates in the turned axes."""
        dq = attitude.from_rotation_vector(np.array([[self.roll, self.pitch, self.yaw]]))[0]
        x = np.array(truth.x, float)
        dqs = np.broadcast_to(dq, x[..., Q].shape)
        x[..., Q] = attitude.multiply(x[..., Q], dqs)
        x[..., W] = attitude.rotate_back(dqs, x[..., W])
        return dc.replace(truth, x=x)
