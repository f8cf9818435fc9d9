"""The one screen of `np-drake doctor`: lines of at most `WIDTH` columns from a report, broken
between words.
"""

from diagrams.cli.table_text import wrapped
from np_drake.diagnosis.doctor.examine import NEVER, YES, Answer, LogReport
from np_drake.diagnosis.doctor.flight_facts import FlightFacts
from np_drake.files.number_text import NBSP, fixed, measure, number, percent, with_unit
from np_drake.logs.importing.laws import SCALE

WIDTH = 80  # columns of the usual terminal
NOTED = 3.0  # times its usual noise from which a signal's is noted as high [1]
SHOWN = 0.5  # share of repeated rows from which a signal's are noted [1]
LABEL, NAME, SIZE, USUAL = 14, 24, 32, 8  # widths of columns
MOST_FLIGHTS = 8  # that have a line of their own
MOST_TODO = 6  # manoeuvres that are named; --json has all
MOST_PROBLEMS = 4
MOST_LINES = 3  # of a text behind its label
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"))


def screen(report: LogReport) -> list[str]:
    """Return the lines of a report."""
    lines = [] if len(report.flights) == 1 else _flights(report)
    first = report.flights[0]
    head = first.name[:36] if len(report.flights) == 1 else f"{len(report.flights)} flights"
    verdict = (
        "usable: no"
        if not report.usable
        else "usable: with limits"
        if report.problems
        else "usable: yes"
    )
    title = head + (f", {report.vehicle[:16]}, {report.sensors} sensors" if report.sensors else "")
    room = WIDTH - len(title)
    body = (
        [f"{title}{verdict:>{room}}"] if room > len(verdict) + 1 else [title, f"{verdict:>{WIDTH}}"]
    )
    for problem in report.problems[:MOST_PROBLEMS]:
        body += _labelled("!", problem, whole=True)
    if len(report.problems) > MOST_PROBLEMS:
        body += _labelled("!", f"{len(report.problems) - MOST_PROBLEMS} more (--json has all)")
    if len(report.flights) == 1:
        body += _facts(first)
    body += _labelled("noise", _noise(first))
    body += _labelled("clocks", _clocks(first))
    body += _labelled("motion", _motion(report))
    if report.noise_floor:
        body += _labelled("residual", _residual(report))
    if report.swings:
        body += _labelled("swings", _swings(report))
    return [*body[:1], *lines, *body[1:], *_effects(report)]


def _labelled(label: str, text: str, *, whole: bool = False) -> list[str]:
    """Return a text behind its label, in `MOST_LINES` at most, or whole."""
    if not text:
        return []
    lines = wrapped(text, WIDTH - LABEL)
    if len(lines) > MOST_LINES and not whole:
        lines = [
            *lines[: MOST_LINES - 1],
            wrapped(lines[MOST_LINES - 1], WIDTH - LABEL - 2)[0] + " …",
        ]
    shown = [
        line if len(line) <= WIDTH - LABEL else f"{line[: WIDTH - LABEL - 1]}…" for line in lines
    ]  # a path
    return [f"  {label if i == 0 else '':<{LABEL - 2}}{line}" for i, line in enumerate(shown)]


def _flights(report: LogReport) -> list[str]:
    tests = {test.flight: test for test in report.swings}
    lines = []
    for f in report.flights[:MOST_FLIGHTS]:
        test = tests.get(f.name)
        swings = (
            ""
            if test is None
            else f", swings: {'yes' if test.swings else 'no'} ({test.log_bayes_factor:.0f})"
        )
        text = f"{number(f.duration)} s at {number(1 / f.step)} Hz, {_gaps(f)}{swings}"
        lines += [
            f"  {f.name[:22] if i == 0 else '':<23}{line}"
            for i, line in enumerate(wrapped(text, WIDTH - 25))
        ]
    if len(report.flights) > MOST_FLIGHTS:
        lines.append(f"  … and {len(report.flights) - MOST_FLIGHTS} more (--json has all)")
    return lines


