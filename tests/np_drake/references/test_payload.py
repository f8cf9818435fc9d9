"""Laws of a formation that carries a payload."""

import numpy as np
import pytest

from np_drake.references.payload import closest_approach, payload_drop, polygon
from np_drake.vehicle import Vehicle

HOOK = [0.0, 0.0, -0.025]
GRAVITY = np.array([0.0, 0.0, Vehicle().gravity])


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
