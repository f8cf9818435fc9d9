"""Laws of motions through waypoints: stops, and how near they come to their points."""

import numpy as np
import pytest

from np_drake.references.base import Paced
from np_drake.references.waypoints import ACCELERATION, PointToPoint, Spline, Stops, nearest

LINE = np.array([[0, 0, 1.0], [1, 0, 1.0], [1, 1, 1.5], [0, 1, 1.5]])
SQUARE = np.concatenate([LINE, LINE[:1]])
MOTIONS = {
    "stops": PointToPoint(LINE, speed=0.8, rest=0.5),
    "stops round": PointToPoint(SQUARE, speed=0.8, rest=0.5),
}
STOPS = Stops(LINE, np.array([0.5, 2.0, 3.5]), np.array([1.0, 1.5, 1.2]))
SPLINE = Spline(LINE, np.array([0.0, 1.5, 3.0, 4.5]))


@pytest.mark.parametrize("dut", [*MOTIONS.values(), STOPS, SPLINE, Paced(STOPS, 0.7)])
def test_derivatives_are_those_of_the_motion(dut):
    t, h = np.linspace(0.05, 7.0, 80), 1e-5
    sooner, now, later = (dut.sample(t + shift) for shift in (-h, 0.0, h))
    for k in range(3):
        np.testing.assert_allclose((later[k] - sooner[k]) / (2 * h), now[k + 1], atol=2e-3)


@pytest.mark.parametrize("name", MOTIONS)
def test_it_passes_every_waypoint_from_rest_and_an_open_one_to_rest(name):
    dut = MOTIONS[name]
    t = np.linspace(0.0, min(dut.end, 14.0), 20_000)
    assert nearest(dut.points, dut.sample(t)[0]).max() < 1e-6  # [m]
    flat = dut.sample(np.array([-1.0, 0.0, min(dut.end, 1e3) + 1.0]))
    np.testing.assert_allclose(flat[0, :2], LINE[[0, 0]], atol=1e-12)
    np.testing.assert_allclose(flat[1:4, :2], 0.0, atol=1e-8)
    if dut.end < np.inf:
        np.testing.assert_allclose(flat[0, 2], LINE[-1], atol=1e-12)
        np.testing.assert_allclose(flat[1:, 2], 0.0, atol=1e-9)


def test_timed_points_are_passed_at_their_times():
    flat = STOPS.sample(np.array([-1.0, 1.7, 3.5, 4.8, 9.0]))
    np.testing.assert_allclose(flat[0], LINE[[0, 1, 2, 3, 3]], atol=1e-12)
    np.testing.assert_allclose(flat[1], 0.0, atol=1e-12)
    flat = SPLINE.sample(np.array([-1.0, 1.5, 3.0, 9.0]))
    np.testing.assert_allclose(flat[0], LINE, atol=1e-12)
    np.testing.assert_allclose(flat[1:4, [0, -1]], 0.0, atol=1e-9)


def test_stops_stay_on_the_legs_and_rest_at_each_corner():
    dut = MOTIONS["stops round"]
    t = np.linspace(0.0, 14.0, 14_001)
    flat = dut.sample(t)
    assert nearest(flat[0][::20], SQUARE).max() < 1e-9  # [m]
    still = np.linalg.norm(flat[1], axis=1) < 1e-9
    at_corner = np.linalg.norm(flat[0][:, None] - SQUARE, axis=2).min(axis=1) < 1e-9
    assert at_corner[still].all()
    assert 0.4 * 7 < np.sum(still) * 1e-3 < 0.6 * 8  # [s]; half a second at each of seven corners


def test_a_short_leg_between_stops_takes_longer_than_its_speed_says():
    flat = MOTIONS["stops"].sample(np.linspace(0.0, 8.0, 8001))
    assert np.linalg.norm(flat[2], axis=1).max() == pytest.approx(ACCELERATION, rel=1e-3)
    long = PointToPoint(np.array([[0, 0, 1.0], [9, 0, 1.0]]), speed=0.5, rest=0.0)
    assert long.end == pytest.approx(9 / 0.5)


def test_a_point_between_two_rows_is_passed():
    p = np.array([[0, 0, 1.0], [1.0, 0, 1.0]])
    np.testing.assert_allclose(nearest(np.array([[0.4, 0.3, 1.0], [2.0, 0, 1.0]]), p), [0.3, 1.0])
    np.testing.assert_allclose(nearest(np.array([[0.4, 0.3, 1.0]]), p[:1]), [0.5])
