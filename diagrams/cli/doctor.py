"""`np-drake doctor`: is a flight log usable, and which effects can it tell, to what size."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.output import progress, tell
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from np_drake.flight_log import FlightLog
    from np_drake.logs.importing.log_map import MapFile
    from np_drake.vehicle import Vehicle


@reports("doctor", seed=None, markdown=False)
def doctor(
    run: Run,
    logs: Annotated[
        list[Path],
        Argument(
            metavar="LOG...",
            help="Flight logs of our format, or of any that `import` reads; of one vehicle.",
        ),
    ],
    vehicle: Annotated[
        Path | None,
        Option(
            "--vehicle",
            metavar="VEHICLE",
            help=(
                "Vehicle file (YAML) or a name of `np-drake vehicle list`; without it effects "
                "are not judged."
            ),
        ),
    ] = None,
    log_map: Annotated[
        Path | None,
        Option(
            "--map", metavar="FILE", help="Map of columns and conventions (YAML), as for `import`."
        ),
    ] = None,
    repair: options.Repair = False,
) -> Report:
    """Examine flight logs: rates, gaps, noise, clocks, motion, and which effects they can tell, to
    what size.
    """
    from diagrams.cli.diagnose import vehicle_of
    from np_drake.diagnosis.doctor.examine import examine
    from np_drake.logs.importing.log_map import load_map_file

    nominal = None if vehicle is None else vehicle_of(vehicle)
    declared = None if log_map is None else load_map_file(log_map)
    with progress("examining", 1.0) as advance:
        flights, sheets, failures = _opened(
            logs, nominal, declared, repair, lambda share: advance(0.3 * share)
        )
        if not flights:
            raise failures[0]
        report = examine(
            flights,
            nominal,
            sheets=sheets,
            on_progress=lambda share, text: advance(0.3 + 0.7 * share, text),
        )
        advance(1.0)
    from diagrams.cli.doctor_screen import screen

    config = {
        "logs": logs,
        "vehicle": None if nominal is None else nominal.name,
        "map": log_map,
        "repair": repair,
    }
    tell(*(f"not usable: {failure}" for failure in failures[1:]), indent="  ")
    return Report(
        [],
        config=config,
        metrics={**report.as_json(), "failures": [str(f) for f in failures]},
        lines=screen(report),
        failure=failures[0] if failures else None,
    )


def _opened(
    paths: list[Path],
    vehicle: "Vehicle | None",
    declared: "MapFile | None",
    repair: bool,
    tell: Callable[[float], None],
) -> "tuple[list[FlightLog], dict[str, Any], list[Exception]]":
    """Return flights, by name the content of the sheets of those that were imported, and what could
    not be opened.
    """
    from np_drake.logs.errors import LogError
    from np_drake.logs.opening import Opened, read_as_logged, with_vehicle

    opened: list[Opened] = []
    failures: list[Exception] = []
    refused: list[LogError] = []
    for number, path in enumerate(paths):
        try:
            opened.append(
                read_as_logged(
                    path, declared, repair=repair, on_progress=_part(tell, number, len(paths))
                )
            )
        except (LogError, OSError) as error:
            failures.append(error)
    opened = with_vehicle(opened, vehicle, refused)
    flights = [log for found in opened for log in found.flights]
    sheets = {
        log.name: found.sheet.content
        for found in opened
        if found.sheet is not None
        for log in found.flights
    }
    return flights, sheets, [*failures, *refused]


def _part(tell: Callable[[float], None], number: int, count: int) -> Callable[[float], None]:
    """Return the progress of one of several files."""
    return lambda share: tell((number + share) / count)
