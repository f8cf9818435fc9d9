"""Measurement effect `sensor_noise`: white noise of motion capture and IMU."""

import dataclasses as dc
import math

import numpy as np

from np_drake import attitude
from np_drake.compiled import compiled, turned
from np_drake.effects.base import Measurement
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle


@dc.dataclass(frozen=True)
class SensorNoise:
    """Independent white noise on every reading; accelerometer noise and attitude error both reach
    `a`.

    An IMU reads specific force in body axes; turning it into `a` takes the *measured* attitude:
    a_meas = R_meas (R^T (a + g z) + n_a) - g z.        Source: own choice: white at the log's rate.
    """

    noise: MeasurementNoise = dc.field(default_factory=MeasurementNoise)
    rotor: float = 0.0  # [rad/s]

    identifier = "sensor_noise"
    white_size = 22  # p, attitude, v, w, a, al, rotor

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the noisy reading; `white`: (..., 22) standard normal [1]."""
        n = self.noise
        if truth.x.ndim == 1:  # one instant of the simulator
            return self._measure_once(vehicle, truth, white)
        x = np.array(truth.x, float)
        x[..., 0:3] += n.position * white[..., 0:3]
        error = np.ones((*white.shape[:-1], 4))
        error[..., 1:] = 0.5 * n.attitude * white[..., 3:6]
        q = attitude.multiply(truth.x[..., 3:7], error)
        x[..., 3:7] = q / np.linalg.norm(q, axis=-1, keepdims=True)
        x[..., 7:10] += n.velocity * white[..., 6:9]
        x[..., 10:13] += n.rate * white[..., 9:12]
        g = np.array([0.0, 0.0, vehicle.gravity])
        specific = (
            attitude.rotate_back(truth.x[..., 3:7], truth.a + g)
            + n.acceleration * white[..., 12:15]
        )
        return Measurement(
            x=x,
            a=attitude.rotate(x[..., 3:7], specific) - g,
            al=truth.al + n.angular_acceleration * white[..., 15:18],
            rotor=truth.rotor + self.rotor * white[..., 18:22],
        )

    def _measure_once(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        n, x, a = self.noise, np.empty(13), np.empty(3)
        deviations = (n.position, n.attitude, n.velocity, n.rate, n.acceleration)
        _read(truth.x, truth.a, white, *map(float, deviations), float(vehicle.gravity), x, a)
        al = truth.al + n.angular_acceleration * white[15:18]
        return Measurement(x=x, a=a, al=al, rotor=truth.rotor + self.rotor * white[18:22])


@compiled
def _read(truth, a_true, white, position, attitude, velocity, rate, acceleration, gravity, x, a):
    """Write the noisy state x (13,) and acceleration a (3,) of `SensorNoise.measure`."""
    for k in range(3):
        x[k] = truth[k] + position * white[k]
        x[7 + k] = truth[7 + k] + velocity * white[6 + k]
        x[10 + k] = truth[10 + k] + rate * white[9 + k]
    half = 0.5 * attitude
    i, j, k = half * white[3], half * white[4], half * white[5]
    q_w, q_x, q_y, q_z = truth[3], truth[4], truth[5], truth[6]
    w, b = q_w - q_x * i - q_y * j - q_z * k, q_w * i + q_x + q_y * k - q_z * j
    c, d = q_w * j - q_x * k + q_y + q_z * i, q_w * k + q_x * j - q_y * i + q_z
    size = math.sqrt(w * w + b * b + c * c + d * d)
    x[3], x[4], x[5], x[6] = w / size, b / size, c / size, d / size
    s_x, s_y, s_z = turned(q_w, -q_x, -q_y, -q_z, a_true[0], a_true[1], a_true[2] + gravity)
    s_x, s_y = s_x + acceleration * white[12], s_y + acceleration * white[13]
    s_z += acceleration * white[14]
    a[0], a[1], a[2] = turned(x[3], x[4], x[5], x[6], s_x, s_y, s_z)
    a[2] -= gravity
