"""Laws of limits: a state is in order within all of them, and out of order beyond one, which is
named.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from np_drake import attitude
from np_drake.offboard.config import OffboardConfig
from np_drake.offboard.limits import out_of_limits
from np_drake.rigid_body import P, Q, V, W

LIMITS = OffboardConfig(margin=1.5, max_speed=6.0, max_tilt=0.8, max_rate=9.0)
UNIT = (
    arrays(float, 3, elements=st.floats(-1, 1))
    .filter(lambda r: np.linalg.norm(r) > 0.1)
    .map(lambda r: r / np.linalg.norm(r))
)
PLACES = arrays(float, 3, elements=st.floats(-50, 50))


def state(
    place=(0.0, 0.0, 0.0), *, turn=(0.0, 0.0, 0.0), v=(0.0, 0.0, 0.0), w=(0.0, 0.0, 0.0)
) -> np.ndarray:
    return np.concatenate([place, attitude.from_rotation_vector(np.array(turn)), v, w])


@given(place=PLACES, yaw=st.floats(-3.0, 3.0))
def test_a_vehicle_at_rest_on_its_reference_is_in_order_at_any_yaw(place, yaw):
    assert out_of_limits(state(place, turn=(0.0, 0.0, yaw)), place, LIMITS) == ""


@given(direction=UNIT, reference=PLACES, share=st.sampled_from([0.99, 1.01]))
@pytest.mark.parametrize("name", ["distance from the reference", "speed", "body rate"])
def test_each_limit_is_on_a_length_whatever_its_direction(name, direction, reference, share):
    x = state(reference)
    part, most = {
        "distance from the reference": (P, LIMITS.margin),
        "speed": (V, LIMITS.max_speed),
        "body rate": (W, LIMITS.max_rate),
    }[name]
    x[part] += share * most * direction
    found = out_of_limits(x, reference, LIMITS)
    assert found.startswith(name) if share > 1 else found == ""


@given(axis=st.floats(-np.pi, np.pi), yaw=st.floats(-3.0, 3.0), tilt=st.floats(0.0, np.pi))
def test_the_tilt_is_the_angle_of_body_z_to_the_vertical(axis, yaw, tilt):
    about = attitude.from_rotation_vector(tilt * np.array([np.cos(axis), np.sin(axis), 0.0]))
    x = state()
    x[Q] = attitude.multiply(about, attitude.from_rotation_vector(np.array([0.0, 0.0, yaw])))
    found = out_of_limits(x, np.zeros(3), LIMITS)
    if abs(tilt - LIMITS.max_tilt) > 1e-6:
        assert found.startswith("tilt") == (tilt > LIMITS.max_tilt)


def test_what_is_told_names_value_and_limit():
    assert (
        out_of_limits(state(v=(0.0, 7.25, 0.0)), np.zeros(3), LIMITS) == "speed 7.25 m/s, limit 6"
    )


@pytest.mark.parametrize("entry", range(13))
def test_a_state_that_is_not_a_number_is_out_of_order(entry):
    x = state()
    x[entry] = np.nan
    assert out_of_limits(x, np.zeros(3), LIMITS)


def test_a_reference_that_is_not_a_number_is_out_of_order():
    assert out_of_limits(state(), np.array([0.0, np.nan, 0.0]), LIMITS)
