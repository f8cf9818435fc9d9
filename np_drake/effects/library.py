"""Every effect by its identifier: the list that a diagnosis goes through. A new effect is one file and one line here."""

from np_drake.effects.accelerometer_bias import AccelerometerBias
from np_drake.effects.base import Effect
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_scale import ThrustScale

LIBRARY: dict[str, type[Effect]] = {
    effect.identifier: effect
    for effect in (MassError, ThrustScale, MotorLag, LinearDrag, ConstantWind, AccelerometerBias)
}


def register(effect: type[Effect]) -> type[Effect]:
    """Adds a user's own effect to the library; a class decorator.

    Raises: ValueError: where the identifier is taken by another class, or a parameter has no field.
    """
    known = LIBRARY.get(effect.identifier)
    if known is not None and known is not effect:
        raise ValueError(f"register: {effect.identifier!r} must be a new identifier; it is taken by {known}.")
    neutral = effect.neutral()
    for parameter in effect.parameters:
        if not hasattr(neutral, parameter.name):
            raise ValueError(f"register: {effect.__name__} must have a field {parameter.name!r}.")
    LIBRARY[effect.identifier] = effect
    return effect
