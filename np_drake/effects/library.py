"""All effects by identifier, as the diagnosis searches them.

A new effect is one file and one line here.
"""

from np_drake.effects.accelerometer_bias import AccelerometerBias
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.base import Effect, SensorEffect, WrenchEffect
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.ground_effect import GroundEffect
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.rotor_inflow import RotorInflow
from np_drake.effects.suspended_payload import SuspendedPayload
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


def in_scenarios() -> dict[str, type[Effect]]:
    """Return the effects that a scenario may name."""
    return LIBRARY | MEASURED_ROTORS | SIMULATED


def effects_for(log_input: str) -> dict[str, type[Effect]]:
    """Return the effects that are tried on logs with this input, `command` or `rotor_speed`."""
    return LIBRARY | MEASURED_ROTORS if log_input == "rotor_speed" else LIBRARY


# Effects that logs of an input cannot tell.
TIMING = ("motor_lag", "command_delay", "clock_offset")
TORQUE = ("inertia_error", "center_of_mass_offset", "weak_rotor")  # besides effects without a force
SCALE = ("mass_error", "thrust_scale", "thrust_drift")
_UNOBSERVABLE: dict[str, tuple[tuple[tuple[str, ...], str], ...]] = {
    "command": (),
    "rotor_speed": ((TIMING, "the input is measured rotor speed, not a command"),),
    "thrust_only": (),
    "normalised": ((SCALE, "thrust over throttle is known up to a scale that falls with the battery"),),
}


def unobservable(log_input: str, *, accelerations: bool = True, torque: bool = True) -> dict[str, str]:
    """Return the effects that a kind of log cannot tell, with the reason.

    Args:
        log_input: as `FlightLog.input`.
        accelerations: whether the log has an accelerometer's reading.
        torque: whether a torque is known, also where the input is `normalised`.
    """
    rules = list(_UNOBSERVABLE[log_input])
    if not torque or log_input == "thrust_only":
        turning = tuple(i for i, effect in effects_for(log_input).items() if _only_turns(effect))
        rules.append(((*TORQUE, *turning), "the log has no torque"))
    if not accelerations:
        reading = tuple(i for i, effect in LIBRARY.items() if _only_in_accelerations(effect))
        rules.append((reading, "the log has no accelerations"))
    return {identifier: reason for identifiers, reason in rules for identifier in identifiers}


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


def _only_turns(effect: type[Effect]) -> bool:
    return issubclass(effect, WrenchEffect) and effect.turns and not effect.pushes


def _only_in_accelerations(effect: type[Effect]) -> bool:
    return issubclass(effect, SensorEffect) and set(effect.corrupts) == {"ax", "ay", "az"}
