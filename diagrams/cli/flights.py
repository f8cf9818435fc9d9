"""Opens the flights that a verb was given, and prepares them for a predictor."""

from pathlib import Path
from typing import TYPE_CHECKING

from diagrams.cli.flying import fly_all
from diagrams.cli.output import say, tell
from np_drake.logs import opening
from np_drake.logs.formats.neurobem import is_array, published_vehicle
from np_drake.logs.formats.neurobem_wrenches import read_wrenches
from np_drake.training_data.accelerations import with_accelerations
from np_drake.training_data.segments import WrenchSequence
from np_drake.training_data.training_segments import Flight, require_torque
from np_drake.vehicle import Vehicle, load_vehicle

if TYPE_CHECKING:
    from diagrams.loop.flight import FlightConfig

SCENARIOS = (".yaml", ".yml")  # files that are flown


def open_flights(
    paths: list[Path], vehicle_file: Path | None, *, repair: bool = False
) -> list[Flight]:
    """Open and check every file, and print what a reader derived or repaired.

    A scenario file is flown, once every other file is open.

    Args:
        vehicle_file: of all flights; None: the published one for NeuroBEM files, the paper's for
            flight logs.
        repair: whether a few bad rows of a log are mended.
    Raises: LogError, OSError: one line, at the first file that is not usable; ValueError: on a bad
        vehicle
    file, or if NeuroBEM arrays are mixed with logs.
    """
    vehicle = None if vehicle_file is None else load_vehicle(vehicle_file)
    inputs = [
        _scenario(path) if path.suffix in SCENARIOS else _read(path, repair=repair)
        for path in paths
    ]
    logs = iter(
        opening.with_vehicle(
            [found for found in inputs if isinstance(found, opening.Opened)], vehicle
        )
    )
    flights = []
    for path, found in zip(paths, inputs, strict=True):
        if isinstance(found, opening.Opened):
            flights += _of_log(next(logs), vehicle)
        elif isinstance(found, WrenchSequence):
            flights.append(Flight(found, vehicle or published_vehicle()))
        else:
            flights.append(simulated(path, found))
    if vehicle is None and flights:
        used = sorted({f"{flight.vehicle.name}, {flight.vehicle.mass:g} kg" for flight in flights})
        say(f"vehicle: {'; '.join(used)}, as no --vehicle was given.")
    require_one_frame(flights)
    return flights


def _scenario(path: Path) -> "FlightConfig":
    """Return a scenario, on the training circle unless it names a reference.

    Raises: ValueError: on a bad scenario.
    """
    from diagrams.loop.experiments import training_flight

    return training_flight(path)


def _read(path: Path, *, repair: bool) -> opening.Opened | WrenchSequence:
    """Return a log as it is logged, or the wrenches of an array."""
    return read_wrenches(path) if is_array(path) else opening.read_as_logged(path, repair=repair)


def _of_log(found: opening.Opened, vehicle: Vehicle | None) -> list[Flight]:
    """Return the flights of a log with accelerations, and print what a reader derived or
    repaired.
    """
    own = vehicle or found.vehicle or Vehicle()
    flights = [Flight(with_accelerations(require_torque(log)), own) for log in found.flights]
    tell(
        *(f"{flight.data.name}: {note}" for flight in flights for note in flight.data.notes),
        indent="  ",
    )
    return flights


def simulated(scenario: Path, config: "FlightConfig") -> Flight:
    """Fly a scenario with its own controller, and return its log.
    Raises: LostVehicle: if the flight fails.
    """
    (flight,) = fly_all([config], 0, None)
    say(f"{scenario}: flown for {config.end:g} s with {config.controller.name}, seed 0.")
    return Flight(flight.log(), config.vehicle)


def require_one_frame(flights: list[Flight]) -> None:
    """Check that total wrenches in body axes are not mixed with residual ones in W.

    Raises: ValueError: if they are.
    """
    if len({flight.frame for flight in flights}) > 1:
        raise ValueError(
            "flights: arrays (.npy) hold the total wrench in body axes, logs the residual "
            "one; give one kind."
        )
