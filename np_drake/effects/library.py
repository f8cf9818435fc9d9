"""All effects by identifier, as the diagnosis searches them.

A new effect is one file, and one registration: `@register` on its class, or its name in
`effects/__init__.py`.
"""

from collections.abc import Collection

from np_drake import effects
from np_drake.checks import require
from np_drake.effects.base import Effect, SensorEffect, WrenchEffect


def _with_role(role: str) -> dict[str, type[Effect]]:
    """Return the effects of this package that state a role, by identifier."""
    kinds = (getattr(effects, name) for name in effects.__all__ if name != "LIBRARY")
    return {kind.identifier: kind for kind in kinds if getattr(kind, "role", "") == role}


LIBRARY = _with_role("cause")
MEASURED_ROTORS = _with_role("mixer")
BESIDE_NEIGHBOURS = _with_role("neighbour")
CHANGES = _with_role("change")
SIMULATED = _with_role("simulated")
NUISANCES = _with_role("nuisance")


def in_scenarios() -> dict[str, type[Effect]]:
    """Return the effects that a scenario may name."""
    return causes() | SIMULATED


def causes() -> dict[str, type[Effect]]:
    """Return the effects that a diagnosis may name, of any logs."""
    return LIBRARY | MEASURED_ROTORS | BESIDE_NEIGHBOURS | CHANGES


def effects_for(
    log_input: str, *, neighbours: bool = False, before: bool = False
) -> dict[str, type[Effect]]:
    """Return the effects that are tried on logs.

    Args:
        log_input: as `FlightLog.input`.
        neighbours: whether a log of a vehicle nearby is given.
        before: whether flights of the vehicle from before a change are given.
    """
    tried = LIBRARY | MEASURED_ROTORS if log_input == "rotor_speed" else LIBRARY
    tried = tried | BESIDE_NEIGHBOURS if neighbours else tried
    return tried | CHANGES if before else tried


def effect_of(identifier: str) -> type[Effect]:
    """Return the class of an effect; for what is none, as a structure `unknown:…`, the defaults of
    all effects.
    """
    return (NUISANCES | in_scenarios()).get(identifier, Effect)


# What a log must tell for some effects, and what is said of a log that does not.
REQUIREMENTS = {
    "commands": "the input is measured rotor speed, not a command",
    "thrust": "thrust over throttle is known up to a scale that falls with the battery",
    "torque": "the log has no torque",
    "accelerations": "the log has no accelerations",
    "height": "the log has no position",
    "velocity": "the log has no velocity",
    "attitude": "the log has no attitude",
}
_MISSING = {
    "command": (),
    "rotor_speed": ("commands",),
    "thrust_only": ("torque",),
    "normalised": ("thrust",),
}


def unobservable(
    log_input: str, *, accelerations: bool = True, torque: bool = True, lacks: Collection[str] = ()
) -> dict[str, str]:
    """Return the effects that a kind of log cannot tell, with the key of what it lacks in
    `REQUIREMENTS`.

    Args:
        log_input: as `FlightLog.input`.
        torque: whether a torque is known, also where the input is `normalised`.
        lacks: as `FlightLog.lacks`.
    """
    absent = [
        *_MISSING[log_input],
        *(["torque"] if not torque else []),
        *(["accelerations"] if not accelerations else []),
        *lacks,
    ]
    return {
        identifier: quantity
        for quantity in absent
        for identifier, effect in effects_for(log_input).items()
        if quantity in _required(effect)
    }


def _required(effect: type[Effect]) -> tuple[str, ...]:
    """Return what a log must tell for an effect: what it states, and what follows from where it
    acts.
    """
    torque = issubclass(effect, WrenchEffect) and effect.turns and not effect.pushes
    accelerations = issubclass(effect, SensorEffect) and set(effect.corrupts) == {"ax", "ay", "az"}
    pose = issubclass(effect, SensorEffect) and "qw" in effect.corrupts
    return (
        *effect.requires,
        *(["torque"] if torque else []),
        *(["accelerations"] if accelerations else []),
        *(["attitude"] if pose else []),
    )


def register(effect: type[Effect]) -> type[Effect]:
    """Add a user's own effect to the library; a class decorator.

    Raises: ValueError: where it is no frozen dataclass with `parameters`, the identifier is taken
        by another class, a parameter has no field, or the effect acts only through another one, as
        a wind through a drag; the search supports this for the library's winds alone.
    """
    shape = getattr(effect, "__dataclass_params__", None)
    require(
        shape is not None and shape.frozen,
        f"register: {effect.__name__} must be a frozen dataclass; write "
        "@dataclasses.dataclass(frozen=True) below @register.",
    )
    require(
        hasattr(effect, "parameters"),
        f"register: {effect.__name__} must have the attribute parameters.",
    )
    known = LIBRARY.get(effect.identifier)
    require(
        known is None or known is effect,
        f"register: {effect.identifier!r} must be a new identifier; it is taken by {known}.",
    )
    require(
        known is not None or not _acts_through_others(effect),
        f"register: {effect.__name__} must act by itself; what is felt through another "
        f"effect, as a wind through "
        "a drag, is never tried. Leave `needs` empty and give it a `wrench`: all the "
        "force, by a drag of its own.",
    )
    for parameter in effect.parameters:
        require(
            parameter.name in getattr(effect, "__dataclass_fields__", ()),
            f"register: {effect.__name__} must have a field {parameter.name!r}.",
        )
    LIBRARY[effect.identifier] = effect
    return effect


def _acts_through_others(effect: type[Effect]) -> bool:
    """Return whether the effect acts only through others.

    It then names effects that it needs, or moves the air and adds no wrench by itself.
    """
    if effect.needs or not issubclass(effect, WrenchEffect):
        return bool(effect.needs)
    return effect.air_velocity is not WrenchEffect.air_velocity and not (
        effect.pushes or effect.turns
    )
