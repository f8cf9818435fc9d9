"""Laws of excitation and of effects that cannot be told apart."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.localisation import (
    _confusables,
    assess_identifiability,
    excitation,
    excited,
)
from np_drake.diagnosis.regressors import library_candidates
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.diagnosis.result import CHANNELS
from np_drake.vehicle import Vehicle


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


def test_flights_are_pooled(seen):
    both = excitation([seen(), seen(vigour=0.0, name="b")])
    assert both["duration [s]"] == pytest.approx(24.0, abs=0.06)
    assert both["speed [m/s]"] == pytest.approx(
        excitation([seen()])["speed [m/s]"] / np.sqrt(2), rel=1e-3
    )


@pytest.mark.parametrize("noise_of_the_log", [0.0, 1.0])
def test_a_hovering_flight_excites_nothing_and_a_moving_one_something(seen, noise_of_the_log):
    assert not excited(excitation([seen(vigour=0.0, noise=noise_of_the_log)]))
    assert excited(excitation([seen(noise=noise_of_the_log)]))


@pytest.mark.parametrize("axes", [(1, 0, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)])
def test_motion_along_one_axis_is_enough(seen, axes):
    assert excited(excitation([seen(vigour=axes)]))


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=n, seed=i, noise=1.0) for i, n in enumerate("ab")]


def test_lively_flight_makes_delay_and_lag_collinear_but_not_a_clock(flights, noise):
    found = [c.effects for c in _confusables(flights, library_candidates(flights), noise)]
    assert ("command_delay", "motor_lag") in found
    assert not {("clock_offset", "command_delay"), ("clock_offset", "motor_lag")} & {*found}
    assert ("gyro_bias", "linear_drag") not in found
    assert ("mass_error", "thrust_scale") not in found


def test_in_a_vertical_flight_mass_and_thrust_are_collinear(seen, noise):
    flights = [seen(noise=1.0, vigour=(0.0, 0.0, 1.0, 0.0))]
    found = {c.effects: c for c in _confusables(flights, library_candidates(flights), noise)}
    assert "torque" in found[("mass_error", "thrust_scale")].manoeuvre
    assert ("linear_drag",) not in found


def test_in_hover_what_needs_motion_leaves_no_trace(seen, noise):
    flights = [seen(vigour=0.0, noise=1.0, seconds=4.0)]
    held_out = {
        c.effects
        for c in _confusables(flights, library_candidates(flights), noise)
        if len(c.effects) == 1
    }
    assert {("quadratic_drag",), ("translational_lift",), ("command_delay",)} <= held_out
    assert ("mass_error",) not in held_out


def test_the_answer_has_floor_and_excitation_and_passes_notes_on(flights, noise):
    noted = dc.replace(flights[0], log=dc.replace(flights[0].log, notes=["al differentiated"]))
    dut = assess_identifiability([noted], [flights[1]], library_candidates(flights[:1]), noise)
    assert dut.usable
    assert dut.noise_floor == {name: noise.rms[i] for i, name in enumerate(CHANNELS)}
    assert dut.excitation == excitation([noted])
    assert "a: al differentiated" in dut.warnings
    assert all("\n" not in w for w in dut.warnings)


def test_what_a_log_lacks_is_said(fly, noise):
    bare = make_flight_residuals(fly(name="bare", accelerations=False, seconds=4.0), Vehicle())
    shaky = make_flight_residuals(
        fly(name="shaky", attitude_noise=0.01, noise=1.0, seconds=4.0), Vehicle()
    )
    rotors = make_flight_residuals(
        dc.replace(fly(name="rotors", seconds=4.0), input="rotor_speed"), Vehicle()
    )
    for flight, word in (
        (bare, "no acceleration"),
        (shaky, "attitude noise"),
        (rotors, "rotor speed"),
    ):
        dut = assess_identifiability([flight], [flight], library_candidates([flight]), noise)
        assert any(word in w for w in dut.warnings)
