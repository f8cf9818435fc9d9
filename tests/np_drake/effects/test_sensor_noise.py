"""Laws of the sensors' noise, for one instant of the simulator and for many rows at once."""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.effects.base import Measurement
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle

VEHICLE = Vehicle()
G = np.array([0.0, 0.0, VEHICLE.gravity])
NOISE = MeasurementNoise(
    position=0.1, attitude=0.4, velocity=0.2, rate=0.3, acceleration=0.7, angular_acceleration=1.1
)
DUT = SensorNoise(NOISE, rotor=5.0)


def truth_of(seed: int) -> Measurement:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(13)
    x[3:7] /= np.linalg.norm(x[3:7])
    return Measurement(x, rng.standard_normal(3), rng.standard_normal(3), 100 * rng.random(4))


@pytest.mark.parametrize("seed", range(6))
def test_attitude_turns_about_body_axes_and_acceleration_turns_with_it(seed):
    truth, white = truth_of(seed), np.random.default_rng(100 + seed).standard_normal(22)
    read = DUT.measure(VEHICLE, truth, white)
    turn = attitude.multiply(attitude.conjugate(truth.x[3:7]), read.x[3:7])
    np.testing.assert_allclose(turn[1:] / turn[0], 0.5 * 0.4 * white[3:6], atol=1e-12)
    felt, true = (attitude.rotate_back(m.x[3:7], m.a + G) for m in (read, truth))
    np.testing.assert_allclose(felt - true, 0.7 * white[12:15], atol=1e-12)
