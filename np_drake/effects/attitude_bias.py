"""Effect `attitude_bias`: a constant error of the attitude estimate."""

import dataclasses as dc
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from np_drake import attitude
from np_drake.effects.base import Measurement, Parameter, SensorEffect
from np_drake.effects.random_sizes import direction, log_uniform
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

    identifier: ClassVar[str] = "attitude_bias"
    named: ClassVar[str] = "an attitude bias"
    bench_check: ClassVar[str] = "level the IMU, or the frame of the motion capture"
    excited_by: ClassVar[str] = "hover with two opposite headings, and sprints"
    told_from: ClassVar[Mapping[str, str]] = {
        "accelerometer_bias": "fly at several thrusts: tilt scales with thrust, a bias stays"
    }
    tolerance: ClassVar[str] = "attitude"
    linear: ClassVar[bool] = False
    corrupts: ClassVar[tuple[str, ...]] = ("qw", "qx", "qy", "qz")
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(name, "rad", 0.0, -0.4, 0.4, 0.03) for name in ("roll", "pitch", "yaw")
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        size = log_uniform(rng, 0.003, 0.08)
        return dict(zip(("roll", "pitch", "yaw"), size * direction(rng), strict=True))

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
