"""Laws of a payload's hidden swing and its pull."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.diagnosis.forward_model import (
    MOST_JUMPS,
    NEVER,
    STATE,
    _at_hooks,
    _start_of_swing,
    hidden_size,
    jumps,
    specific_pull,
)
from np_drake.effects import pendulum
from tests.np_drake.diagnosis.simulated_flights import knocked

SMALL = st.floats(-0.8, 0.8)


@settings(max_examples=50, deadline=None)
@given(st.tuples(*[SMALL] * 4), st.floats(0.1, 3.0), st.tuples(SMALL, SMALL, st.floats(0.5, 2.0)))
def test_a_swing_begins_on_the_sphere_and_moves_along_it(swing, length, pull):
    r, rate = _start_of_swing(np.array([length]), np.array([swing]), 9.81 * np.array(pull))
    assert np.linalg.norm(r) == pytest.approx(length)
    assert np.sum(r * rate) == pytest.approx(0.0, abs=1e-9)


def test_an_angle_of_swing_is_an_angle():
    still, moved = (
        _start_of_swing(np.ones(1), np.array([[a, 0, 0, 0]]), np.array([0, 0, 9.81]))[0][0]
        for a in (0, 0.3)
    )
    assert np.arccos(still @ moved) == pytest.approx(0.3)
    assert moved[0] == pytest.approx(np.sin(0.3))  # towards +x in W


def test_a_hook_moves_as_a_point_of_the_body_many_as_each_alone(seen):
    dut = seen()
    hooks = np.array([[0.1, 0.0, 0.0], [0.03, -0.2, 0.05]])
    together, rows = _at_hooks(dut.moving, hooks), dut.rows
    middle = 0.5 * (dut.t[1:] + dut.t[:-1])
    for i, hook in enumerate(hooks):
        v = pendulum.hook_velocity(hook, rows.x)
        expected = [np.interp(middle, rows.t, column) for column in v.T]
        np.testing.assert_allclose(together[:, i], np.transpose(expected), atol=1e-12)
        np.testing.assert_allclose(
            together[:, i], _at_hooks(dut.moving, hooks[i : i + 1])[:, 0], atol=1e-12
        )


def test_the_air_brakes_a_swing_under_a_hovering_vehicle(seen):
    dut = seen(vigour=0.0)
    how = {
        "lengths": np.full(2, 0.5),
        "swing": np.array([[0.1, 0, 0, 0]] * 2),
        "hooks": np.zeros((1, 3)),
    }
    pull = specific_pull(dut, **how, onset=None, damping=np.array([0.0, 0.5]))
    np.testing.assert_array_equal(pull[:, :1], specific_pull(dut, **how, onset=None)[:, :1])
    late = np.flatnonzero(dut.t > dut.t[-1] - 1.42)  # a period [s]
    vacuum, air = np.abs(pull[late, :, 0]).T
    decay = np.exp(-0.25 * dut.t[late[np.argmax(air)]])
    assert air.max() / vacuum.max() == pytest.approx(decay, rel=0.02)


def test_a_swing_may_jump_after_every_outlier_not_close_to_another(seen):
    dut = knocked(seen(seconds=8.0), 1.0, 1.2, 3.0)
    np.testing.assert_allclose(dut.t[jumps(dut, None)], [1.04, 3.04], atol=0.021)
    np.testing.assert_allclose(dut.t[jumps(dut, 2.0)], [3.04], atol=0.021)
    assert hidden_size(dut, None) == 3 * STATE
    assert len(jumps(dut, NEVER)) == 0
    assert len(jumps(knocked(seen(seconds=8.0), *np.arange(1.0, 7.0)), None)) == MOST_JUMPS
