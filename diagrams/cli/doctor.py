"""`np-drake doctor`: is a flight log usable, and which effects can it tell, to what size."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from diagrams.cli.diagnose import vehicle_of
from diagrams.cli.output import Table, progress, tell
from diagrams.cli.runner import Report, Run, reports
from diagrams.studies.columns import tabulate
from np_drake.diagnosis.doctor.examine import NEVER, YES, Answer, LogReport, examine
from np_drake.files.number_text import measure, number, percent, with_unit
from np_drake.logs.errors import LogError
from np_drake.logs.importing.log_map import load_map_file
from np_drake.logs.opening import Opened, read_as_logged, with_vehicle


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
) -> Report:
    """Examine flight logs: rates, gaps, noise, clocks, motion, and which effects they can tell, to
    what size.
    """
    nominal = None if vehicle is None else vehicle_of(vehicle)
    declared = None if log_map is None else load_map_file(log_map)
    opened, failures, refused = list[Opened](), list[Exception](), list[LogError]()
    with progress("examining", 1.0) as advance:
        for read, path in enumerate(logs):

            def reading(share: float, before: int = read) -> None:
                advance(0.3 * (before + share) / len(logs))

            try:
                opened.append(read_as_logged(path, declared, on_progress=reading))
            except (LogError, OSError) as error:
                failures.append(error)
        opened = with_vehicle(opened, nominal, refused)
        failures += refused
        flights = [log for found in opened for log in found.flights]
        if not flights:
            raise failures[0]
        sheets = {
            log.name: found.sheet.content
            for found in opened
            if found.sheet is not None
            for log in found.flights
        }

        def examining(share: float, text: str) -> None:
            advance(0.3 + 0.7 * share, text)

        report = examine(flights, nominal, sheets=sheets, on_progress=examining)
        advance(1.0)
    tell(*(f"not usable: {failure}" for failure in failures[1:]))
    named = None if nominal is None else nominal.name
    return Report(
        tables(report),
        config={"logs": logs, "vehicle": named, "map": log_map},
        metrics={**report.as_json(), "failures": [str(f) for f in failures]},
        lines=judgement(report),
        failure=failures[0] if failures else None,
    )


def judgement(report: LogReport) -> list[str]:
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


def tables(report: LogReport) -> list[Table]:
    """Return the tables of a report that have rows: flights, findings, and what they can tell."""
    groups: dict[str, list[Answer]] = {}
    for answer in report.answers:
        groups.setdefault(answer.identifier, []).append(answer)
    told, missed, never = list[tuple](), list[tuple](), list[tuple]()
    for name, answers in groups.items():
        first, clear = answers[0], [a for a in answers if a.verdict == YES]
        row = (name, _sizes(answers, bool(clear)), number(first.typical, 2))
        if clear:
            told.append((*row, clear[0].reason.split(":")[0]))
        elif first.verdict == NEVER:
            never.append((name, f"{first.reason}; {first.todo}"))
        else:
            alike = first.reason.startswith("it cannot")
            why = f"like {first.beside[0]}" if alike else "no clear trace"
            missed.append((*row, why, first.todo))
    header = ["effect", "from this size", "usual"]
    every: list[Table] = [
        *_findings(report),
        ("can be told (in brackets: not)", [*header, "note"], told),
        ("cannot be told", [*header, "why", "to fly"], missed),
        ("never", ["effect", "why"], never),
    ]
    return [table for table in every if table[-1]]


def _findings(report: LogReport) -> list[Table]:
    """Return flights, and noise, motion and residual of the first or of all."""
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
        (f"force {axis}, RMS", percent(x)) for axis, x in report.residual_force.items()
    ]
    residual += [(f"{name}, when every effect helps", value) for name, value in floor.items()]
    return [
        flights,
        noise,
        ("motion", ["quantity", "value"], list((first.motion | report.excitation).items())),
        ("residual", ["of weight; [N, N·m]", "value"], residual if floor else []),
    ]


def _sizes(answers: list[Answer], told: bool) -> str:
    """Return the smallest sizes that can be told, in brackets those that cannot."""
    shown = []
    for a in answers:
        own = f"{a.parameter.split('_')[-1]} " if len(answers) > 1 else ""
        text = f"{own}{number(a.smallest, 2)}"
        shown.append(f"({text})" if told and a.verdict != YES else text)
    return with_unit(", ".join(shown), answers[0].unit)
