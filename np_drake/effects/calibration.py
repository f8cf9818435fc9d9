"""Effects of what a healthy vehicle differs by from its drawing, so that a simulator flies the
calibrated vehicle.
"""

from collections.abc import Iterable
from typing import Any

from np_drake.effects.base import Effect
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.imu_mounting import ImuMounting
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.uneven_lag import UnevenLag
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import Calibration

FASTEST = 1e-3  # time constant below which a lag only makes an integrator stiff [s]; own choice


def in_flight(
    vehicle: Vehicle, *, measured: bool = False, others: Iterable[Any] = ()
) -> tuple[Effect, ...]:
    """Return the effects of the calibration of a vehicle file that act in a flight.

    Args:
        measured: whether thrust is that of measured rotor speed, which the motors have behind them.
        others: further effects; a lag among them takes the place of that of the file.
    """
    motors = (
        (UnevenLag, CommandDelay)
        if measured
        else (UnevenLag,)
        if any(isinstance(e, MotorLag) for e in others)
        else ()
    )
    return tuple(e for e in effects_of(vehicle.calibration, vehicle) if not isinstance(e, motors))


def effects_of(calibration: Calibration, vehicle: Vehicle) -> tuple[Effect, ...]:
    """Return the effects that add the calibration to the nominal model of the vehicle; none for the
    default.

    No effect has the position of the IMU: the simulated accelerometer is at Bo. `clock_offset` and
    `imu_tilt` change the log alone, and a sensor model refuses a clock offset
    (`np_drake.logs.clock.shift_state` applies it to the log).
    """
    c = calibration
    up = vehicle.rotor_time_constant
    down = up if c.rotor_time_constant_down is None else c.rotor_time_constant_down
    effects: tuple[Effect, ...] = (
        CenterOfMassOffset(*c.center_of_mass),
        *(WeakRotor(float(i), gain) for i, gain in enumerate(c.rotor_gains, 1)),
        *([UnevenLag(max(up, FASTEST), max(down, FASTEST))] if down != up else []),
        CommandDelay(c.command_delay),
        RotorGyroscopic(c.rotor_inertia),
        ImuMounting(*c.imu_tilt),
        ClockOffset(c.clock_offset),
    )
    return tuple(e for e in effects if e.acts)
