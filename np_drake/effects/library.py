"""All effects by identifier, as the diagnosis searches them.

A new effect is one file, and one registration: `@register` on its class, or its line here.
"""

from np_drake.effects.accelerometer_bias import AccelerometerBias
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.attitude_latency import AttitudeLatency
from np_drake.effects.base import Effect, SensorEffect, WrenchEffect
from np_drake.effects.battery_sag import BatterySag
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.ground_effect import GroundEffect
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.imu_mounting import ImuMounting
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.rotor_inflow import RotorInflow
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.throttle_curve import ThrottleCurve
from np_drake.effects.thrust_ceiling import ThrustCeiling
from np_drake.effects.thrust_drift import ThrustDrift
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.effects.velocity_bias import VelocityBias
from np_drake.effects.weak_rotor import WeakRotor

_OURS: tuple[type[Effect], ...] = (
    *(MassError, InertiaError, CenterOfMassOffset, SuspendedPayload),
    *(ThrustScale, ThrustDrift, WeakRotor, MotorLag, CommandDelay),
    *(
        LinearDrag,
        QuadraticDrag,
        BladeFlapping,
        TranslationalLift,
        RotorInflow,
        ConstantWind,
        GustyWind,
        GroundEffect,
    ),
    *(RotorGyroscopic, AccelerometerBias, GyroBias, VelocityBias, AttitudeBias, ClockOffset),
)
LIBRARY: dict[str, type[Effect]] = {effect.identifier: effect for effect in _OURS}
# Besides the library, on logs whose input is measured rotor speed: the mixer of a command is known.
MEASURED_ROTORS: dict[str, type[Effect]] = {MixerGain.identifier: MixerGain}
# Besides the library, in scenarios alone: the diagnosis does not look for them.
SIMULATED: dict[str, type[Effect]] = {ThrustCeiling.identifier: ThrustCeiling}
# Errors of the vehicle file or the input that every model holds: never a cause.
NUISANCES: dict[str, type[Effect]] = {
    effect.identifier: effect for effect in (BatterySag, ThrottleCurve, ImuMounting, AttitudeLatency)
}


def in_scenarios() -> dict[str, type[Effect]]:
    """Return the effects that a scenario may name."""
    return LIBRARY | MEASURED_ROTORS | SIMULATED


def effects_for(log_input: str) -> dict[str, type[Effect]]:
    """Return the effects that are tried on logs with this input, `command` or `rotor_speed`."""
    return LIBRARY | MEASURED_ROTORS if log_input == "rotor_speed" else LIBRARY


def effect_of(identifier: str) -> type[Effect]:
    """Return the class of an effect; for what is none, as a structure `unknown:…`, the defaults of all effects."""
    for known in (LIBRARY, MEASURED_ROTORS, SIMULATED, NUISANCES):
        if identifier in known:
            return known[identifier]
    return Effect


# What a log must tell for some effects, and what is said of a log that does not.
REQUIREMENTS = {
    "commands": "the input is measured rotor speed, not a command",
    "thrust": "thrust over throttle is known up to a scale that falls with the battery",
    "torque": "the log has no torque",
    "accelerations": "the log has no accelerations",
}
_MISSING = {
    "command": (),
    "rotor_speed": ("commands",),
    "thrust_only": ("torque",),
    "normalised": ("thrust",),
}


def unobservable(log_input: str, *, accelerations: bool = True, torque: bool = True) -> dict[str, str]:
    """Return the effects that a kind of log cannot tell, with the reason.

    Args:
        log_input: as `FlightLog.input`.
        accelerations: whether the log has an accelerometer's reading.
        torque: whether a torque is known, also where the input is `normalised`.
    """
    absent = [
        *_MISSING[log_input],
        *([] if torque else ["torque"]),
        *([] if accelerations else ["accelerations"]),
    ]
    return {
        identifier: REQUIREMENTS[quantity]
        for quantity in absent
        for identifier, effect in effects_for(log_input).items()
        if quantity in _required(effect)
    }


def _required(effect: type[Effect]) -> tuple[str, ...]:
    """Return what a log must tell for an effect: what it states, and what follows from where it acts."""
    torque = issubclass(effect, WrenchEffect) and effect.turns and not effect.pushes
    accelerations = issubclass(effect, SensorEffect) and set(effect.corrupts) == {"ax", "ay", "az"}
    return (*effect.requires, *["torque"] * torque, *["accelerations"] * accelerations)


def register(effect: type[Effect]) -> type[Effect]:
    """Add a user's own effect to the library; a class decorator.

    Raises: ValueError: where the identifier is taken by another class, a parameter has no field, or the effect acts
        only through another one, as a wind through a drag; the search supports this for the library's winds alone.
    """
    known = LIBRARY.get(effect.identifier)
    if known is not None and known is not effect:
        raise ValueError(f"register: {effect.identifier!r} must be a new identifier; it is taken by {known}.")
    if known is None and _acts_through_others(effect):
        raise ValueError(
            f"register: {effect.__name__} must act by itself; what is felt through another effect, as a wind through "
            "a drag, is never tried. Leave `needs` empty and give it a `wrench`: all the force, by a drag of its own."
        )
    neutral = effect.neutral()
    for parameter in effect.parameters:
        if not hasattr(neutral, parameter.name):
            raise ValueError(f"register: {effect.__name__} must have a field {parameter.name!r}.")
    LIBRARY[effect.identifier] = effect
    return effect


def _acts_through_others(effect: type[Effect]) -> bool:
    """Return whether the effect acts only through others.

    It then names effects that it needs, or moves the air and adds no wrench by itself.
    """
    if effect.needs or not issubclass(effect, WrenchEffect):
        return bool(effect.needs)
    return effect.air_velocity is not WrenchEffect.air_velocity and effect.wrench is WrenchEffect.wrench
