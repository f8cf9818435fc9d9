"""Several effects at once: sorted by where they act, and summed."""

import dataclasses as dc
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from np_drake.effects.base import (
    ActuatorEffect,
    Effect,
    MassEffect,
    MassProperties,
    MeasurementEffect,
    Motion,
    WrenchEffect,
    chi_from_body,
)
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle

# when an effect begins [s]; one that is not named acts from the start
Onsets = Mapping[Effect, float]
NO_ONSETS: Onsets = {}
Acting = TypeVar("Acting", bound=Effect)


def acting(effects: Sequence[Acting], onsets: Onsets, t: float) -> Sequence[Acting]:
    """Return the effects that have begun.

    Args:
        onsets: when they begin [s].
        t: time [s].
    """
    return [e for e in effects if onsets.get(e, -np.inf) <= t] if onsets else effects


@dc.dataclass
class EffectsByPlace:
    """Effects by where they act, each list in the given order.

    The payload has a field of its own, because it is a body.
    """

    # act as force and torque on the body
    wrench: list[WrenchEffect] = dc.field(default_factory=list)
    # act between command and thrust
    actuator: list[ActuatorEffect] = dc.field(default_factory=list)
    mass: list[MassEffect] = dc.field(default_factory=list)  # change the mass properties
    measurement: list[MeasurementEffect] = dc.field(default_factory=list)  # change the reading
    payload: SuspendedPayload | None = None


def split_effects(effects: Iterable[Any]) -> EffectsByPlace:
    """Sort effects by where they act.

    Raises: ValueError: if two payloads are given, or an object of no class of `effects.base`.
    """
    out = EffectsByPlace()
    for effect in effects:
        if isinstance(effect, SuspendedPayload):
            if out.payload is not None:
                raise ValueError(
                    "split_effects: there must be one suspended_payload at most; got two."
                )
            out.payload = effect
        elif isinstance(effect, WrenchEffect | ActuatorEffect | MassEffect):
            getattr(out, effect.place).append(effect)
        elif hasattr(effect, "measure"):
            out.measurement.append(effect)
        else:
            raise ValueError(
                f"split_effects: an effect must be of a class of effects.base; got {effect!r}."
            )
    return out


def require_complete(effects: Iterable[Effect]) -> None:
    """Check that effects have what they act by in a simulation.

    Raises: ValueError: at the first that lacks it.
    """
    for effect in effects:
        if lacking := effect.lacking():
            raise ValueError(
                f"effects: {effect.identifier} must have {lacking}. Or leave the effect out."
            )


def total_wrench(vehicle: Vehicle, effects: Sequence[WrenchEffect], motion: Motion) -> np.ndarray:
    """Return chi of all effects, (..., 6) [N, N·m], each in the air moved by all.

    Args:
        motion: over any leading axes.
    """
    for effect in effects:
        if type(effect).air_velocity is not WrenchEffect.air_velocity:
            motion = dc.replace(motion, wind=motion.wind + effect.air_velocity(motion.t))
    in_body = np.zeros((*motion.x.shape[:-1], 6))
    in_world = np.zeros_like(in_body)
    for effect in effects:  # those in body axes are turned together
        if type(effect).wrench is WrenchEffect.wrench:
            in_body += effect.body_wrench(vehicle, motion)
        else:
            in_world += effect.wrench(vehicle, motion)
    return in_world + chi_from_body(motion, in_body[..., :3], in_body[..., 3:])


def mass_properties(vehicle: Vehicle, effects: Iterable[MassEffect]) -> MassProperties:
    """Return the vehicle's mass properties with all effects applied, first to last."""
    properties = MassProperties.of(vehicle)
    for effect in effects:
        properties = effect.properties(properties)
    return properties
