"""`np-drake identify`: what flight logs tell of a vehicle, as a vehicle file."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.batch.failed_run import FailedRun
from diagrams.cli import output
from diagrams.cli.identify_inputs import (
    READ,
    fit_to_judge,
    open_logs,
    prior_of,
    require_different,
    split,
)
from diagrams.cli.identify_tables import as_json, judged, rate_loop, table
from diagrams.cli.output import progress, say, tell
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from np_drake.identification.identify import Identification
    from np_drake.vehicle import Vehicle

Out = Annotated[
    Path | None,
    Option("--out", metavar="DIR", help="Folder for vehicle.yaml, page, figures and JSON."),
]
FILE, JSON, SCHEMA = "vehicle.yaml", "identification.json", "identification"
FITTED = 0.8  # share of the bar


@reports(SCHEMA, seed=None, out=Out)
def identify(
    run: Run,
    logs: Annotated[
        list[Path],
        Argument(metavar="LOG...", help="Flights of one vehicle, of any format of `import`."),
    ],
    vehicle: Annotated[
        Path | None,
        Option(
            "--vehicle",
            metavar="VEHICLE",
            help="File or preset with rotors' places, directions, radius and mass.",
        ),
    ] = None,
    mass: Annotated[
        float | None, Option(help="Mass with battery [kg]; default: the vehicle file's.")
    ] = None,
    trust: Annotated[
        str,
        Option(
            metavar="WHICH",
            help="mass | thrust (logged newtons, or the file's coefficient, tell the mass).",
        ),
    ] = "mass",
    wheelbase: Annotated[
        float | None, Option(help="Without a file: from motor to motor, across [m].")
    ] = None,
    propeller: Annotated[
        float | None, Option(help="Without a file: propeller diameter [m].")
    ] = None,
    order: Annotated[
        str | None,
        Option(
            metavar="AUTOPILOT",
            help="Without a file: order of the rotors: px4 | ardupilot | betaflight | crazyflie.",
        ),
    ] = None,
    held_out: Annotated[
        list[Path] | None,
        Option(
            metavar="LOG",
            help="To judge by; default: the last, or the last third of a single one. Repeatable.",
        ),
    ] = None,
    input: Annotated[
        str,
        Option(
            metavar="KIND",
            help="rotor_speed | throttle | command; default: the first that all logs hold.",
        ),
    ] = "",
    log_map: Annotated[
        Path | None,
        Option("--map", metavar="FILE", help="Map of columns and conventions, as for `import`."),
    ] = None,
    name: Annotated[str, Option(help="Name of the vehicle.")] = "identified",
) -> Report:
    """Identify mass or thrust, inertia, motors, delays and sensors of a vehicle from its
    flights.
    """
    with _earlier_named(run.out), progress("identifying", 1.0) as advance:
        from np_drake.identification.identify import identify as identified
        from np_drake.identification.signals import common_drive
        from np_drake.identification.validation import held_out as errors_on

        require_different(logs, held_out or [])
        common_drive([], input)  # refuses what is no input before logs are read
        prior, mass = prior_of(vehicle, mass, wheelbase, propeller, order, trust)
        opened, notes = open_logs([*logs, *(held_out or [])], prior, log_map, advance)
        judging = [log for found in opened[len(logs) :] for log in found]
        drive = common_drive([log for found in opened for log in found], input)
        if trust == "thrust" and (
            drive == "throttle" or (drive == "rotor_speed" and vehicle is None)
        ):
            raise ValueError(
                f"--trust thrust: {drive} tells no newtons without a measured coefficient; "
                f"give --mass."
            )
        fitted, judging, parts, left_out = split(opened[: len(logs)], judging)
        judging, unfit = fit_to_judge(judging, parts, prior, drive)
        advance(READ, f"{len(fitted)} flight{'s' * (len(fitted) > 1)}")
        stop = parts[0][0] if parts else 1.0
        found = identified(
            fitted, prior, mass=mass, trusted=trust == "thrust", drive=drive, stop=stop
        )
        advance(FITTED, "judging")
        rows = errors_on(found, judging, parts, plain=True)
        advance(1.0)
    tell(*notes, *left_out, *unfit, *found.notes, indent="  ")
    config: dict[str, Any] = {
        "logs": logs,
        "vehicle": prior.name,
        "mass": mass,
        "trust": trust,
        "input": drive,
    }
    config |= {"held_out": [log.name for log in judging], "map": log_map}
    own, failure = _vehicle(found, name)
    metrics = as_json(found, rows)

    def write(folder: Path) -> None:
        from diagrams.identification.page import write_page
        from np_drake.vehicle.text import save_vehicle

        (folder / FILE).unlink(missing_ok=True)  # of an earlier identification
        if own is not None:
            save_vehicle(own, folder / FILE)
            say(f"vehicle file: {folder / FILE}")
        output.write_metrics(folder / JSON, SCHEMA, seed=run.seed, config=config, **metrics)
        say(f"page: {write_page(found, rows, folder, thirds=bool(parts))}")

    from diagrams.identification.text import change, summary

    lines = [*summary(found), *filter(None, [change(rows)])]
    loops = [rate_loop(found)] if found.rate_loop else []
    tables = [table(found), *loops, *([judged(found, rows)] if rows else [])]
    return Report(tables, config=config, metrics=metrics, lines=lines, write=write, failure=failure)


@contextmanager
def _earlier_named(folder: Path | None) -> Iterator[None]:
    """Say with the reason of a failure that the folder's vehicle file is of an earlier run."""
    try:
        yield
    except (ValueError, OSError) as error:
        if folder is None or not (folder / FILE).is_file():
            raise
        from diagrams.cli.outcome import text_of

        raise ValueError(f"{text_of(error)} {folder / FILE} is of an earlier run.") from error


def _vehicle(found: "Identification", name: str) -> "tuple[Vehicle | None, FailedRun | None]":
    """Return the identified vehicle, or None with the reason where its values are none's."""
    from np_drake.identification.identified_vehicle import identified_vehicle

    if found.basis.ratios:
        return None, None
    try:
        return identified_vehicle(found, name), None
    except ValueError as error:
        return None, FailedRun(f"no {FILE}: {' '.join(str(error).split())}")
