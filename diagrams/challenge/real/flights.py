"""Flights of the campaigns as the import layer opens them."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from diagrams.batch.run import Run
from diagrams.challenge.real.campaigns import Campaign, campaign_of
from diagrams.challenge.real.rules import Case
from np_drake.flight_log import FlightLog
from np_drake.logs import opening
from np_drake.logs.case_folder import with_neighbours
from np_drake.logs.errors import LogError
from np_drake.logs.formats import crazyflie
from np_drake.logs.importing.log_map import LogMap, MapFile, load_map_file
from np_drake.vehicle import Vehicle


def open_case(case: Case) -> tuple[Vehicle, list[FlightLog], list[FlightLog]]:
    """Return the vehicle, the flights that are fitted and those that judge, beside their
    neighbours.

    Raises: LogError: one line with file and reason, if a log cannot be used; OSError: if it cannot
    be opened.
    """
    campaign = campaign_of(case.group)
    train = [log for path in case.train for log in _beside(path, campaign)]
    return campaign.nominal, train, _beside(case.held_out, campaign)


def _beside(path: Path, campaign: Campaign) -> list[FlightLog]:
    """Return the flights of a log with the path of their neighbour, where the campaign gives its
    log.
    """
    flights, other = open_flights(path, campaign), campaign.neighbour(path)
    if other is None:
        return flights
    found = open_flights(other, campaign)
    return with_neighbours(
        flights, {log.name: found for log in flights}, campaign.nominal.rotor_radius
    )


def open_flights(path: Path, campaign: Campaign) -> list[FlightLog]:
    """Return the flights of a log, a Crazyflie's by its commands where the vehicle asks for them.
    Raises: LogError: one line with file and reason; OSError: if it cannot be opened.
    """
    return opening.open_flights(path, campaign.nominal, _map_of(path, campaign))[0]


def _map_of(path: Path, campaign: Campaign) -> LogMap | MapFile | None:
    if campaign.map:
        return load_map_file(campaign.map)
    return _commanded(path) if campaign.nominal.input == "command" else None


@lru_cache(maxsize=64)
def _commanded(path: Path) -> LogMap:
    """Return the map of a Crazyflie log that takes the commanded thrust and torque, not the rotor
    speed.

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
    Raises: LogError: one line with file and reason, at the first that is not usable; OSError: if it
        cannot be opened.
    """
    campaigns = {case: campaign_of(case.group) for case in cases}
    wanted = {
        (path, campaign.nominal.input): campaign
        for case, campaign in campaigns.items()
        for path in (*case.train, case.held_out, *case.still)
    }
    with run.progress("opening the logs", len(wanted)) as advance:
        for number, ((path, _), campaign) in enumerate(wanted.items(), start=1):
            open_flights(path, campaign)
            advance(number, path.name)
