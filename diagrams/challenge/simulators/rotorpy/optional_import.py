"""The optional extra `challenge`: the simulator `rotorpy`, imported when it is asked for."""

from importlib.util import find_spec

from diagrams.loop.reality import RealVehicle
from np_drake.flight_log import FlightLog


def require_rotorpy() -> None:
    """Raises ValueError: where rotorpy is not installed."""
    if find_spec("rotorpy") is None:
        raise ValueError(
            "simulator: for rotorpy its package must be installed; pip install "
            "'np_drake[challenge]'."
        )


def fly(*arguments, **options) -> FlightLog:
    """Fly in rotorpy.

    Args:
        *arguments: of `diagrams.challenge.simulators.rotorpy.simulator.fly`.
    Raises: ValueError: where rotorpy is not installed.
    """
    require_rotorpy()
    from diagrams.challenge.simulators.rotorpy.simulator import fly as fly_in_rotorpy

    return fly_in_rotorpy(*arguments, **options)


def foreign_vehicle(*, own: bool) -> RealVehicle:
    """Return the `ForeignVehicle`. Raises ValueError: where rotorpy is not installed."""
    require_rotorpy()
    from diagrams.challenge.simulators.rotorpy.rotorpy_vehicle import ForeignVehicle

    return ForeignVehicle(own)


def own_physics() -> dict[str, float]:
    """Return rotorpy's own parameters (`own_physics`). Raises ValueError: where rotorpy is not
    installed.
    """
    require_rotorpy()
    from diagrams.challenge.simulators.rotorpy.vehicle import own_physics as own_physics_of_rotorpy

    return own_physics_of_rotorpy()