def _facts(f: FlightFacts) -> list[str]:
    lines = _labelled(
        "rows", f"{number(f.duration)} s, {f.rows} rows at {number(1 / f.step)} Hz, {_gaps(f)}"
    )
    timing = f", its time known to {number(1e3 * f.timing, 2)} ms" if f.timing else ""
    lines += _labelled(
        "input",
        f"{f.input}{timing}"
        + (
            ""
            if f.saturated is None
            else f"; a rotor at its limit in {percent(f.saturated)} of the rows"
        ),
    )
    sheet = f.imported
    if sheet:
        slow = [f"{name} {entry['rate']}" for name, entry in sheet["columns"].items()]
        lines += _labelled("import", f"{sheet['format']}: {', '.join(slow)}")
    return lines + _labelled("conventions", _conventions(f))


def _gaps(f: FlightFacts) -> str:
    gaps = (
        f"{f.gaps} gap{'s' * (f.gaps != 1)} up to {number(f.longest, 2)} s" if f.gaps else "no gaps"
    )
    return gaps + (f", {f.bridged} rows bridged" if f.bridged else "")


def _conventions(f: FlightFacts) -> str:
    if not f.misfits:
        return "not checked: too short, or no two quantities can be compared"
    worst = max(f.misfits, key=lambda law: f.misfits[law])
    own = f"{f.imported['frames'].split(';')[0]}; " if f.imported else ""
    return (
        f"{own}{len(f.misfits)} checks, worst misfit {number(f.misfits[worst], 2)} ({worst}; "
        f"{SCALE})"
    )


def _noise(f: FlightFacts) -> str:
    parts = []
    for s in f.signals:
        notes = []
        if s.usual and s.white > NOTED * s.usual:
            notes.append(f"usual {_si(s.usual, s.unit)}")
        if s.repeated > SHOWN:
            notes.append(f"{percent(s.repeated)} of the rows repeat")
        if s.resolution > s.white:
            notes.append(f"rounded to {_si(s.resolution, s.unit)}")
        parts.append(
            f"{s.name} {_si(s.white, s.unit)}" + (f" ({', '.join(notes)})" if notes else "")
        )
    return ", ".join([*parts, f"attitude {_si(f.attitude_noise, 'rad')}"]) + ", white, per row"


def _clocks(f: FlightFacts) -> str:
    return "; ".join(map(str, f.lags)) or "no two signals move alike enough to tell their lag"


def _motion(report: LogReport) -> str:
    every = [f.motion for f in report.flights]
    m = report.excitation
    own = every[0] | m
    fastest = max(motion["fastest [m/s]"] for motion in every)
    lowest = min(x["lowest [m]"] for x in every)
    parts = [
        f"rates {number(own['rate [rad/s]'], 2)} rad/s",
        f"tilt {number(own['tilt [deg]'], 2)} deg",
    ]
    if fastest:  # 0 where no velocity is logged
        parts.insert(0, f"speed {number(own['speed [m/s]'], 2)} m/s (at most {number(fastest, 2)})")
    if own["height span [m]"]:
        parts.append(
            f"height from {number(lowest, 2)} m over {number(own['height span [m]'], 2)} m"
        )
    return ", ".join(parts) + (
        f"; thrust varies by {percent(m['thrust variation [1]'])}" if m else ""
    )


def _residual(report: LogReport) -> str:
    floor, shares = report.noise_floor, [100 * value for value in report.residual_force.values()]
    force = max(floor[f"force {axis}"] for axis in "xyz")
    torques = [floor[f"torque {axis}"] for axis in "xyz"]
    turning = (
        f", torque up to {_si(max(torques), 'N·m')}" if max(torques) > 0 else ", torque not known"
    )
    before = ", ".join(fixed(share, 1) for share in shares)
    return (
        f"force x, y, z {before} % of weight (RMS); when every effect helps up to "
        f"{_si(force, 'N')}{turning}"
    )


