"""Measurement effect `sensor_noise`: white noise of motion capture and IMU."""

import dataclasses as dc
import math
from typing import NamedTuple

import numpy as np

from np_drake.compiled import compiled, turned
from np_drake.effects.base import Measurement
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle


class _Deviations(NamedTuple):
    """Standard deviations of the noise of `MeasurementNoise`."""

    position: float  # [m]
    attitude: float  # [rad]
    velocity: float  # [m/s]
    rate: float  # [rad/s]
    acceleration: float  # [m/s²]


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
        x = np.empty(truth.x.shape)
        a = np.empty(truth.a.shape)
        deviations = _Deviations(*(float(getattr(n, name)) for name in _Deviations._fields))
        rows = [
            np.ascontiguousarray(v, float).reshape(-1, v.shape[-1])
            for v in (truth.x, truth.a, white)
        ]
        gravity = float(vehicle.gravity)
        _read(*rows, deviations, gravity, x.reshape(-1, 13), a.reshape(-1, 3))
        al = truth.al + n.angular_acceleration * white[..., 15:18]
        return Measurement(x=x, a=a, al=al, rotor=truth.rotor + self.rotor * white[..., 18:22])


@compiled
def _read(truth, a_true, white, noise, gravity, states, specific):
    """Write the noisy states (n, 13) and accelerations (n, 3) of `SensorNoise.measure`."""
    half = 0.5 * noise.attitude
    for row in range(len(truth)):
        true = truth[row]
        drawn = white[row]
        x = states[row]
        a = specific[row]
        for k in range(3):
            x[k] = true[k] + noise.position * drawn[k]
            x[7 + k] = true[7 + k] + noise.velocity * drawn[6 + k]
            x[10 + k] = true[10 + k] + noise.rate * drawn[9 + k]
        i = half * drawn[3]
        j = half * drawn[4]
        k = half * drawn[5]
        q_w = true[3]
        q_x = true[4]
        q_y = true[5]
        q_z = true[6]
        w = q_w - q_x * i - q_y * j - q_z * k
        b = q_w * i + q_x + q_y * k - q_z * j
        c = q_w * j - q_x * k + q_y + q_z * i
        d = q_w * k + q_x * j - q_y * i + q_z
        size = math.sqrt(w * w + b * b + c * c + d * d)
        x[3] = w / size
        x[4] = b / size
        x[5] = c / size
        x[6] = d / size
        felt = a_true[row]
        s_x, s_y, s_z = turned(q_w, -q_x, -q_y, -q_z, felt[0], felt[1], felt[2] + gravity)
        s_x = s_x + noise.acceleration * drawn[12]
        s_y = s_y + noise.acceleration * drawn[13]
        s_z += noise.acceleration * drawn[14]
        a[0], a[1], a[2] = turned(x[3], x[4], x[5], x[6], s_x, s_y, s_z)
        a[2] -= gravity
