"""`np-drake diagnose`: where simulator and flights part, which effect causes it, how far it
shrinks. `np-drake doctor`: is a flight log usable, and which effects can it tell, to what size.
"""

import dataclasses as dc
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from diagrams.batch.run import part_of, require
from diagrams.cli.verb import LogMap, Report, Run, Table, option, progress, reports, say, tell
from diagrams.evidence.studies.options import tabulate
from np_drake.diagnosis.diagnose import diagnose as five_steps
from np_drake.diagnosis.doctor.examine import NEVER, YES, Answer, LogReport, examine
from np_drake.diagnosis.options import IDEAL_SENSORS, Tolerance
from np_drake.diagnosis.report import words
from np_drake.diagnosis.report.diagnosis_page import write_report
from np_drake.diagnosis.residuals import require_flights
from np_drake.diagnosis.result import Diagnosis
from np_drake.files.number_text import measure, number, percent, with_unit
from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.logs.formats.neurobem import is_neurobem
from np_drake.logs.importing.log_map import load_map_file
from np_drake.logs.opening import CaseFiles, Opened, find_case, read_as_logged, with_vehicle
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import left_out, load_vehicle

LOG_HELP = "Flight log (CSV, .csv.gz, Parquet) or NeuroBEM CSV; repeatable."


@dc.dataclass(frozen=True)
class DiagnoseOptions:
    """Options of `diagnose`."""

    case: Path | None = option(
        "Folder of vehicle.yaml, train_* and heldout* logs.", kind=Argument, metavar="CASE"
    )
    vehicle: Path | None = option(
        "Vehicle file (YAML) or a name of `np-drake vehicle list`; default: neurobem for its "
        "flights, else paper.",
        metavar="VEHICLE",
    )
    train: list[Path] = option(f"To fit effects to. {LOG_HELP}", default=(), metavar="LOG")
    held_out: list[Path] = option(f"To judge them. {LOG_HELP}", default=(), metavar="LOG")
    before: list[Path] = option(
        "Flight of the same vehicle from before what is asked: the answer is then what changed "
        "since. Repeatable.",
        default=(),
        metavar="LOG",
    )
    same_battery: bool = option(
        "The battery stayed in place since the flights before: trim and thrust are as they were.",
        "--same-battery",
        default=False,
    )
    no_replay: bool = option(
        "Leave out the open-loop replay in the simulator.", "--no-replay", default=False
    )
    no_second_look: bool = option(
        "No second answer with halves of the held-out flights.", "--no-second-look", default=False
    )
    rig: bool | None = option(
        "Tolerances of vehicle file and logs: real or ideal sensors; default: as logs look.",
        "--rig/--laboratory",
    )
    material: float | None = option(
        "Position error after 1 s from which what is left is material [m], and force in "
        "proportion; default: 0.05, and 2 % of weight.",
        metavar="METRES",
        min=1e-4,
        max=1e3,
    )
    neighbour: list[str] = option(
        "Log of a vehicle that flew beside the flight of the log OF, whose downwash is then tried. "
        "Repeatable.",
        default=(),
        metavar="LOG=OF",
    )


