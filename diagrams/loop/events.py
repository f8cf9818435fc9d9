"""Events of `simulate` that change the payload of the real plant in flight."""

from pydrake.systems.framework import Context, Diagram

from diagrams.loop.flight import Event
from systems.initial_state import apply_impulse, set_payload_mass
from systems.payload_config import PayloadConfig


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

    return Event(time, apply)


def release(time: float) -> Event:
    """Return a cut of the cable at `time` [s], after which the payload falls."""

    def apply(vehicle: Diagram, root: Context) -> None:
        cable = vehicle.GetSubsystemByName("cable")
        cable.cut(cable.GetMyMutableContextFromRoot(root))

    return Event(time, apply)
