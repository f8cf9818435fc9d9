import numpy as np
import pytest

from np_drake.references.base import Paced
from np_drake.references.points import Spline, Stops

POINTS = np.array([[0, 0, 1.0], [1, 0, 1.0], [1, 2, 1.5], [0, 1, 1.0]])
STOPS = Stops(POINTS, np.array([0.5, 2.0, 3.5]), np.array([1.0, 1.5, 1.2]))
SPLINE = Spline(POINTS, np.array([0.0, 1.5, 3.0, 4.5]))


@pytest.mark.parametrize(
    "dut", [STOPS, SPLINE, Paced(STOPS, 0.7)], ids=["stops", "spline", "paced"]
)
def test_derivatives_are_those_of_the_track(dut):
    t, h = np.linspace(0.05, 4.4, 80), 1e-5
    sooner, now, later = (dut.sample(t + shift) for shift in (-h, 0.0, h))
    for k in range(3):
        np.testing.assert_allclose((later[k] - sooner[k]) / (2 * h), now[k + 1], atol=2e-3)


@pytest.mark.parametrize("dut", [STOPS, SPLINE], ids=["stops", "spline"])
def test_it_rests_before_and_after(dut):
    flat = dut.sample(np.array([-1.0, 0.0, 9.0]))
    np.testing.assert_allclose(flat[0], POINTS[[0, 0, -1]], atol=1e-12)
    np.testing.assert_allclose(flat[1:4], 0.0, atol=1e-9)


def test_stops_stop_at_every_point():
    flat = STOPS.sample(np.array([1.7, 3.5, 4.8]))
    np.testing.assert_allclose(flat[0], POINTS[1:], atol=1e-12)
    np.testing.assert_allclose(flat[1], 0.0, atol=1e-12)


def test_the_spline_passes_its_points():
    np.testing.assert_allclose(SPLINE.sample(np.array([1.5, 3.0]))[0], POINTS[1:3], atol=1e-12)
