"""`np-drake diagnose`: where simulator and flights part, which effect causes it, how far it shrinks."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from diagrams.cli import options
from diagrams.cli.output import make_folder, progress, require_folder, say, write_metrics
from np_drake.atomic_file import require_writable

if TYPE_CHECKING:
    from np_drake.diagnosis.result import Diagnosis
    from np_drake.logs.case_folder import CaseFiles
    from np_drake.logs.flight_log import FlightLog
    from np_drake.vehicle import Vehicle

NAMED_VEHICLES = ("paper", "neurobem")
LOG_HELP = "Flight log (CSV, .csv.gz, Parquet) or NeuroBEM CSV; repeatable."


def diagnose(
    case: Annotated[
        Path | None, typer.Argument(metavar="CASE", help="Folder of vehicle.yaml, train_* and heldout* logs.")
    ] = None,
    vehicle: Annotated[
        Path | None,
        typer.Option(
            "--vehicle",
            metavar="FILE",
            help="Vehicle file (YAML), or paper | neurobem; without it the latter for its flights, else the former.",
        ),
    ] = None,
    train: Annotated[
        list[Path] | None, typer.Option("--train", metavar="LOG", help=f"To fit effects to. {LOG_HELP}")
    ] = None,
    held_out: Annotated[
        list[Path] | None, typer.Option("--held-out", metavar="LOG", help=f"To judge them. {LOG_HELP}")
    ] = None,
    no_replay: Annotated[
        bool, typer.Option("--no-replay", help="Leave out the open-loop replay in the simulator.")
    ] = False,
    no_second_look: Annotated[
        bool, typer.Option("--no-second-look", help="Fit nothing to held-out flights, whatever they show.")
    ] = False,
    rig: Annotated[
        bool | None,
        typer.Option(
            "--rig/--laboratory", help="What file and sensors may be off by; default: as logs look."
        ),
    ] = None,
    repair: options.Repair = False,
    seed: options.Undrawn = 0,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for report, figures and JSON.")
    ] = None,
    json: options.Json = None,
) -> None:
    """Diagnose the gap between the nominal simulator and flights; with --out: report.html, figures, JSON."""
    if json is not None:
        require_writable(json)
    if out is not None:
        require_folder(out)
    files = choose_files(case, vehicle, list(train or ()), list(held_out or ()))
    nominal = nominal_vehicle(files)
    logs = [open_flights(paths, nominal, repair=repair) for paths in (files.train, files.held_out)]
    found = run(nominal, *logs, replay=not no_replay, second_look=not no_second_look, rig=rig)
    config: dict[str, Any] = {"vehicle": nominal.name, "train": files.train, "held_out": files.held_out}
    config |= {"replay": not no_replay, "second_look": not no_second_look, "rig": rig, "repair": repair}
    if out is not None:
        from np_drake.diagnosis.report.write import write_report

        report = write_report(found, make_folder(out), seed=seed, config=config)
    content = found.as_json()
    del content["schema"]  # the head says it
    write_metrics(json, "diagnosis", seed=seed, config=config, **content)
    from diagrams.cli.diagnosis_tables import show

    show(found)
    if out is not None:
        say(f"report: {report}")


def choose_files(
    case: Path | None, vehicle: Path | None, train: list[Path], held_out: list[Path]
) -> "CaseFiles":
    """Those of a case folder, or those given one by one.

    Raises: ValueError: if both or neither are given, or the folder is no case.
    """
    from np_drake.logs.case_folder import CaseFiles, find_case

    if case is None:
        if not train or not held_out:
            raise ValueError("give a case folder, or at least one --train LOG and one --held-out LOG.")
        return CaseFiles(vehicle, tuple(train), tuple(held_out))
    if case.is_file():
        raise ValueError(
            f"{case}: CASE must be a folder; name every log behind its own --train or --held-out."
        )
    if train or held_out:
        raise ValueError("give either a case folder or --train and --held-out, not both.")
    return find_case(case, vehicle)


def nominal_vehicle(files: "CaseFiles") -> "Vehicle":
    """What the nominal simulator knows; without a vehicle file the published one where all flights are NeuroBEM's.

    Raises: ValueError: on a bad vehicle file; OSError: if a flight cannot be opened.
    """
    from np_drake.logs.neurobem import published_vehicle
    from np_drake.logs.open_log import is_neurobem
    from np_drake.vehicle import Vehicle, left_out, load_vehicle

    name = None if files.vehicle is None else str(files.vehicle)
    if name is None:
        name = "neurobem" if all(is_neurobem(path) for path in files.train + files.held_out) else "paper"
    if name not in NAMED_VEHICLES:
        vehicle = load_vehicle(name)
        if missing := left_out(name):
            say(f"{name}: {', '.join(missing)} not named: those of the paper's vehicle are taken.")
        return vehicle
    vehicle = published_vehicle() if name == "neurobem" else Vehicle()
    if files.vehicle is None:
        say(f"vehicle: {name}, {vehicle.mass:g} kg, as no --vehicle was given.")
    return vehicle


def open_flights(paths: tuple[Path, ...], vehicle: "Vehicle", *, repair: bool) -> "list[FlightLog]":
    """Every file opened and checked; what a reader derived or repaired is said.

    Raises: LogError, OSError: one line, at the first file that is not usable; ValueError: on an array (.npy).
    """
    from np_drake.logs.case_folder import open_flight

    logs = []
    for path in paths:
        log = open_flight(path, vehicle, repair=repair)
        say(*(f"{log.name}: {note}" for note in log.notes))
        logs.append(log)
    return logs


def run(
    vehicle: "Vehicle",
    train: "list[FlightLog]",
    held_out: "list[FlightLog]",
    *,
    replay: bool,
    second_look: bool = True,
    rig: bool | None = None,
) -> "Diagnosis":
    """The five steps behind a progress bar.   rig: logs of one, or of a laboratory; None: as they look."""
    from diagrams.gap.drake_replay import DrakeReplay
    from np_drake.diagnosis.diagnose import diagnose as five_steps
    from np_drake.diagnosis.residuals.requirements import require_flights
    from np_drake.diagnosis.tolerance import IDEAL_SENSORS, Tolerance

    require_flights(train, held_out)  # what is refused is so without a bar
    with progress("diagnosing", 1.0) as advance:
        simulator = DrakeReplay(vehicle) if replay else None
        how = {None: None, True: Tolerance(), False: IDEAL_SENSORS}[rig]
        found = five_steps(
            vehicle,
            train,
            held_out,
            simulator,
            adaptive_split=second_look,
            tolerance=how,
            on_progress=advance,
        )
        advance(1.0)
    return found
