import numpy as np

from np_drake.control.cascade import AL, TARGET_SIZE, A, P, V, W, cascade_target
from np_drake.references.base import Hover
from np_drake.references.harmonic import lemniscate
from np_drake.vehicle import Vehicle

TRACK = lemniscate(length=1.5, width=0.75, height=1.6, speed=1.5, ramp=2.0)


def test_a_hover_asks_for_nothing_but_its_position():
    target = cascade_target(Vehicle(), Hover(np.array([1.0, 2.0, 3.0])).sample(np.zeros(2)))
    expected = np.zeros((2, TARGET_SIZE))
    expected[:, P] = [1.0, 2.0, 3.0]
    np.testing.assert_allclose(target, expected, atol=1e-12)  # rounding


def test_position_velocity_and_acceleration_are_the_references():
    flat = TRACK.sample(np.array([0.5, 3.0]))
    target = cascade_target(Vehicle(), flat)
    for part, expected in zip((P, V, A), flat, strict=False):
        np.testing.assert_array_equal(target[:, part], expected)


def test_the_angular_acceleration_is_the_derivative_of_the_rate():
    h = 1e-4  # [s]
    target = cascade_target(Vehicle(), TRACK.sample(3.0 + h * np.array([-1.0, 0.0, 1.0])))
    slope = (target[2, W] - target[0, W]) / (2 * h)
    np.testing.assert_allclose(target[1, AL], slope, atol=1e-4)  # of central differences [rad/s²]
