"""Measurement effect `sensor_noise`: white noise of motion capture and IMU."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake import attitude
from np_drake.effects.base import Measurement
from np_drake.vehicle import MeasurementNoise, Vehicle


@dc.dataclass(frozen=True)
class SensorNoise:
    """Independent white noise on every reading; accelerometer noise and attitude error both reach `a`.

    An IMU reads specific force in body axes; turning it into `a` takes the *measured* attitude:
    a_meas = R_meas (R^T (a + g z) + n_a) - g z.        Source: own choice: white at the log's rate.
    """

    noise: MeasurementNoise = dc.field(default_factory=MeasurementNoise)
    rotor: float = 0.0  # [rad/s]

    identifier: ClassVar[str] = "sensor_noise"
    white_size: ClassVar[int] = 22  # p, attitude, v, w, a, al, rotor

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the noisy reading; `white`: (..., 22) standard normal [1]."""
        n, x = self.noise, np.array(truth.x, float)
        x[..., 0:3] += n.position * white[..., 0:3]
        error = np.ones((*white.shape[:-1], 4))
        error[..., 1:] = 0.5 * n.attitude * white[..., 3:6]
        q = attitude.multiply(truth.x[..., 3:7], error)
        x[..., 3:7] = q / np.linalg.norm(q, axis=-1, keepdims=True)
        x[..., 7:10] += n.velocity * white[..., 6:9]
        x[..., 10:13] += n.rate * white[..., 9:12]
        g = np.array([0.0, 0.0, vehicle.gravity])
        specific = attitude.rotate_back(truth.x[..., 3:7], truth.a + g) + n.acceleration * white[..., 12:15]
        return Measurement(
            x=x,
            a=attitude.rotate(x[..., 3:7], specific) - g,
            al=truth.al + n.angular_acceleration * white[..., 15:18],
            rotor=truth.rotor + self.rotor * white[..., 18:22],
        )
