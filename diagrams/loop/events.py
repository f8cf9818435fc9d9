"""What happens to the payload in flight, as events of `simulate`; each changes the real plant."""

from pydrake.systems.framework import Context, Diagram

from diagrams.loop.flight import Event
from systems.initial_state import apply_impulse, set_payload_mass
from systems.payload_config import PayloadConfig


def push(time: float, impulse: list[float]) -> Event:
    """An impulse (3,) in W [N·s] on the payload, which gains impulse / mass [m/s] at once."""

    def apply(vehicle: Diagram, root: Context) -> None:
        plant = vehicle.GetSubsystemByName("plant")
        apply_impulse(plant, plant.GetMyMutableContextFromRoot(root), impulse)

    return Event(time, apply)


def attach(time: float, payload: PayloadConfig, mass: float) -> Event:
    """`mass` [kg] more is hung on the payload, with the payload's own velocity: it brings no momentum of its own."""

    def apply(vehicle: Diagram, root: Context) -> None:
        plant = vehicle.GetSubsystemByName("plant")
        set_payload_mass(plant, plant.GetMyMutableContextFromRoot(root), payload, payload.mass + mass)

    return Event(time, apply)


def release(time: float) -> Event:
    """The cable is cut; the payload falls."""

    def apply(vehicle: Diagram, root: Context) -> None:
        cable = vehicle.GetSubsystemByName("cable")
        cable.cut(cable.GetMyMutableContextFromRoot(root))

    return Event(time, apply)
