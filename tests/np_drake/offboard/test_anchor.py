"""Laws of the anchor: the vehicle stands at the start of the track, and all else moves with it as a
rigid body.
"""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from np_drake import attitude
from np_drake.offboard.anchor import Anchor
from np_drake.rigid_body import P, Q, V, W

VECTORS = arrays(float, 3, elements=st.floats(-20, 20))
TURNS = arrays(float, 3, elements=st.floats(-3, 3))
STATES = st.builds(
    lambda p, turn, v, w: np.concatenate([p, attitude.from_rotation_vector(turn), v, w]),
    VECTORS,
    TURNS,
    VECTORS,
    TURNS,
)
START = np.array([1.0, -2.0, 1.5])


def level(place=(0.0, 0.0, 0.0), yaw: float = 0.0) -> np.ndarray:
    return np.concatenate(
        [place, attitude.from_rotation_vector(np.array([0.0, 0.0, yaw])), np.zeros(6)]
    )


@given(x=STATES, start=VECTORS)
def test_at_the_anchor_a_vehicle_is_at_the_start_and_heads_along_x(x, start):
    forward = attitude.rotation_matrix(x[Q])[:, 0]
    assume(np.hypot(*forward[:2]) > 0.05)  # a vehicle that points up has no heading
    own = Anchor.at(x, start).seen(x)
    np.testing.assert_allclose(own[P], start, atol=1e-9)
    heading = attitude.rotation_matrix(own[Q])[:2, 0]
    assert heading[0] > 0
    assert abs(heading[1]) < 1e-9


def test_a_level_vehicle_flies_forward_along_x_of_the_track():
    x = level((5.0, 6.0, 2.0), yaw=np.pi / 2)
    dut = Anchor.at(x, START)
    ahead = level((5.0, 7.0, 2.0), yaw=np.pi / 2)
    ahead[V] = [0.0, 3.0, 0.0]
    np.testing.assert_allclose(dut.seen(ahead)[P], START + [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(dut.seen(ahead)[V], [3.0, 0.0, 0.0], atol=1e-12)


@given(anchor=STATES, one=STATES, other=STATES)
def test_what_is_seen_is_a_rigid_motion_about_the_vertical(anchor, one, other):
    dut = Anchor.at(anchor, START)
    a, b = dut.seen(one), dut.seen(other)
    np.testing.assert_allclose(
        np.linalg.norm(a[P] - b[P]), np.linalg.norm(one[P] - other[P]), atol=1e-9
    )
    np.testing.assert_allclose((a - b)[2], (one - other)[2], atol=1e-9)
    np.testing.assert_allclose(a[V] @ b[V], one[V] @ other[V], atol=1e-9)
    np.testing.assert_allclose(a[9], one[9], atol=1e-9)
    np.testing.assert_array_equal(a[W], one[W])
    R_a, R_b, R_one, R_other = (attitude.rotation_matrix(x[Q]) for x in (a, b, one, other))
    np.testing.assert_allclose(R_a.T @ R_b, R_one.T @ R_other, atol=1e-9)
    np.testing.assert_allclose(R_a[2], R_one[2], atol=1e-9)  # the tilt


@given(anchor=STATES, x=STATES)
def test_place_and_attitude_turn_as_free_vectors_do(anchor, x):
    dut = Anchor.at(anchor, START)
    own = dut.seen(x)
    np.testing.assert_allclose(own[V], dut.turned(x[V]), atol=1e-9)
    np.testing.assert_allclose(own[P] - START, dut.turned(x[P] - anchor[P]), atol=1e-9)
    forward = np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(
        attitude.rotate(own[Q], forward), dut.turned(attitude.rotate(x[Q], forward)), atol=1e-9
    )


@given(x=STATES)
def test_the_state_that_is_seen_is_not_changed(x):
    before = x.copy()
    Anchor.at(x, START).seen(x)
    np.testing.assert_array_equal(x, before)


@given(p=VECTORS, yaw=st.floats(-3.1, 3.1), towards=st.floats(-np.pi, np.pi))
def test_a_vehicle_holds_where_it_is_and_not_once_it_has_left(p, yaw, towards):
    dut = Anchor.at(level(p, yaw), START)
    way = np.array([np.cos(towards), np.sin(towards), 0.0])
    assert dut.holds(level(p, yaw), START)
    assert dut.holds(level(p + 0.05 * way, yaw), START)
    assert not dut.holds(level(p + 1.0 * way, yaw), START)


@given(yaw=st.floats(-3.1, 3.1), sign=st.sampled_from([-1, 1]))
def test_a_vehicle_that_turns_away_does_not_hold(yaw, sign):
    dut = Anchor.at(level(yaw=yaw), START)
    assert dut.holds(level(yaw=yaw + 0.05 * sign), START)
    assert not dut.holds(level(yaw=yaw + 0.6 * sign), START)


@pytest.mark.parametrize("entry", range(7))
def test_a_state_that_is_not_a_number_does_not_hold(entry):
    x = level()
    dut = Anchor.at(x, START)
    x[entry] = np.nan
    assert not dut.holds(x, START)
