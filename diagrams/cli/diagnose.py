"""`np-drake diagnose`: where simulator and flights part, which effect causes it, how far it
shrinks.
"""

from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from diagrams.cli.output import Table, progress, say, tell
from diagrams.cli.runner import Report, Run, reports
from diagrams.gap import side_by_side
from diagrams.gap.corrected import FILE, SECOND, corrected_simulator, with_trial, write_corrected
from diagrams.gap.drake_replay import DrakeReplay
from np_drake.diagnosis.diagnose import diagnose as five_steps
from np_drake.diagnosis.options import IDEAL_SENSORS, Tolerance
from np_drake.diagnosis.report import answer, words
from np_drake.diagnosis.report.page import write_report
from np_drake.diagnosis.residuals import require_flights
from np_drake.diagnosis.result import Diagnosis
from np_drake.flight_log import FlightLog
from np_drake.logs.case_folder import CaseFiles, find_case
from np_drake.logs.formats.neurobem import is_neurobem
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import left_out, load_vehicle

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
) -> Report:
    """Diagnose the gap between the nominal simulator and flights; with --out: report, replay,
    figures, JSON.
    """
    files = _choose_files(case, vehicle, train or [], held_out or [])
    nominal = _nominal_vehicle(files)
    logs = files.open(nominal)
    tell(*(f"{log.name}: {note}" for flights in logs for log in flights for note in log.notes))
    beside = files.open_neighbours(neighbour or (), logs)
    require_flights(*logs)  # what is refused is so without a bar
    with progress("diagnosing", 1.0) as advance:
        found = five_steps(
            nominal,
            *logs,
            None if no_replay else DrakeReplay(nominal),
            adaptive_split=not no_second_look,
            tolerance={None: None, True: Tolerance(), False: IDEAL_SENSORS}[rig],
            material=material,
            neighbours=beside,
            on_progress=advance,
        )
        advance(1.0)
    nominal = found.nominal or nominal
    if run.folder is not None:
        with progress("trying the corrected simulator", 1.0) as advance:
            found = with_trial(found, nominal)
            advance(1.0)
    config: dict[str, Any] = {
        "vehicle": nominal.name,
        "train": files.train,
        "held_out": files.held_out,
        "replay": not no_replay,
        "second_look": not no_second_look,
        "rig": rig,
        "material": material,
    }
    config |= {"neighbour": neighbour} if neighbour else {}

    def write(folder: Path) -> None:
        links = _write_overlay(found, nominal, [] if no_replay else logs[1], folder)
        links |= _write_simulators(found, nominal, folder)
        say(f"report: {write_report(found, folder, seed=run.seed, config=config, beside=links)}")

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


def judgement(diagnosis: Diagnosis) -> list[str]:
    """Return what stands against any answer, the headline, the sentence below it, and the same of a
    second answer.
    """
    said = [f"Before the answer: {doubt}." for doubt in diagnosis.doubts]
    said += [f"{answer.headline(diagnosis)}.", answer.lead(diagnosis)]
    if (refit := diagnosis.refit) is not None:
        flights = words.flights(len(diagnosis.held_out))
        again = f"Second answer, with the first halves of {flights} in the fit:"
        said += ["", f"{again} {answer.headline(refit)}.", answer.lead(refit)]
    return [*said, ""]


def tables(diagnosis: Diagnosis) -> list[Table]:
    """Return the tables that have rows, the answer first."""
    every: list[Table] = [
        (
            "what differs from the vehicle file (calibration, no cause)",
            answer.DIFFERENCE_HEADER,
            answer.difference_rows(diagnosis),
        )
    ]
    found = [(diagnosis, "")]
    found += [(diagnosis.refit, "second answer: ")] if diagnosis.refit is not None else []
    for one, which in found:
        header, rows = answer.cause_table(one)
        shown = [row[: answer.SHOWN] for row in rows]
        every.append((f"{which}what the model lacks", header[: answer.SHOWN], shown))
        said = []
        for cause in answer.named_causes(one):
            onsets = {words.plain_name(n): t for n, t in cause.onset.items() if t is not None}
            begins = ", ".join(words.onset(t, name) for name, t in onsets.items())
            said += [f"{cause.identifier} begins in {begins}"] if begins else []
            others = words.listed(cause.indistinguishable_from, "or")
            alike = f"{cause.identifier}, or else {others}: these logs cannot tell"
            said += [alike] if others else []
        every.append(("of these causes", ["said"], [(text,) for text in said]))
    for one, which in found:
        left = "" if one.cannot_tell else f". {answer.remains(one)}"
        every.append((f"{which}what remains{left}", answer.GAP_HEADER, answer.gap_rows(one)))
    traces = [(words.described(one), one.measurement) for one in diagnosis.unexplained]
    every.append(("what would end it", ["trace", "measurement"], traces))
    minor = [f"{one.name}: {one.text}" for one in diagnosis.below_threshold]
    for title, texts in (
        ("what to do next", answer.next_steps(diagnosis)),
        ("minor findings", minor),
    ):
        every.append((title, ["finding"], [(text,) for text in texts]))
    return [table for table in every if table[-1]]


