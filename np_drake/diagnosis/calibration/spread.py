"""Documented spread of healthy vehicles about their file, and of flights about their vehicle.

Every figure is a standard deviation that is part of each model of an unmeasured vehicle:
calibration, and no cause. Lengths count in mean arms, moments in weight times arm.
"""

import dataclasses as dc
from collections.abc import Iterable

import numpy as np

from np_drake.diagnosis.options import SPREAD, Spread, Tolerance
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.accelerometer_bias import AccelerometerBias
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.attitude_latency import AttitudeLatency
from np_drake.effects.base import Effect
from np_drake.effects.battery_sag import BatterySag
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.imu_mounting import ImuMounting
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.mass_error import MassError
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.parameter import arm
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.effects.velocity_bias import VelocityBias
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.logs.inputs import VOLTAGE_SCATTER, voltage_of
from np_drake.vehicle import Vehicle
from np_drake.vehicle.published import published_priors
from np_drake.vehicle.sources import part

ROTORS = (1.0, 2.0, 3.0, 4.0)
SURE = 1.96  # half of a 95 % interval over its standard deviation [1]
LEAST = 1e-3  # of a stated deviation over that of healthy vehicles [1]


@dc.dataclass(frozen=True)
class Deviation:
    """Standard deviations of parameters of an effect, by name [SI]; `fixed` ones have a value.

    at_value: the deviation is that of a coefficient of the effect at these values, which is not
    linear.
    """

    effect: type[Effect]
    deviation: dict[str, float]
    fixed: dict[str, float] = dc.field(default_factory=dict)
    at_value: bool = False


def of_vehicle(
    e: FlightResiduals, tolerance: Tolerance, spread: Spread = SPREAD
) -> list[Deviation]:
    """Return by what a healthy vehicle differs from its file; nothing where the file describes the
    vehicle that flew.

    Of a number of its calibration for which the file states an interval, the deviation is that of
    the interval.
    """
    if not tolerance.unmeasured:
        return []
    vehicle, measured = e.vehicle, e.measured_rotors
    span, mass = arm(vehicle), vehicle.mass
    moment = spread.flapping * mass * span
    rotor = published_priors().rotor_inertia.median * mass * span**2
    gains = zip(ROTORS, _stated(vehicle, "rotor_gains", [spread.rotor_gain] * 4), strict=True)
    level, height = spread.center_of_mass * span, spread.center_of_mass_height * span
    (rotor,) = _stated(vehicle, "rotor_inertia", [rotor])
    (clock,) = _stated(
        vehicle, "clock_offset", [spread.rotor_speed_time if measured else spread.command_time]
    )
    tilt = _stated(vehicle, "imu_tilt", [spread.mounting] * 3)
    found = [
        *(Deviation(WeakRotor, {"efficiency": gain}, {"rotor": i}) for i, gain in gains),
        Deviation(
            CenterOfMassOffset,
            _by("xyz", _stated(vehicle, "center_of_mass", [level, level, height])),
        ),
        Deviation(MixerGain, dict.fromkeys(("roll", "pitch", "yaw"), spread.torque_gain)),
        Deviation(BladeFlapping, {"moment": moment}),
        Deviation(TranslationalLift, {"lift": spread.lift * mass}),
        Deviation(RotorGyroscopic, {"rotor_inertia": rotor}),
        Deviation(ClockOffset, {"offset": clock}),
    ]
    if "attitude" not in e.log.lacks:
        found += [
            Deviation(ImuMounting, _by(("roll", "pitch", "yaw"), tilt)),
            Deviation(AttitudeLatency, {"latency": spread.latency}),
        ]
    if e.log.a is not None:
        found.append(_axes(AccelerometerBias, spread.accelerometer_offset))
    if not measured:
        (delay,) = _stated(vehicle, "command_delay", [spread.command_time])
        found.append(Deviation(CommandDelay, {"delay": delay}))
        lags = spread.lags if "rotor_time_constant" not in vehicle.intervals else ()
        found += [Deviation(MotorLag, {"time_constant": lag}, at_value=True) for lag in lags]
    return found


