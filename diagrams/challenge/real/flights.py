"""Vehicles of the campaigns, and their flights as the import layer opens them."""

import dataclasses as dc
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from diagrams.batch.run import Run
from diagrams.challenge.real.cases import Case
from np_drake.flight_log import FlightLog
from np_drake.logs import opening
from np_drake.logs.errors import LogError
from np_drake.logs.formats import crazyflie
from np_drake.logs.formats.neurobem import published_vehicle
from np_drake.logs.importing.log_map import LogMap
from np_drake.vehicle import Vehicle

ARM = 0.0325  # of a Crazyflie 2.1 brushless along x and y [m]
MASS = {"bare": 0.037, "payload": 0.0397}  # as weighed; battery and markers differ [kg]
THRUST_COEFFICIENT = 3.704e-8  # of bare flights, which carry their weight [N s²]
TORQUE_OVER_THRUST = 0.006  # [m]
FAN_ARRAY_MASS = 2.53  # of the Neural-Fly vehicle [kg]


def vehicle_of(group: str) -> Vehicle:
    """Return the nominal vehicle of a group of cases."""
    if group == "neurobem":
        return published_vehicle()
    if group in ("wind", "still", "new-wind"):
        return dc.replace(
            Vehicle(), name="neural_fly", mass=FAN_ARRAY_MASS, max_rotor_thrust=15.0, input="normalised"
        ).check()
    return Vehicle(
        name="crazyflie_brushless",
        mass=MASS[group.split("-")[0]],
        inertia=np.diag([1.9e-5, 1.9e-5, 3.2e-5]).tolist(),
        rotor_positions=[[ARM, -ARM, 0], [-ARM, -ARM, 0], [-ARM, ARM, 0], [ARM, ARM, 0]],
        rotor_directions=[-1.0, 1.0, -1.0, 1.0],
        thrust_coefficient=THRUST_COEFFICIENT,
        torque_coefficient=TORQUE_OVER_THRUST * THRUST_COEFFICIENT,
        rotor_radius=0.025,
        max_rotor_thrust=0.25,
        input="command" if group == "payload-command" else "rotor_speed",
    ).check()


def open_case(case: Case) -> tuple[Vehicle, list[FlightLog], list[FlightLog]]:
    """Return the vehicle, the flights that are fitted and those that judge.

    Raises: LogError: one line with file and reason, if a log cannot be used; OSError: if it cannot be opened.
    """
    vehicle = vehicle_of(case.group)
    train = [log for path in case.train for log in open_flights(path, vehicle)]
    return vehicle, train, open_flights(case.held_out, vehicle)


def open_flights(path: Path, vehicle: Vehicle) -> list[FlightLog]:
    """Return the flights of a log, a Crazyflie's by its commands where the vehicle asks for them.

    Args:
        path: the log.
        vehicle: nominal vehicle.
    Raises: LogError: one line with file and reason; OSError: if it cannot be opened.
    """
    log_map = _commanded(path) if vehicle.input == "command" else None
    return opening.open_flights(path, vehicle, log_map)[0]


@lru_cache(maxsize=64)
def _commanded(path: Path) -> LogMap:
    """Return the map of a Crazyflie log that takes the commanded thrust and torque, not the rotor speed.

    Raises: LogError: if the log has no such command.
    """
    contents = {
        event: tuple(name for name in names if not name.startswith("rpm."))
        for event, names in crazyflie.contents(path).items()
    }
    found = crazyflie.default_map(contents)
    if found is None or not found.thrust or not found.torque:
        raise LogError(f"{path}: must hold the commanded thrust and torque (ctrlLee); it does not.")
    return found


def require_logs(run: Run, cases: Sequence[Case]) -> None:
    """Open every log once before the long work.

    Args:
        run: shows progress.
        cases: cases whose logs are opened.
    Raises: LogError: one line with file and reason, at the first that is not usable; OSError: if it cannot be opened.
    """
    wanted = {
        (path, vehicle_of(case.group).input): case
        for case in cases
        for path in (*case.train, case.held_out, *case.still)
    }
    with run.progress("opening the logs", len(wanted)) as advance:
        for number, ((path, _), case) in enumerate(wanted.items(), start=1):
            open_flights(path, vehicle_of(case.group))
            advance(number, path.name)
