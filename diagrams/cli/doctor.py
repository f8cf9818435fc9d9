"""`np-drake doctor`: is a flight log usable, and which effects can it tell, to what size."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.diagnose import vehicle_of
from diagrams.cli.output import Table, progress, tell
from diagrams.cli.runner import Report, Run, reports
from np_drake.diagnosis.doctor.examine import NEVER, YES, Answer, LogReport, examine
from np_drake.diagnosis.doctor.flight_facts import FlightFacts
from np_drake.files.number_text import fixed, measure, number, percent, with_unit
from np_drake.logs.errors import LogError
from np_drake.logs.importing.consistency import SCALE
from np_drake.logs.importing.log_map import load_map_file
from np_drake.logs.opening import Opened, read_as_logged, with_vehicle

NOTED = 3.0  # times its usual noise from which a signal's is noted as high [1]
SHOWN = 0.5  # share of repeated rows from which a signal's are noted [1]


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
    nominal = None if vehicle is None else vehicle_of(vehicle)
    declared = None if log_map is None else load_map_file(log_map)
    opened, failures, refused = list[Opened](), list[Exception](), list[LogError]()
    with progress("examining", 1.0) as advance:
        for read, path in enumerate(logs):

            def reading(share: float, before: int = read) -> None:
                advance(0.3 * (before + share) / len(logs))

            try:
                opened.append(read_as_logged(path, declared, repair=repair, on_progress=reading))
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
    tell(*(f"not usable: {failure}" for failure in failures[1:]), indent="  ")
    named = None if nominal is None else nominal.name
    return Report(
        tables(report),
        config={"logs": logs, "vehicle": named, "map": log_map, "repair": repair},
        metrics={**report.as_json(), "failures": [str(f) for f in failures]},
        lines=judgement(report),
        failure=failures[0] if failures else None,
    )


def judgement(report: "LogReport") -> list[str]:
    """Return whether the logs are usable, and what limits their use."""
    several = len(report.flights) > 1
    head = f"{len(report.flights)} flights" if several else report.flights[0].name
    judged = f", {report.vehicle}, {report.sensors} sensors" if report.sensors else ""
    usable = "yes, with limits" if report.problems else "yes"
    return [
        f"{head}{judged}: usable: {usable if report.usable else 'no'}",
        *(f"! {problem}" for problem in report.problems),
    ]


def tables(report: "LogReport") -> list[Table]:
    """Return the tables of a report that have rows: flights, findings, and what they can tell."""
    swings = {test.flight: test.swings for test in report.swings}
    flights = [
        (f.name, f.duration, 1 / f.step, _gaps(f), "yes" if swings.get(f.name) else "no")
        for f in report.flights
    ]
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
        ("flights", ["flight", "s", "Hz", "gaps", "swings"], flights if len(flights) > 1 else []),
        ("findings", ["", "found"], _findings(report)),
        ("can be told (in brackets: not)", [*header, "note"], told),
        ("cannot be told", [*header, "why", "to fly"], missed),
        ("never", ["effect", "why"], never),
    ]
    return [table for table in every if table[-1]]


def _findings(report: "LogReport") -> list[tuple[str, str]]:
    """Return what was found of the first flight and, in motion and residual, of all."""
    f, floor = report.flights[0], report.noise_floor
    rows = [("rows", f"{number(f.duration)} s, {f.rows} at {number(1 / f.step)} Hz, {_gaps(f)}")]
    rows.append(("input", f.input + (f", known to {measure(f.timing, 's')}" if f.timing else "")))
    if f.saturated is not None:
        rows.append(("limits", f"a rotor at its limit in {percent(f.saturated)} of the rows"))
    if f.imported:
        slow = [f"{name} {entry['rate']}" for name, entry in f.imported["columns"].items()]
        rows.append(("import", f"{f.imported['format']}: {', '.join(slow)}"))
    rows.append(("conventions", _conventions(f)))
    rows.append(("noise", _noise(f)))
    unknown = "no two signals move alike enough to tell their lag"
    rows.append(("clocks", "; ".join(map(str, f.lags)) or unknown))
    rows.append(("motion", _motion(report)))
    if floor:
        shares = ", ".join(fixed(100 * share, 1) for share in report.residual_force.values())
        force = measure(max(floor[f"force {axis}"] for axis in "xyz"), "N")
        torque = max(floor[f"torque {axis}"] for axis in "xyz")
        turning = f"up to {measure(torque, 'N·m')}" if torque > 0 else "not known"
        rows.append(
            (
                "residual",
                f"force x, y, z {shares} % of weight (RMS); when every effect helps up to {force}, "
                f"torque {turning}",
            )
        )
    if report.swings:
        best = max(report.swings, key=lambda test: test.log_bayes_factor)
        what = "nothing does"
        if report.something_swings:
            size = f"{measure(best.mass, 'kg')} on {measure(best.length, 'm')}"
            what = f"SOMETHING SWINGS, as {size}"
        factor = f"log Bayes factor of a pendulum {fixed(best.log_bayes_factor, 0)}"
        rows.append(("swings", f"{what} ({factor}; evident from {fixed(best.evident, 1)})"))
    return rows


def _gaps(f: "FlightFacts") -> str:
    several = "s" * (f.gaps != 1)
    gaps = f"{f.gaps} gap{several} up to {number(f.longest, 2)} s" if f.gaps else "no gaps"
    return gaps + (f", {f.bridged} rows bridged" if f.bridged else "")


def _conventions(f: "FlightFacts") -> str:
    if not f.misfits:
        return "not checked: too short, or no two quantities can be compared"
    worst = max(f.misfits, key=lambda law: f.misfits[law])
    own = f"{f.imported['frames'].split(';')[0]}; " if f.imported else ""
    misfit = f"worst misfit {number(f.misfits[worst], 2)} ({worst}; {SCALE})"
    return f"{own}{len(f.misfits)} checks, {misfit}"


def _noise(f: "FlightFacts") -> str:
    """Return the white noise of every signal, and what is unusual about it."""
    parts = []
    for s in f.signals:
        text = f"{s.name} {measure(s.white, s.unit)}"
        if s.usual and s.white > NOTED * s.usual:
            text += f" (usual {measure(s.usual, s.unit)})"
        if s.repeated > SHOWN:
            text += f" ({percent(s.repeated)} of the rows repeat)"
        if s.resolution > s.white:
            text += f" (rounded to {measure(s.resolution, s.unit)})"
        parts.append(text)
    return f"{', '.join([*parts, 'attitude ' + measure(f.attitude_noise, 'rad')])}, white, per row"


def _motion(report: "LogReport") -> str:
    every = [f.motion for f in report.flights]
    own = every[0] | report.excitation
    fastest = max(motion["fastest [m/s]"] for motion in every)
    lowest = min(motion["lowest [m]"] for motion in every)
    parts = [f"rates {number(own['rate [rad/s]'], 2)} rad/s"]
    parts.append(f"tilt {number(own['tilt [deg]'], 2)} deg")
    if fastest:  # 0 where no velocity is logged
        speed = measure(own["speed [m/s]"], "m/s")
        parts.insert(0, f"speed {speed} (at most {measure(fastest, 'm/s')})")
    if own["height span [m]"]:
        span = number(own["height span [m]"], 2)
        parts.append(f"height from {number(lowest, 2)} m over {span} m")
    if report.excitation:
        parts.append(f"thrust varies by {percent(own['thrust variation [1]'])}")
    return ", ".join(parts)


def _sizes(answers: "list[Answer]", told: bool) -> str:
    """Return the smallest sizes that can be told, in brackets those that cannot."""
    shown = []
    for a in answers:
        own = f"{a.parameter.split('_')[-1]} " if len(answers) > 1 else ""
        text = f"{own}{number(a.smallest, 2)}"
        shown.append(f"({text})" if told and a.verdict != YES else text)
    return with_unit(", ".join(shown), answers[0].unit)
