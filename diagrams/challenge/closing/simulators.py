"""Simulators in which the real vehicle flies."""

from importlib.metadata import version
from typing import Any

from diagrams.challenge.simulators.rotorpy import optional_import
from diagrams.loop.real_vehicle import DRAKE, RealVehicle

SIMULATORS = ("drake", "rotorpy")


def require_simulator(name: str) -> None:
    """Check the name of a simulator.

    Raises: ValueError: where it is unknown, or its package is not installed.
    """
    if name not in SIMULATORS:
        raise ValueError(f"closing: simulator must be one of {', '.join(SIMULATORS)}; got {name!r}.")
    if name == "rotorpy":
        optional_import.require_rotorpy()


def real_vehicle(name: str) -> RealVehicle:
    """Return the maker of the real vehicle, in rotorpy with that simulator's own physics.

    Raises: ValueError: as `require_simulator`.
    """
    require_simulator(name)
    return optional_import.foreign_vehicle(own=True) if name == "rotorpy" else DRAKE


def simulator_settings(name: str) -> dict[str, Any]:
    """Return all of the simulator that results depend on.

    Raises: ValueError: as `require_simulator`.
    """
    require_simulator(name)
    if name == "drake":
        return {"name": name}
    return {"name": name, "version": version("rotorpy"), "own_physics": optional_import.own_physics()}
