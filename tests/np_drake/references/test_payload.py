"""Laws of motions that carry a payload: on a track, and of a formation."""

import numpy as np
import pytest

from np_drake.references.base import Hover
from np_drake.references.harmonic import circle, lemniscate
from np_drake.references.payload import PayloadTrack, closest_approach, payload_drop, polygon
from np_drake.vehicle import Vehicle

HOOK = [0.0, 0.0, -0.025]
GRAVITY = np.array([0.0, 0.0, Vehicle().gravity])


def test_over_a_payload_at_rest_the_vehicle_stands_by_cable_and_hook():
    flat = PayloadTrack(Hover(np.array([1.0, 2.0, 0.5])), Vehicle(), length=0.8, hook=HOOK).sample(
        np.zeros(1)
    )
    np.testing.assert_allclose(flat[0, 0], [1.0, 2.0, 1.325], atol=1e-12)
    np.testing.assert_allclose(flat[1:], 0.0, atol=1e-5)


def test_the_cable_has_its_length_and_pulls_along_the_acceleration():
    track = lemniscate(length=1.5, width=0.75, height=1.0, speed=1.2, ramp=2.0)
    t = np.linspace(0.0, 12.0, 300)
    way = (
        PayloadTrack(track, Vehicle(), length=0.8, hook=[0.0, 0.0, 0.0]).sample(t)[0]
        - track.sample(t)[0]
    )
    np.testing.assert_allclose(np.linalg.norm(way, axis=1), 0.8, atol=1e-9)
    np.testing.assert_allclose(np.cross(way, track.sample(t)[2] + GRAVITY), 0.0, atol=1e-8)


@pytest.mark.parametrize("k", [0, 1, 2, 3])
def test_derivatives_are_those_of_the_motion(k):
    dut = PayloadTrack(
        circle(radius=1.0, height=1.0, speed=1.5, ramp=2.0), Vehicle(), length=0.8, hook=HOOK
    )
    t, h = np.linspace(2.5, 8.0, 60), 1e-4
    slope = (dut.sample(t + h)[k] - dut.sample(t - h)[k]) / (2 * h)
    np.testing.assert_allclose(slope, dut.sample(t)[k + 1], atol=1e-3)


def test_the_least_pull_is_that_at_the_top_of_a_heave():
    class Heave:
        def sample(self, t):
            flat = np.zeros((5, len(t), 3))
            flat[2, :, 2] = -0.75 * Vehicle().gravity * np.sin(t)
            return flat

    dut = PayloadTrack(Heave(), Vehicle(), length=0.8, hook=HOOK)
    assert dut.least_pull(np.linspace(0.0, 3.2, 1000)) == pytest.approx(0.25, abs=1e-5)


@pytest.mark.parametrize("count", [2, 3, 4, 7])
def test_neighbours_are_as_far_apart_as_asked_and_the_middle_is_the_origin(count):
    p = polygon(count, 0.9)
    np.testing.assert_allclose(
        np.linalg.norm(p - np.roll(p, 1, axis=0), axis=1), 0.9, atol=1e-12
    )  # [m]
    np.testing.assert_allclose(p.mean(axis=0), 0.0, atol=1e-12)
    assert closest_approach(p[:, None]) == pytest.approx(0.9)


def test_a_single_vehicle_flies_over_its_payload():
    np.testing.assert_array_equal(polygon(1, 0.9), np.zeros((1, 3)))
    assert payload_drop(0.0, 0.8, -0.025) == pytest.approx(-0.825)
    assert closest_approach(np.zeros((1, 5, 3))) == np.inf


def test_cables_lean_by_the_right_triangle_and_must_reach_the_middle():
    assert payload_drop(0.3, 0.5, 0.0) == pytest.approx(-0.4)  # 3, 4, 5
    with pytest.raises(ValueError, match="radius must be below"):
        payload_drop(0.8, 0.8, 0.0)


def test_closest_approach_is_taken_over_time():
    t = np.linspace(0.0, 1.0, 11)
    p = np.stack([np.outer(t, [1.0, 0, 0]), np.outer(1 - t, [1.0, 0, 0]) + [0, 0.2, 0]])
    assert closest_approach(p) == pytest.approx(0.2)  # [m]; they pass each other at t = 0.5
