"""Laws of time shifts: what lag, delay and clock move commands by, and when that is no cause."""

import dataclasses as dc

import pytest

from np_drake.diagnosis.decision.inclusion import within_timing
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.tolerance import Tolerance
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle(rotor_time_constant=0.02)
HALF_A_ROW = Options.for_sensors(True, dc.replace(Tolerance(), timing=0.01))  # [s]


@pytest.mark.parametrize(
    "effect, shift",
    [
        (MotorLag(0.05), 0.03),
        (MotorLag(0.013), -0.007),
        (CommandDelay(0.02), 0.02),
        (ClockOffset(0.02), -0.02),
    ],
)
def test_lag_delay_and_clock_move_commands(effect, shift):
    assert effect.time_shift(VEHICLE) == pytest.approx(shift)


def test_a_drag_moves_no_command():
    assert LinearDrag(1.0, 1.0, 1.0).time_shift(VEHICLE) == 0.0


@pytest.mark.parametrize(
    "effect", [MotorLag(0.013), MotorLag(0.034), CommandDelay(0.014), ClockOffset(-0.014)]
)
def test_a_shift_within_what_the_log_leaves_open_is_no_cause(effect):
    assert within_timing(effect, VEHICLE, HALF_A_ROW)
    assert not within_timing(effect, VEHICLE, Options.for_sensors(True))  # a log that says when commands act


@pytest.mark.parametrize(
    "effect", [MotorLag(0.06), CommandDelay(0.03), ClockOffset(-0.03), LinearDrag(1, 1, 1)]
)
def test_a_larger_shift_and_any_other_effect_may_be_one(effect):
    assert not within_timing(effect, VEHICLE, HALF_A_ROW)
