"""`np-drake diagnose`: where simulator and flights part, which effect causes it, how far it
shrinks.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.output import progress, say, tell
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from np_drake.diagnosis.result import Diagnosis
    from np_drake.flight_log import FlightLog
    from np_drake.logs.case_folder import CaseFiles
    from np_drake.vehicle import Vehicle

Out = Annotated[
    Path | None, Option("--out", metavar="DIR", help="Folder for report, figures and JSON.")
]
LOG_HELP = "Flight log (CSV, .csv.gz, Parquet) or NeuroBEM CSV; repeatable."


@reports("diagnosis", seed=None, out=Out, markdown=False)
def diagnose(
    run: Run,
    case: Annotated[
        Path | None,
        Argument(metavar="CASE", help="Folder of vehicle.yaml, train_* and heldout* logs."),
    ] = None,
    vehicle: Annotated[
        Path | None,
        Option(
            "--vehicle",
            metavar="VEHICLE",
            help="Vehicle file (YAML) or a name of `np-drake vehicle list`; default: neurobem "
            "for its flights, "
            "else paper.",
        ),
    ] = None,
    train: Annotated[
        list[Path] | None, Option(metavar="LOG", help=f"To fit effects to. {LOG_HELP}")
    ] = None,
    held_out: Annotated[
        list[Path] | None, Option(metavar="LOG", help=f"To judge them. {LOG_HELP}")
    ] = None,
    no_replay: Annotated[
        bool, Option("--no-replay", help="Leave out the open-loop replay in the simulator.")
    ] = False,
    no_second_look: Annotated[
        bool,
        Option("--no-second-look", help="No second answer with halves of the held-out flights."),
    ] = False,
    rig: Annotated[
        bool | None,
        Option(
            "--rig/--laboratory",
            help=(
                "Tolerances of vehicle file and logs: real or ideal sensors; default: as logs look."
            ),
        ),
    ] = None,
    material: Annotated[
        float | None,
        Option(
            metavar="METRES",
            min=1e-4,
            max=1e3,
            help="Position error after 1 s from which what is left is material [m], and force "
            "in proportion; "
            "default: 0.05, and 2 % of weight.",
        ),
    ] = None,
    neighbour: Annotated[
        list[str] | None,
        Option(
            metavar="LOG=OF",
            help="Log of a vehicle that flew beside the flight of the log OF, whose downwash is "
            "then tried. Repeatable.",
        ),
    ] = None,
    repair: options.Repair = False,
) -> Report:
    """Diagnose the gap between the nominal simulator and flights; with --out: report, replay,
    figures, JSON.
    """
    files = _choose_files(case, vehicle, list(train or ()), list(held_out or ()))
    nominal = nominal_vehicle(files)
    logs = files.open(nominal, repair=repair)
    tell(
        *(f"{log.name}: {note}" for flights in logs for log in flights for note in log.notes),
        indent="  ",
    )
    beside = files.open_neighbours(neighbour or (), logs)
    how: dict[str, Any] = {
        "replay": not no_replay,
        "second_look": not no_second_look,
        "rig": rig,
        "material": material,
    }
    found = diagnose_logs(nominal, *logs, **how, neighbours=beside)
    nominal = found.nominal or nominal
    if run.folder is not None:
        from diagrams.gap.corrected import with_trial

        with progress("trying the corrected simulator", 1.0) as advance:
            found = with_trial(found, nominal)
            advance(1.0)
    config: dict[str, Any] = {
        "vehicle": nominal.name,
        "train": files.train,
        "held_out": files.held_out,
    }
    config |= {**how, "repair": repair, **({"neighbour": neighbour} if neighbour else {})}

    def write(folder: Path) -> None:
        from np_drake.diagnosis.report.page import write_report

        beside = {}
        if page := _write_overlay(found, nominal, logs[1] if not no_replay else [], folder):
            beside[page.name] = "Watch the flight beside its simulators"
        beside |= _write_simulators(found, nominal, folder)
        say(f"report: {write_report(found, folder, seed=run.seed, config=config, beside=beside)}")

    from diagrams.cli.diagnosis_tables import judgement, notes, tables

    content = found.as_json()
    del content["schema"]  # the head says it
    return Report(
        tables(found),
        config=config,
        metrics=content,
        lines=judgement(found),
        notes=notes(found),
        write=write,
    )


def _write_simulators(found: "Diagnosis", vehicle: "Vehicle", folder: Path) -> dict[str, str]:
    """Write the corrected simulator of each answer to a folder, and return the texts of links by
    file.

    Raises: OSError: if one cannot be written.
    """
    from diagrams.gap.corrected import FILE, SECOND, corrected_simulator, write_corrected

    links = {}
    for answer, name, which in ((found, FILE, ""), (found.refit, SECOND, " of the second answer")):
        (folder / name).unlink(missing_ok=True)  # of an earlier diagnosis
        if answer is None or answer.cannot_tell:
            continue
        try:
            config = corrected_simulator(answer, vehicle)
        except ValueError as error:
            tell(f"no {name}: {' '.join(str(error).split())}")
            continue
        write_corrected(config, answer, folder / name)
        say(f"corrected simulator{which}: {folder / name}")
        how = "which no controller keeps in the air" if answer.not_flyable else "to fly"
        links[name] = f"Corrected simulator{which}, {how}"
    return links


def _write_overlay(
    found: "Diagnosis", vehicle: "Vehicle", held_out: "list[FlightLog]", folder: Path
) -> Path | None:
    """Write `replay.html` to a folder and print where it is, or why there is none; without flights
    say nothing.

    Raises: OSError: if it cannot be written.
    """
    from diagrams.gap.side_by_side import FILE, NoReplay, side_by_side, write_side_by_side
    from np_drake.rotor_input import with_rotor_input

    path = folder / FILE
    path.unlink(missing_ok=True)  # of an earlier diagnosis
    if not held_out:
        return None
    try:
        driven = [
            with_rotor_input(log, vehicle) if log.input == "rotor_speed" else log
            for log in held_out
        ]
        beside = side_by_side(found, vehicle, driven)
    except NoReplay as reason:
        tell(f"no {FILE}: {reason}")
        return None
    write_side_by_side(beside, vehicle, path)
    if beside.missing:
        say(
            f"flight beside the nominal simulator alone: {path}",
            f"  the corrected one: {beside.missing}",
        )
    else:
        say(f"flight beside its simulators: {path}")
    return path


def _choose_files(
    case: Path | None, vehicle: Path | None, train: list[Path], held_out: list[Path]
) -> "CaseFiles":
    """Return the files of a case folder, or those given one by one.

    Raises: ValueError: if both or neither are given, or the folder is no case.
    """
    from np_drake.logs.case_folder import CaseFiles, find_case

    if case is None:
        if not train or not held_out:
            raise ValueError(
                "give a case folder, or at least one --train LOG and one --held-out LOG."
            )
        return CaseFiles(vehicle, tuple(train), tuple(held_out))
    if case.is_file():
        raise ValueError(
            f"{case}: CASE must be a folder; name every log behind its own --train or --held-out."
        )
    if train or held_out:
        raise ValueError("give either a case folder or --train and --held-out, not both.")
    return find_case(case, vehicle)


def nominal_vehicle(files: "CaseFiles") -> "Vehicle":
    """Return the nominal vehicle; without a file the published one where all flights are
    NeuroBEM's.

    Raises: ValueError: on a bad vehicle file; OSError: if a flight cannot be opened.
    """
    from np_drake.logs.formats.neurobem import is_neurobem
    from np_drake.vehicle import load_vehicle

    if files.vehicle is None:
        published = all(is_neurobem(path) for path in files.train + files.held_out)
        vehicle = load_vehicle("neurobem" if published else "paper")
        say(f"vehicle: {vehicle.name}, {vehicle.mass:g} kg, as no --vehicle was given.")
        return vehicle
    return vehicle_of(files.vehicle)


def vehicle_of(path: Path) -> "Vehicle":
    """Return the vehicle of a file or preset, and print which parameters it does not name.

    Raises: ValueError: on a bad vehicle file.
    """
    from np_drake.vehicle.vehicle import left_out, load_vehicle

    vehicle = load_vehicle(path)
    if missing := left_out(path):
        tell(
            f"{path}: {', '.join(missing)} not named: those of the paper's vehicle are taken.",
            indent="  ",
        )
    return vehicle


def diagnose_logs(
    vehicle: "Vehicle",
    train: "list[FlightLog]",
    held_out: "list[FlightLog]",
    *,
    replay: bool,
    second_look: bool = True,
    rig: bool | None = None,
    material: float | None = None,
    neighbours: Mapping[str, "list[FlightLog]"] | None = None,
) -> "Diagnosis":
    """Run the five steps behind a progress bar.

    Args:
        rig: whether sensors are real or ideal; None: as the logs look.
        material: position error from which what is left is material [m]; None: the usual one.
        neighbours: by name of a flight, logs of vehicles that flew beside it.
    """
    from diagrams.gap.drake_replay import DrakeReplay
    from np_drake.diagnosis.diagnose import diagnose as five_steps
    from np_drake.diagnosis.options import IDEAL_SENSORS, Tolerance
    from np_drake.diagnosis.residuals import require_flights

    require_flights(train, held_out)  # what is refused is so without a bar
    with progress("diagnosing", 1.0) as advance:
        simulator = DrakeReplay(vehicle) if replay else None
        tolerance = {None: None, True: Tolerance(), False: IDEAL_SENSORS}[rig]
        how: dict[str, Any] = {
            "adaptive_split": second_look,
            "tolerance": tolerance,
            "material": material,
        }
        found = five_steps(
            vehicle, train, held_out, simulator, **how, neighbours=neighbours, on_progress=advance
        )
        advance(1.0)
    return found
