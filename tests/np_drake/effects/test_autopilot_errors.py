"""Laws of the nuisance effects of an autopilot's logs: turned axes, a late attitude."""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.effects.attitude_latency import AttitudeLatency
from np_drake.effects.base import Measurement
from np_drake.effects.imu_mounting import ImuMounting
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
MOUNTED, LATE = ImuMounting(0.05, -0.03, 0.02), AttitudeLatency(0.02)


def spinning(w: np.ndarray, t: np.ndarray) -> Measurement:
    """Return a motion with constant body rates w (3,) [rad/s]."""
    x = np.zeros((len(t), 13))
    x[:, Q] = attitude.from_rotation_vector(t[:, None] * w)
    x[:, W] = w
    x[:, P], x[:, V] = [1.0, 2.0, 3.0], [0.4, 0.5, 0.6]
    return Measurement(x, np.ones((len(t), 3)), np.zeros((len(t), 3)), np.zeros((len(t), 4)))


def measured(effect, truth: Measurement) -> Measurement:
    return effect.measure(VEHICLE, truth, np.zeros((len(truth.x), 0)))


T = 0.01 * np.arange(200)
TRUTH = spinning(np.array([0.5, -0.8, 0.3]), T)


@pytest.mark.parametrize("effect", [ImuMounting, AttitudeLatency])
def test_a_neutral_one_reads_the_truth(effect):
    np.testing.assert_allclose(measured(effect.neutral(), TRUTH).x, TRUTH.x, atol=1e-15)


def test_turned_axes_read_a_vector_of_the_world_turned_by_the_mounting():
    x = measured(MOUNTED, TRUTH).x
    down = np.tile([0.0, 0.0, -9.81], (len(T), 1))
    turned = attitude.from_rotation_vector(np.array([[0.05, -0.03, 0.02]]))
    expected = attitude.rotate_back(
        np.repeat(turned, len(T), axis=0), attitude.rotate_back(TRUTH.x[:, Q], down)
    )
    np.testing.assert_allclose(attitude.rotate_back(x[:, Q], down), expected, atol=1e-12)


def test_turned_axes_read_rates_that_are_those_of_the_turned_attitude():
    x = measured(MOUNTED, TRUTH).x
    rate = (
        attitude.rotation_vector(attitude.multiply(attitude.conjugate(x[:-1, Q]), x[1:, Q]))
        / np.diff(T)[:, None]
    )
    np.testing.assert_allclose(rate, x[:-1, W], atol=1e-9)
    assert np.abs(x[:, W] - TRUTH.x[:, W]).max() > 0.01  # the true rates are not


def test_a_late_attitude_is_that_of_before_and_all_else_is_of_now():
    late = measured(LATE, TRUTH)
    # exact at constant rates
    np.testing.assert_allclose(late.x[2:, Q], TRUTH.x[:-2, Q], atol=1e-12)
    same = np.delete(np.arange(13), np.arange(13)[Q])
    np.testing.assert_array_equal(late.x[:, same], TRUTH.x[:, same])
    np.testing.assert_array_equal(late.a, TRUTH.a)