def notes(diagnosis: Diagnosis) -> list[str]:
    """Return the sensors that were assumed, and every warning once."""
    named = {"rig": "real", "laboratory": "ideal"}
    sensors = named.get(diagnosis.judged_as, diagnosis.judged_as)
    judged = [f"Judged as logs of {sensors} sensors (--rig, --laboratory)."] if sensors else []
    return [*judged, *(f"warning: {text}" for text in answer.warnings(diagnosis))]


def _write_simulators(found: Diagnosis, vehicle: Vehicle, folder: Path) -> dict[str, str]:
    """Write the corrected simulator of each answer to a folder, and return the texts of links by
    file.

    Raises: OSError: if one cannot be written.
    """
    links = {}
    for one, name, which in ((found, FILE, ""), (found.refit, SECOND, " of the second answer")):
        (folder / name).unlink(missing_ok=True)  # of an earlier diagnosis
        if one is None or one.cannot_tell:
            continue
        try:
            config = corrected_simulator(one, vehicle)
        except ValueError as error:
            tell(f"no {name}: {' '.join(str(error).split())}")
            continue
        write_corrected(config, one, folder / name)
        say(f"corrected simulator{which}: {folder / name}")
        how = "which no controller keeps in the air" if one.not_flyable else "to fly"
        links[name] = f"Corrected simulator{which}, {how}"
    return links


def _write_overlay(
    found: Diagnosis, vehicle: Vehicle, held_out: list[FlightLog], folder: Path
) -> dict[str, str]:
    """Write `replay.html` to a folder and return the text of its link; print where it is, or why
    there is none.
    """
    path = folder / side_by_side.FILE
    path.unlink(missing_ok=True)  # of an earlier diagnosis
    if not held_out:
        return {}
    try:
        driven = [
            with_rotor_input(log, vehicle) if log.input == "rotor_speed" else log
            for log in held_out
        ]
        beside = side_by_side.side_by_side(found, vehicle, driven)
    except side_by_side.NoReplay as reason:
        tell(f"no {side_by_side.FILE}: {reason}")
        return {}
    side_by_side.write_side_by_side(beside, vehicle, path)
    say(f"flight beside its simulators: {path}")
    say(*([f"  the corrected one: {beside.missing}"] if beside.missing else []))
    return {path.name: "Watch the flight beside its simulators"}


def _choose_files(
    case: Path | None, vehicle: Path | None, train: list[Path], held_out: list[Path]
) -> CaseFiles:
    """Return the files of a case folder, or those given one by one."""
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


def _nominal_vehicle(files: CaseFiles) -> Vehicle:
    """Return the nominal vehicle; without a file the published one where all flights are
    NeuroBEM's.

    Raises: ValueError: on a bad vehicle file; OSError: if a flight cannot be opened.
    """
    if files.vehicle is None:
        published = all(is_neurobem(path) for path in files.train + files.held_out)
        vehicle = load_vehicle("neurobem" if published else "paper")
        say(f"vehicle: {vehicle.name}, {vehicle.mass:g} kg, as no --vehicle was given.")
        return vehicle
    return vehicle_of(files.vehicle)


def vehicle_of(path: Path) -> Vehicle:
    """Return the vehicle of a file or preset, and print which parameters it does not name.

    Raises: ValueError: on a bad vehicle file.
    """
    vehicle = load_vehicle(path)
    if missing := left_out(path):
        tell(f"{path}: {', '.join(missing)} not named: those of the paper's vehicle are taken.")
    return vehicle