@reports("diagnosis", seed=None, out="Folder for report, figures and JSON.", markdown=False)
def diagnose(run: Run, asked: DiagnoseOptions) -> Report:
    """Diagnose the gap between the nominal simulator and flights; with --out: report, replay,
    figures, JSON.
    """
    files = _choose_files(asked)
    nominal = _nominal_vehicle(files)
    logs = fitted, judging, earlier = files.open(nominal)
    neighbours = files.open_neighbours(asked.neighbour, logs)
    require_flights(*logs)  # what is refused is so without a bar, and before Drake is loaded
    from diagrams.gap.corrected import with_trial
    from diagrams.gap.drake_replay import DrakeReplay

    with progress("diagnosing") as advance:
        diagnosis = five_steps(
            fitted,
            judging,
            nominal,
            None if asked.no_replay else DrakeReplay(nominal),
            adaptive_split=not asked.no_second_look,
            tolerance={None: None, True: Tolerance(), False: IDEAL_SENSORS}[asked.rig],
            material=asked.material,
            neighbours=neighbours,
            before=earlier,
            same_battery=asked.same_battery,
            on_progress=advance,
        )
    nominal = diagnosis.nominal or nominal
    if run.folder is not None:
        with progress("trying the corrected simulator") as advance:
            diagnosis = with_trial(diagnosis, nominal)
    config: dict[str, Any] = {
        "vehicle": nominal.name,
        "train": files.train,
        "held_out": files.held_out,
        "before": files.before,
        "replay": not asked.no_replay,
        "second_look": not asked.no_second_look,
        "rig": asked.rig,
        "material": asked.material,
    }
    config |= {"neighbour": asked.neighbour} if asked.neighbour else {}

    def write(folder: Path) -> None:
        links = _write_overlay(diagnosis, nominal, [] if asked.no_replay else judging, folder)
        links |= _write_simulators(diagnosis, nominal, folder)
        report = write_report(diagnosis, folder, seed=run.seed, config=config, links=links)
        say(f"report: {report}")

    content = diagnosis.as_json()
    del content["schema"]  # the head says it
    return Report(
        tables(diagnosis),
        config=config,
        metrics=content,
        lines=judgement(diagnosis),
        notes=notes(diagnosis),
        warnings=words.warnings(diagnosis),
        write=write,
    )


def judgement(diagnosis: Diagnosis) -> list[str]:
    """Return what stands against any answer, the headline, the sentence below it, and the same of a
    second answer.
    """
    lines = [f"Before the answer: {doubt}." for doubt in diagnosis.doubts]
    lines += [f"{words.headline(diagnosis)}.", words.lead(diagnosis)]
    if (refit := diagnosis.refit) is not None:
        flights = words.flights(len(diagnosis.held_out))
        again = f"Second answer, with the first halves of {flights} in the fit:"
        lines += ["", f"{again} {words.headline(refit)}.", words.lead(refit)]
    return [*lines, ""]


def tables(diagnosis: Diagnosis) -> list[Table]:
    """Return the tables that have rows, the answer first."""
    result: list[Table] = [
        (
            "what differs from the vehicle file (calibration, no cause)",
            words.DIFFERENCE_HEADER,
            words.difference_rows(diagnosis),
        )
    ]
    answers = [(diagnosis, "")]
    answers += [(diagnosis.refit, "second answer: ")] if diagnosis.refit is not None else []
    for answer, which in answers:
        header, rows = words.cause_table(answer)
        shown = [row[: words.SHOWN] for row in rows]
        result.append((f"{which}what the model lacks", header[: words.SHOWN], shown))
        remarks = []
        for cause in words.named_causes(answer):
            begins = words.begins(cause)
            verb = "changes" if cause.loads else "begins"
            joined = ("; " if cause.loads else ", ").join(begins)
            remarks += [f"{cause.identifier} {verb} in {joined}"] if begins else []
            others = words.listed(cause.indistinguishable_from, "or")
            alike = f"{cause.identifier}, or else {others}: these logs cannot tell"
            remarks += [alike] if others else []
        result.append(("of these causes", ["said"], [(text,) for text in remarks]))
    for answer, which in answers:
        rest = "" if answer.cannot_tell else f". {words.remains(answer)}"
        result.append((f"{which}what remains{rest}", words.GAP_HEADER, words.gap_rows(answer)))
    traces = [(words.described(one), one.measurement) for one in diagnosis.unexplained]
    result.append(("what would end it", ["trace", "measurement"], traces))
    minor = [f"{one.name}: {one.text}" for one in diagnosis.below_threshold]
    for title, texts in (
        ("what to do next", words.next_steps(diagnosis)),
        ("minor findings", minor),
    ):
        result.append((title, ["finding"], [(text,) for text in texts]))
    return [table for table in result if table[-1]]