def _swings(report: LogReport) -> str:
    best = max(report.swings, key=lambda test: test.log_bayes_factor)
    factor = (
        f"(log Bayes factor of a pendulum {fixed(best.log_bayes_factor, 0)}; evident from "
        f"{fixed(best.evident, 1)})"
    )
    if not report.something_swings:
        return f"nothing does {factor}"
    return (
        f"SOMETHING SWINGS, as {measure(best.mass, 'kg')} on {measure(best.length, 'm')} {factor}"
    )


def _effects(report: LogReport) -> list[str]:
    groups: dict[str, list[Answer]] = {}
    for answer in report.answers:
        groups.setdefault(answer.identifier, []).append(answer)
    if not groups:
        return []
    told = {n: a for n, a in groups.items() if any(x.verdict == YES for x in a)}
    never = {n: a for n, a in groups.items() if a[0].verdict == NEVER}
    lines = _row("can be told", "from this size (brackets: not)", "usual", "")
    lines += [line for name, answers in told.items() for line in _told(name, answers)]
    rest = {n: a for n, a in groups.items() if n not in told and n not in never}
    if rest:
        lines += _row("cannot be told", "but from this size", "usual", "why")
        for name, answers in rest.items():
            why = (
                "like " + answers[0].beside[0]
                if answers[0].reason.startswith("it cannot")
                else "no clear trace"
            )
            lines += _row(f"  {name}", _sizes(answers), number(answers[0].typical, 2), why)
        todo: dict[str, list[str]] = {}
        for name, answers in rest.items():
            todo.setdefault(answers[0].todo, []).append(name)
        lines += [
            line
            for what, names in list(todo.items())[:MOST_TODO]
            for line in _labelled("to fly", f"{what} ({', '.join(names)})")
        ]
    by_reason: dict[tuple[str, str], list[str]] = {}
    for name, answers in never.items():
        by_reason.setdefault((answers[0].reason, answers[0].todo), []).append(name)
    for (reason, what), names in by_reason.items():
        lines += _labelled("never", f"{', '.join(names)}: {reason}; {what}")
    return lines


def _told(name: str, answers: list[Answer]) -> list[str]:
    note = next((a.reason.split(":")[0] for a in answers if a.verdict == YES), "")
    return _row(f"  {name}", _sizes(answers), number(answers[-1].typical, 2), note)


def _sizes(answers: list[Answer]) -> str:
    told = any(a.verdict == YES for a in answers)
    shown = [_size(a, told=told, named=len(answers) > 1) for a in answers]
    return with_unit(", ".join(shown), answers[0].unit)


def _size(a: Answer, *, told: bool, named: bool) -> str:
    size = number(a.smallest, 2)
    text = f"{a.parameter.split('_')[-1]}{NBSP}{size}" if named else size
    return f"({text})" if told and a.verdict != YES else text


def _row(name: str, size: str, usual: str, note: str) -> list[str]:
    """Return the lines of a row; a size or a note that is too long goes on below."""
    sizes = wrapped(size, SIZE - 1)
    room = WIDTH - NAME - SIZE - USUAL
    first, *more = (
        wrapped(note, room) if len(note) <= room else ["", *wrapped(f"({note})", SIZE + USUAL)]
    )
    head = f"{name[: NAME - 1]:<{NAME}}{sizes[0]:<{SIZE}}{usual:<{USUAL}}{first}".rstrip()
    return [head, *(f"{'':<{NAME}}{line}" for line in (*sizes[1:], *more))]


def _si(value: float, unit: str) -> str:
    """Return a value with unit, in thousandths or millionths where it is small."""
    if unit == "1":
        return number(value, 2)
    scale, prefix = next(((s, p) for s, p in PREFIXES if value >= 0.1 * s), PREFIXES[-1])
    return f"{number(value / scale, 2)}{NBSP}{prefix}{unit}"
