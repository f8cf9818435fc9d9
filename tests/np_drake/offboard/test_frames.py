"""Laws of axes: north, east, down and forward, right, down against east, north, up and forward,
left, up.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from np_drake import attitude
from np_drake.offboard.frames import turned_attitude, turned_body, turned_world

VECTORS = arrays(float, 3, elements=st.floats(-100, 100))
ATTITUDES = arrays(float, 3, elements=st.floats(-3, 3)).map(attitude.from_rotation_vector)
TURNS = [turned_world, turned_body]


def test_north_is_y_and_east_is_x_and_down_is_minus_z():
    np.testing.assert_array_equal(turned_world(np.array([1.0, 2.0, 3.0])), [2.0, 1.0, -3.0])


def test_forward_stays_and_right_and_down_change_sign():
    np.testing.assert_array_equal(turned_body(np.array([1.0, 2.0, 3.0])), [1.0, -2.0, -3.0])


@pytest.mark.parametrize(
    ("heading", "yaw"), [(0.0, 90.0), (90.0, 0.0), (180.0, -90.0), (-90.0, 180.0)]
)
def test_a_heading_clockwise_from_north_is_a_yaw_from_east(heading, yaw):
    half = np.radians(heading) / 2
    R = attitude.rotation_matrix(turned_attitude(np.array([np.cos(half), 0.0, 0.0, np.sin(half)])))
    np.testing.assert_allclose(
        R[:, 0], [np.cos(np.radians(yaw)), np.sin(np.radians(yaw)), 0.0], atol=1e-12
    )
    np.testing.assert_allclose(R[:, 2], [0.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("turned", TURNS)
@given(r=VECTORS, s=VECTORS)
def test_the_turn_of_vectors_is_a_rotation_and_its_own_inverse(turned, r, s):
    np.testing.assert_allclose(turned(turned(r)), r, atol=1e-12)
    np.testing.assert_allclose(turned(r) @ turned(s), r @ s, atol=1e-8)
    np.testing.assert_allclose(np.cross(turned(r), turned(s)), turned(np.cross(r, s)), atol=1e-8)


@given(q=ATTITUDES)
def test_the_turn_of_an_attitude_is_its_own_inverse(q):
    twice = turned_attitude(turned_attitude(q))
    np.testing.assert_allclose(
        attitude.rotation_matrix(twice), attitude.rotation_matrix(q), atol=1e-12
    )
    assert np.linalg.norm(turned_attitude(q)) == pytest.approx(1.0, abs=1e-12)


@given(q=ATTITUDES, r=VECTORS)
def test_body_world_and_attitude_turn_together(q, r):
    np.testing.assert_allclose(
        attitude.rotate(turned_attitude(q), turned_body(r)),
        turned_world(attitude.rotate(q, r)),
        atol=1e-9,
    )
