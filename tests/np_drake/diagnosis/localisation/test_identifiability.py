"""Laws of excitation and of effects that cannot be told apart."""

import numpy as np
import pytest

from np_drake.diagnosis.localisation import _confusables, excitation, excited
from np_drake.diagnosis.regressors import library_candidates


def test_excitation_is_that_of_the_flight(seen):
    dut = excitation([seen()])
    log = seen().log
    assert dut["speed [m/s]"] == pytest.approx(np.sqrt(np.mean(np.sum(log.v**2, axis=1))), rel=0.02)
    assert dut["rate [rad/s]"] == pytest.approx(
        np.sqrt(np.mean(np.sum(log.w**2, axis=1))), rel=0.02
    )
    assert dut["height span [m]"] == pytest.approx(np.ptp(log.p[:, 2]), rel=0.02)
    assert dut["duration [s]"] == pytest.approx(12.0, abs=0.03)
    assert dut["thrust variation [1]"] == pytest.approx(
        log.u[:, 0].std() / log.u[:, 0].mean(), rel=0.02
    )


@pytest.mark.parametrize("noise_of_the_log", [0.0, 1.0])
def test_a_hovering_flight_excites_nothing_and_a_moving_one_something(seen, noise_of_the_log):
    assert not excited(excitation([seen(vigour=0.0, noise=noise_of_the_log)]))
    assert excited(excitation([seen(noise=noise_of_the_log)]))


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=n, seed=i, noise=1.0) for i, n in enumerate("ab")]


def test_lively_flight_makes_delay_and_lag_collinear_but_not_a_clock(flights, noise):
    found = [c.effects for c in _confusables(flights, library_candidates(flights), noise)]
    assert ("command_delay", "motor_lag") in found
    assert not {("clock_offset", "command_delay"), ("clock_offset", "motor_lag")} & {*found}
    assert ("gyro_bias", "linear_drag") not in found
    assert ("mass_error", "thrust_scale") not in found


def test_in_hover_what_needs_motion_leaves_no_trace(seen, noise):
    flights = [seen(vigour=0.0, noise=1.0, seconds=4.0)]
    held_out = {
        c.effects
        for c in _confusables(flights, library_candidates(flights), noise)
        if len(c.effects) == 1
    }
    assert {("quadratic_drag",), ("translational_lift",), ("command_delay",)} <= held_out
    assert ("mass_error",) not in held_out
