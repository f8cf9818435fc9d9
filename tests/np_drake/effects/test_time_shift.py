"""Laws of time shifts: what lag, delay and clock move commands by."""

import pytest

from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle(rotor_time_constant=0.02)


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
