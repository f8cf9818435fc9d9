"""Events of `simulate` that change the real plant in flight."""

import dataclasses as dc
from collections.abc import Callable, Sequence

from pydrake.systems.framework import Context, Diagram

from diagrams.loop.reality import RealityConfig
from np_drake.effects.base import MassProperties
from np_drake.effects.combine import mass_properties
from np_drake.effects.pendulum import Payload
from np_drake.vehicle import Vehicle
from systems.initial_state import apply_impulse, hang_payload, set_payload_mass, set_vehicle_mass
from systems.payload_config import PayloadConfig


@dc.dataclass(frozen=True)
class Event:
    """Instantaneous change of the real vehicle in flight: `apply(real_vehicle, root_context)`.

    becomes: what the payload is from then on, of what it was; for the oracle, which knows all.
    """

    time: float  # [s]
    apply: Callable[[Diagram, Context], None]
    becomes: Callable[[Payload], Payload | None] = lambda payload: payload


def push(time: float, impulse: list[float]) -> Event:
    """Return an impulse (3,) in W [N·s] on the payload at `time` [s], which gains impulse / mass [m/s] at once."""

    def apply(vehicle: Diagram, root: Context) -> None:
        plant = vehicle.GetSubsystemByName("plant")
        apply_impulse(plant, plant.GetMyMutableContextFromRoot(root), impulse)

    return Event(time, apply)


def attach(time: float, payload: PayloadConfig, mass: float) -> Event:
    """Return an attachment of `mass` [kg] to the payload at `time` [s], moving with the payload's own velocity."""

    def apply(vehicle: Diagram, root: Context) -> None:
        plant = vehicle.GetSubsystemByName("plant")
        set_payload_mass(plant, plant.GetMyMutableContextFromRoot(root), payload, payload.mass + mass)

    return Event(time, apply, lambda hung: dc.replace(hung, mass=payload.mass + mass))


def release(time: float) -> Event:
    """Return a cut of the cable at `time` [s], after which the payload falls."""

    def apply(vehicle: Diagram, root: Context) -> None:
        cable = vehicle.GetSubsystemByName("cable")
        cable.cut(cable.GetMyMutableContextFromRoot(root))

    return Event(time, apply, lambda hung: None)


def hang(time: float, payload: PayloadConfig) -> Event:
    """Return a payload that is hung under the vehicle at `time` [s]; it has fallen freely until then."""

    def apply(vehicle: Diagram, root: Context) -> None:
        plant, cable = vehicle.GetSubsystemByName("plant"), vehicle.GetSubsystemByName("cable")
        hang_payload(plant, plant.GetMyMutableContextFromRoot(root), payload)
        cable.tie(cable.GetMyMutableContextFromRoot(root))

    return Event(time, apply)


def weigh(time: float, properties: MassProperties) -> Event:
    """Return a change of the vehicle's mass properties at `time` [s]."""

    def apply(vehicle: Diagram, root: Context) -> None:
        plant = vehicle.GetSubsystemByName("plant")
        set_vehicle_mass(plant, plant.GetMyMutableContextFromRoot(root), properties)

    return Event(time, apply)


def payloads(first: Payload | None, events: Sequence[Event]) -> list[tuple[float, Payload | None]]:
    """Return (time [s], payload from then on) of every event; nothing where there is no payload at first."""
    changes, payload = [], first
    for event in sorted(events, key=lambda event: event.time):
        payload = None if payload is None else event.becomes(payload)
        changes.append((event.time, payload))
    return changes if first is not None else []


def beginnings(vehicle: Vehicle, reality: RealityConfig, end: float) -> dict[float, list[Event]]:
    """Return by time the changes of the plant that effects make which begin before `end` [s].

    At other onsets nothing is changed: wrench and actuator effects know the time. The integrator then has a step end
    there.
    """
    found: dict[float, list[Event]] = {t: [] for t in reality.onsets.values() if 0 < t < end}
    for t, events in found.items():
        if t == reality.hangs_at:
            events.append(hang(t, reality.hung))
        if t in {reality.onsets.get(effect) for effect in reality.mass_effects()}:
            events.append(weigh(t, mass_properties(vehicle, reality.mass_effects(t))))
    return found