def notes(diagnosis: Diagnosis) -> list[str]:
    """Return the sensors that were assumed."""
    named = {"rig": "real", "laboratory": "ideal"}
    sensors = named.get(diagnosis.judged_as, diagnosis.judged_as)
    return [f"Judged as logs of {sensors} sensors (--rig, --laboratory)."] if sensors else []


def _write_simulators(diagnosis: Diagnosis, vehicle: Vehicle, folder: Path) -> dict[str, str]:
    """Write the corrected simulator of each answer to a folder, and return the texts of links by
    file.

    Raises: OSError: if one cannot be written.
    """
    from diagrams.gap.corrected import FILE, SECOND, corrected_simulator, write_corrected

    links = {}
    second = (diagnosis.refit, SECOND, " of the second answer")
    for answer, name, which in ((diagnosis, FILE, ""), second):
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
    diagnosis: Diagnosis, vehicle: Vehicle, held_out: list[FlightLog], folder: Path
) -> dict[str, str]:
    """Write `replay.html` to a folder and return the text of its link; print where it is, or why
    there is none.
    """
    from diagrams.gap import side_by_side

    path = folder / side_by_side.FILE
    path.unlink(missing_ok=True)  # of an earlier diagnosis
    if not held_out:
        return {}
    try:
        driven = [
            with_rotor_input(log, vehicle) if log.input == "rotor_speed" else log
            for log in held_out
        ]
        replays = side_by_side.side_by_side(diagnosis, vehicle, driven)
    except side_by_side.NoReplay as reason:
        tell(f"no {side_by_side.FILE}: {reason}")
        return {}
    side_by_side.write_side_by_side(replays, vehicle, path)
    say(f"flight beside its simulators: {path}")
    say(*([f"  the corrected one: {replays.missing}"] if replays.missing else []))
    return {path.name: "Watch the flight beside its simulators"}


def _choose_files(asked: DiagnoseOptions) -> CaseFiles:
    """Return the files of a case folder, or those given one by one."""
    case = asked.case
    train = asked.train
    held_out = asked.held_out
    before = tuple(asked.before)
    if case is None:
        require(
            bool(train and held_out),
            "give a case folder, or at least one --train LOG and one --held-out LOG.",
        )
        return CaseFiles(asked.vehicle, tuple(train), tuple(held_out), before)
    require(
        not case.is_file(),
        f"{case}: CASE must be a folder; name every log behind its own --train or --held-out.",
    )
    require(
        not (train or held_out), "give either a case folder or --train and --held-out, not both."
    )
    files = find_case(case, asked.vehicle)
    return dc.replace(files, before=(*files.before, *before))


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
    log_map: LogMap = None,
) -> Report:
    """Examine flight logs: rates, gaps, noise, clocks, motion, and which effects they can tell, to
    what size.
    """
    nominal = None if vehicle is None else vehicle_of(vehicle)
    declared = None if log_map is None else load_map_file(log_map)
    opened = list[Opened]()
    failures = list[Exception]()
    refused = list[LogError]()
    with progress("examining") as advance:
        for read, path in enumerate(logs):
            try:
                reading = part_of(advance, 0.3 * read / len(logs), 0.3 / len(logs))
                opened.append(read_as_logged(path, declared, on_progress=reading))
            except (LogError, OSError) as error:
                failures.append(error)
        opened = with_vehicle(opened, nominal, refused)
        failures += refused
        flights = [flight for log in opened for flight in log.flights]
        if not flights:
            raise failures[0]
        sheets = {
            flight.name: log.sheet.content
            for log in opened
            if log.sheet is not None
            for flight in log.flights
        }
        examining = part_of(advance, 0.3, 0.7)
        report = examine(flights, nominal, sheets=sheets, on_progress=examining)
    tell(*(f"not usable: {failure}" for failure in failures[1:]))
    return Report(
        _what_they_tell(report),
        config={"logs": logs, "vehicle": nominal and nominal.name, "map": log_map},
        metrics={**report.as_json(), "failures": [str(f) for f in failures]},
        lines=_usable(report),
        failure=failures[0] if failures else None,
    )


