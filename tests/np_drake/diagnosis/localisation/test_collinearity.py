"""Laws of collinear predicted residuals."""

import dataclasses as dc

import pytest

from diagrams.challenge.truth import Collinearity
from np_drake.diagnosis.forward_model.payload_state import Term
from np_drake.diagnosis.forward_model.prediction import predicted_residual
from np_drake.diagnosis.options import IDEAL_SENSORS, Tolerance
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.thrust_scale import ThrustScale


def same_as(seen, noise, *effects, i=0, tolerance=IDEAL_SENSORS, vigour=1.0):
    flights = [seen(*effects, name="a", seed=1, noise=1.0, seconds=8.0, vigour=vigour)]
    return Collinearity(flights, noise, tolerance).doubles([Term(e) for e in effects], i)


def test_a_delay_and_a_clock_behind_are_the_same(seen, noise):
    assert same_as(seen, noise, CommandDelay(0.03))[0] == "clock_offset"
    assert same_as(seen, noise, ClockOffset(-0.03))[0] == "command_delay"


def test_a_clock_ahead_is_no_delay(seen, noise):
    assert "command_delay" not in same_as(seen, noise, ClockOffset(0.03))


def test_a_drag_and_a_biased_gyro_are_not_the_same(seen, noise):
    drag = same_as(seen, noise, LinearDrag())
    gyro = same_as(seen, noise, GyroBias())
    assert "gyro_bias" not in drag
    assert "linear_drag" not in gyro


@pytest.mark.parametrize("effect", [LinearDrag(), CommandDelay()], ids=lambda e: e.identifier)
def test_no_effect_is_its_own_double(seen, noise, effect):
    assert effect.identifier not in same_as(seen, noise, effect)


def test_without_torque_more_mass_is_less_thrust(seen, noise):
    assert "thrust_scale" in same_as(seen, noise, MassError(0.2), vigour=(0.0, 0.0, 1.0, 0.0))


def test_what_is_named_beside_it_already_does_not_count(seen, noise):
    both = (MassError(0.2), ThrustScale(0.95))
    assert "thrust_scale" not in same_as(seen, noise, *both, vigour=(0.0, 0.0, 1.0, 0.0))


def test_what_a_rig_may_be_off_by_can_stand_in_for_an_effect(seen, noise):
    slight = GyroBias(0.005, 0.0, 0.0)
    strict, loose = (
        same_as(seen, noise, slight, tolerance=t) for t in (IDEAL_SENSORS, Tolerance())
    )
    assert len(loose) > len(strict)


def test_of_a_trace_the_effect_that_left_it_is_found(seen, noise):
    flight = seen(name="a", seed=1, noise=1.0, seconds=8.0)
    trace = {"a": predicted_residual(flight, [Term(LinearDrag(0.1, 0.1, 0.1))])}
    assert "linear_drag" in Collinearity([flight], noise, IDEAL_SENSORS).effects_of(trace)


def test_of_what_is_lost_in_noise_no_effect_is_found(seen, noise):
    flight = seen(name="a", seed=1, noise=1.0, seconds=8.0)
    faint = {"a": predicted_residual(flight, [Term(LinearDrag(1e-6, 1e-6, 1e-6))])}
    assert Collinearity([flight], noise, IDEAL_SENSORS).effects_of(faint) == []


@pytest.mark.parametrize(
    "effect, thrust, same",
    [
        (ThrustScale(0.97), 0.02, True),
        (ThrustScale(0.97), 0.005, False),  # six standard deviations
        (
            GyroBias(0.01, 0.0, 0.0),
            0.02,
            False,
        ),  # within the tolerance of a sensor, not of the vehicle file
        (ThrustScale(1 - 1e-7), 0.02, False),  # noise alone hides it
    ],
)
def test_only_what_the_vehicle_file_may_be_off_by_is_calibration(seen, noise, effect, thrust, same):
    flights = [seen(effect, name="a", seed=1, noise=1.0, seconds=8.0)]
    dut = Collinearity(flights, noise, dc.replace(Tolerance(), thrust=thrust))
    assert dut.is_calibration(dut.contribution([Term(effect)], 0)) is same
