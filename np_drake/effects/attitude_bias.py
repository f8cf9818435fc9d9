"""Effect `attitude_bias`: a constant error of the attitude estimate."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.effects.base import Measurement, Parameter, SensorEffect
from np_drake.rigid_body import Q
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class AttitudeBias(SensorEffect):
    """Constant rotation of the attitude estimate in body axes, q_read = q dq.

    dq = yaw about z, then pitch about y, then roll about x, each about the turned axis.
    Source: own choice: markers or an IMU that are mounted askew.
    """

    roll: float = 0.02  # [rad]
    pitch: float = 0.0  # [rad]
    yaw: float = 0.0  # [rad]

    requires = ("velocity",)
    named = "an attitude bias"
    drawn = (0.003, 0.08)
    bench_check = "level the IMU, or the frame of the motion capture"
    excited_by = "hover with two opposite headings, and sprints"
    told_from = {
        "accelerometer_bias": "fly at several thrusts: tilt scales with thrust, a bias stays"
    }
    tolerance = "attitude"
    linear = False
    corrupts = ("qw", "qx", "qy", "qz")
    parameters = tuple(
        Parameter(
            name, "rad", 0.0, -0.4, 0.4, 0.03, departure=f"attitude reads {{signed}} of {name}"
        )
        for name in ("roll", "pitch", "yaw")
    )

    @property
    def dq(self) -> np.ndarray:
        """Unit quaternion of the error, (4,)."""
        dq = np.array([1.0, 0.0, 0.0, 0.0])
        for axis, angle in ((3, self.yaw), (2, self.pitch), (1, self.roll)):
            turn = np.zeros(4)
            turn[0], turn[axis] = np.cos(0.5 * angle), np.sin(0.5 * angle)
            dq = attitude.multiply(dq, turn)
        return dq

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the reading with the attitude turned."""
        x = np.array(truth.x, float)
        x[..., Q] = attitude.multiply(x[..., Q], np.broadcast_to(self.dq, x[..., Q].shape))
        return dc.replace(truth, x=x)
