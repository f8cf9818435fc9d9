"""Opens the flights that a verb was given, and prepares them for a predictor."""

from pathlib import Path

from diagrams.cli.output import progress, say
from np_drake.logs.accelerations import with_accelerations
from np_drake.logs.flight_log import FlightLog
from np_drake.logs.neurobem import published_vehicle
from np_drake.logs.open_log import is_neurobem, open_segments
from np_drake.logs.training_segments import Flight, require_torque
from np_drake.vehicle import Vehicle, load_vehicle

SCENARIOS = (".yaml", ".yml")  # files that are flown


def open_flights(paths: list[Path], vehicle_file: Path | None, *, repair: bool = False) -> list[Flight]:
    """Open and check every file, and print what a reader derived or repaired.

    Without a vehicle file: the published one for NeuroBEM files, the paper's for flight logs. A scenario file is flown.
    Raises: LogError, OSError: one line, at the first file that is not usable; ValueError: on a bad vehicle
    file, or if NeuroBEM arrays are mixed with logs.
    """
    vehicle = None if vehicle_file is None else load_vehicle(vehicle_file)
    flights = []
    for path in paths:
        if path.suffix in SCENARIOS:
            flights.append(simulated(path))
            continue
        own = vehicle or (published_vehicle() if is_neurobem(path) else Vehicle())
        for data in open_segments(path, vehicle=vehicle, repair=repair):
            if isinstance(data, FlightLog):
                data = with_accelerations(require_torque(data))
            say(*(f"{data.name}: {note}" for note in data.notes))
            flights.append(Flight(data, own))
    if vehicle is None and flights:
        used = sorted({f"{flight.vehicle.name}, {flight.vehicle.mass:g} kg" for flight in flights})
        say(f"vehicle: {'; '.join(used)}, as no --vehicle was given.")
    require_one_frame(flights)
    return flights


def simulated(scenario: Path) -> Flight:
    """Fly a scenario with its own controller, on the training circle unless it names a reference, and return its log.

    Raises: ValueError: on a bad scenario; LostVehicle: if the flight fails.
    """
    from diagrams.loop.flight_result import fly
    from diagrams.loop.training_flight import training_flight

    config = training_flight(scenario)
    with progress(f"flying {config.name}", config.end) as advance:
        flight = fly(config, seed=0, monitor=advance)
    say(f"{scenario}: flown for {config.end:g} s with {config.controller.kind}, seed 0.")
    return Flight(flight.log(), config.vehicle)


def require_one_frame(flights: list[Flight]) -> None:
    """Check that total wrenches in body axes are not mixed with residual ones in W.

    Raises: ValueError: if they are.
    """
    if len({flight.frame for flight in flights}) > 1:
        raise ValueError(
            "flights: arrays (.npy) hold the total wrench in body axes, logs the residual one; give one kind."
        )