def _usable(report: LogReport) -> list[str]:
    """Return whether the logs are usable, and what limits their use."""
    several = len(report.flights) > 1
    head = f"{len(report.flights)} flights" if several else report.flights[0].name
    judged = f", {report.vehicle}, {report.sensors} sensors" if report.sensors else ""
    usable = "yes, with limits" if report.problems else "yes"
    return [
        f"{head}{judged}: usable: {usable if report.usable else 'no'}",
        *(f"! {problem}" for problem in report.problems),
        f"clocks: {'; '.join(map(str, report.flights[0].lags)) or 'no lag can be told'}",
    ]


def _what_they_tell(report: LogReport) -> list[Table]:
    """Return the tables of a report that have rows: flights, findings, and what they can tell."""
    groups: dict[str, list[Answer]] = {}
    for one in report.answers:
        groups.setdefault(one.identifier, []).append(one)
    observable = list[tuple]()
    missed = list[tuple]()
    never = list[tuple]()
    for name, answers in groups.items():
        first = answers[0]
        clear = [a for a in answers if a.verdict == YES]
        row = (name, _sizes(answers, bool(clear)), number(first.typical, 2))
        if clear:
            observable.append((*row, clear[0].note))
        elif first.verdict == NEVER:
            never.append((name, f"{first.reason}; {first.todo}"))
        else:
            why = f"like {first.beside[0]}" if first.is_alike else "no clear trace"
            missed.append((*row, why, first.todo))
    header = ["effect", "from this size", "usual"]
    result: list[Table] = [
        *_findings(report),
        ("can be told (in brackets: not)", [*header, "note"], observable),
        ("cannot be told", [*header, "why", "to fly"], missed),
        ("never", ["effect", "why"], never),
    ]
    return [table for table in result if table[-1]]


def _findings(report: LogReport) -> list[Table]:
    """Return the flights, the noise of the first, and motion and residual of all."""
    first = report.flights[0]
    flights = tabulate(
        "flights",
        report.flights,
        (
            ("flight", lambda f: f.name),
            ("s", lambda f: f.duration),
            ("rows", lambda f: f.rows),
            ("Hz", lambda f: 1 / f.step),
            ("gaps", lambda f: f"{f.gaps} up to {number(f.longest, 2)} s" if f.gaps else "none"),
            ("bridged", lambda f: f.bridged),
            ("input", lambda f: f.input),
            ("timing", lambda f: measure(f.timing, "s") if f.timing else None),
            ("rotor at limit", lambda f: percent(f.saturated)),
            ("worst misfit [1]", lambda f: max(f.misfits.values(), default=None)),
        ),
    )
    noise = tabulate(
        f"white noise of {first.name}, per row",
        first.signals,
        (
            ("signal", lambda s: s.name),
            ("found", lambda s: measure(s.white, s.unit)),
            ("usual", lambda s: measure(s.usual, s.unit) if s.usual else None),
        ),
    )
    floor = report.noise_floor
    residual: list[tuple] = [
        *((f"force {axis}, RMS", percent(x)) for axis, x in report.residual_force.items()),
        *((f"{name}, when every effect helps", value) for name, value in floor.items()),
    ]
    return [
        flights,
        noise,
        ("motion", ["quantity", "value"], list(report.excitation.items())),
        ("residual", ["of weight; [N, N·m]", "value"], residual if floor else []),
    ]


def _sizes(answers: list[Answer], observable: bool) -> str:
    """Return the smallest sizes that can be told, in brackets those that cannot."""
    shown = []
    for a in answers:
        axis = f"{a.parameter.split('_')[-1]} " if len(answers) > 1 else ""
        text = f"{axis}{number(a.smallest, 2)}"
        shown.append(f"({text})" if observable and a.verdict != YES else text)
    return with_unit(", ".join(shown), answers[0].unit)