def _stated(vehicle: Vehicle, field: str, healthy: list[float]) -> list[float]:
    """Return the standard deviations of the numbers of a field of the calibration: as stated, else
    of healthy ones.
    """
    name, said = f"calibration.{field}", vehicle.intervals
    every = [said.get(part(name, i)) or said.get(name, [])[i : i + 1] for i in range(len(healthy))]
    halves = ([0.5 * (high - low) for low, high in pairs] for pairs in every)
    return [
        max(*half, LEAST * usual) / SURE if half else usual
        for half, usual in zip(halves, healthy, strict=True)
    ]


def calibrated_alone(e: FlightResiduals, tolerance: Tolerance) -> set[str]:
    """Return the effects that are calibration whatever their size, and causes only where they begin
    in flight.

    A mass, where the scale of a throttle's map takes its place; of an unmeasured vehicle sensors,
    torque gains, inertia and times of commands.
    """
    mass = {MassError.identifier} if e.log.input == "normalised" else set[str]()
    if not tolerance.unmeasured:
        return mass
    every = [*of_vehicle(e, tolerance), *of_flight(e, tolerance)]
    # Of inertia and the share of torque that acts a flight shows the ratio alone.
    return (
        mass
        | {InertiaError.identifier}
        | {
            d.effect.identifier
            for d in every
            if d.effect.place == "measurement"
            or d.effect.role == "mixer"
            or d.effect.shifts_commands
        }
    )


def of_flight(e: FlightResiduals, tolerance: Tolerance, spread: Spread = SPREAD) -> list[Deviation]:
    """Return by what a flight differs from the others of its vehicle: sensors, and for an
    unmeasured vehicle trim.
    """
    least = (
        spread
        if tolerance.unmeasured
        else Spread(tilt=0.0, gyro=0.0, velocity=0.0, accelerometer=0.0)
    )
    tilt = max(tolerance.attitude, least.tilt)
    found = [
        *(
            []
            if e.log.a is None
            else [_axes(AccelerometerBias, max(tolerance.acceleration, least.accelerometer))]
        ),
        Deviation(AttitudeBias, dict.fromkeys(("roll", "pitch", "yaw"), tilt)),
        _axes(GyroBias, max(tolerance.rate, least.gyro)),
        _axes(VelocityBias, max(tolerance.velocity, least.velocity)),
    ]
    if not tolerance.unmeasured:
        return [*found, *of_battery(e, spread)]
    return [
        *found,
        *(Deviation(WeakRotor, {"efficiency": spread.rotor_trim}, {"rotor": i}) for i in ROTORS),
        *(of_battery(e, spread) or _battery(spread.known_charge, spread.known_sag)),
    ]


def of_battery(e: FlightResiduals, spread: Spread = SPREAD) -> list[Deviation]:
    """Return by what thrust over throttle differs from that of other flights, as the battery does;
    else nothing.
    """
    if e.log.input != "normalised":
        return []
    volts = voltage_of(e.log)
    if volts is None:
        return _battery(spread.unknown_charge, spread.sag)
    # The power of a voltage that falls is known to a third: thrust falls by so much more or less.
    fall = VOLTAGE_SCATTER * float(np.ptp(np.log(volts))) / float(np.ptp(e.log.t))
    return _battery(spread.charge, float(np.hypot(spread.known_sag, fall)))


def _battery(charge: float, sag: float) -> list[Deviation]:
    return [Deviation(ThrustScale, {"scale": charge}), Deviation(BatterySag, {"rate": sag})]


def _axes(effect: type[Effect], deviation: float) -> Deviation:
    return Deviation(effect, dict.fromkeys("xyz", deviation))


def _by(names: Iterable[str], deviations: list[float]) -> dict[str, float]:
    return dict(zip(names, deviations, strict=True))


def parameter_names(deviations: list[Deviation]) -> list[str]:
    """Return the names of all parameters of deviations, as `weak_rotor[2].efficiency`."""
    return [f"{_name(d)}.{name}" for d in deviations for name in d.deviation]


def _name(d: Deviation) -> str:
    fixed = "".join(f"[{value:g}]" for value in d.fixed.values())
    return f"{d.effect.identifier}{fixed}"


def sizes(deviations: list[Deviation]) -> np.ndarray:
    """Return the standard deviations (k,) of all parameters of deviations [SI]."""
    return np.array([size for d in deviations for size in d.deviation.values()])
