"""The one screen of `np-drake doctor`: lines of at most `WIDTH` columns from a report."""

import textwrap

from diagrams.cli.output import WIDTH
from np_drake.diagnosis.doctor.log_report import NEVER, YES, Answer, FlightFacts, LogReport
from np_drake.logs.importing.consistency import SCALE

NOTED = 3.0  # times its usual noise from which a signal's is noted as high [1]
SHOWN = 0.5  # share of repeated rows from which a signal's are noted [1]
LABEL, NAME, SIZE, USUAL = 14, 24, 38, 8  # widths of columns
MOST_FLIGHTS = 8  # that have a line of their own
MOST_TODO = 6  # manoeuvres that are named; --json has all
MOST_PROBLEMS = 4
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"))


def screen(report: LogReport) -> list[str]:
    """Return the lines of a report."""
    lines = [] if len(report.flights) == 1 else _flights(report)
    first = report.flights[0]
    head = first.name[:40] if len(report.flights) == 1 else f"{len(report.flights)} flights"
    verdict = "usable: no" if not report.usable else "usable: with limits" if report.problems else "usable: yes"
    title = head + (f", vehicle {report.vehicle[:20]}, {report.sensors} sensors" if report.sensors else "")
    body = [f"{title}{verdict:>{max(2, WIDTH - len(title))}}"]
    for problem in report.problems[:MOST_PROBLEMS]:
        body += _labelled("!", problem)
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


def _labelled(label: str, text: str) -> list[str]:
    """Return a text behind its label, in two lines at most."""
    if not text:
        return []
    wrapped = textwrap.wrap(text, WIDTH - LABEL, max_lines=2, placeholder=" …")
    return [f"  {label if i == 0 else '':<{LABEL - 2}}{line}" for i, line in enumerate(wrapped)]


def _flights(report: LogReport) -> list[str]:
    tests = {test.flight: test for test in report.swings}
    lines = []
    for f in report.flights[:MOST_FLIGHTS]:
        test = tests.get(f.name)
        swings = "" if test is None else f", swings: {'yes' if test.swings else 'no'} ({test.log_bayes_factor:.0f})"
        lines.append(f"  {f.name[:40]:<41}{f.duration:.3g} s at {1 / f.step:.3g} Hz, {_gaps(f)}{swings}"[:WIDTH])
    if len(report.flights) > MOST_FLIGHTS:
        lines.append(f"  … and {len(report.flights) - MOST_FLIGHTS} more (--json has all)")
    return lines


def _facts(f: FlightFacts) -> list[str]:
    lines = _labelled("rows", f"{f.duration:.3g} s, {f.rows} rows at {1 / f.step:.3g} Hz, {_gaps(f)}")
    timing = f", its time known to {1e3 * f.timing:.2g} ms" if f.timing else ""
    lines += _labelled(
        "input",
        f"{f.input}{timing}"
        + ("" if f.saturated is None else f"; a rotor at its limit in {f.saturated:.0%} of the rows"),
    )
    sheet = f.imported
    if sheet:
        slow = [f"{name} {entry['rate']}" for name, entry in sheet["columns"].items()]
        lines += _labelled("import", f"{sheet['format']}: {', '.join(slow)}")
    return lines + _labelled("conventions", _conventions(f))


def _gaps(f: FlightFacts) -> str:
    gaps = f"{f.gaps} gap{'s' * (f.gaps != 1)} up to {f.longest:.2g} s" if f.gaps else "no gaps"
    return gaps + (f", {f.bridged} rows bridged" if f.bridged else "")


def _conventions(f: FlightFacts) -> str:
    if not f.misfits:
        return "not checked: too short, or no two quantities can be compared"
    worst = max(f.misfits, key=lambda law: f.misfits[law])
    own = f"{f.imported['frames'].split(';')[0]}; " if f.imported else ""
    return f"{own}{len(f.misfits)} checks, worst misfit {f.misfits[worst]:.2g} ({worst}; {SCALE})"


def _noise(f: FlightFacts) -> str:
    parts = []
    for s in f.signals:
        notes = []
        if s.usual and s.white > NOTED * s.usual:
            notes.append(f"usual {_si(s.usual, s.unit)}")
        if s.repeated > SHOWN:
            notes.append(f"{s.repeated:.0%} of the rows repeat")
        if s.resolution > s.white:
            notes.append(f"rounded to {_si(s.resolution, s.unit)}")
        parts.append(f"{s.name} {_si(s.white, s.unit)}" + (f" ({', '.join(notes)})" if notes else ""))
    return ", ".join([*parts, f"attitude {_si(f.attitude_noise, 'rad')}"]) + ", white, per row"


def _clocks(f: FlightFacts) -> str:
    return (
        "; ".join(
            f"{lag.late} {1e3 * lag.seconds:+.1f} ± {1e3 * lag.deviation:.1f} ms after {lag.early}" for lag in f.lags
        )
        or "no two signals move alike enough to tell their lag"
    )


def _motion(report: LogReport) -> str:
    every = [f.motion for f in report.flights]
    m = report.excitation
    own = every[0] | m
    fastest = max(motion["fastest [m/s]"] for motion in every)
    text = (
        f"speed {own['speed [m/s]']:.2g} m/s (at most {fastest:.2g}), rates {own['rate [rad/s]']:.2g} rad/s, "
        f"tilt {own['tilt [deg]']:.2g} deg, height from {min(x['lowest [m]'] for x in every):.2g} m over "
        f"{own['height span [m]']:.2g} m"
    )
    return text + (f"; thrust varies by {m['thrust variation [1]']:.1%}" if m else "")


def _residual(report: LogReport) -> str:
    floor, shares = report.noise_floor, [100 * value for value in report.residual_force.values()]
    force = max(floor[f"force {axis}"] for axis in "xyz")
    torques = [floor[f"torque {axis}"] for axis in "xyz"]
    turning = f", torque up to {_si(max(torques), 'N·m')}" if max(torques) > 0 else ", torque not known"
    before = ", ".join(f"{share:.1f}" for share in shares)
    return f"force x, y, z {before} % of weight (RMS); when every effect helps up to {_si(force, 'N')}{turning}"


def _swings(report: LogReport) -> str:
    best = max(report.swings, key=lambda test: test.log_bayes_factor)
    factor = f"(log Bayes factor of a pendulum {best.log_bayes_factor:.0f}; evident from {best.evident:.1f})"
    if not report.something_swings:
        return f"nothing does {factor}"
    return f"SOMETHING SWINGS, as {_si(1e3 * best.mass, 'g')} on {best.length:.2g} m {factor}"


def _effects(report: LogReport) -> list[str]:
    groups: dict[str, list[Answer]] = {}
    for answer in report.answers:
        groups.setdefault(answer.identifier, []).append(answer)
    if not groups:
        return []
    told = {n: a for n, a in groups.items() if any(x.verdict == YES for x in a)}
    never = {n: a for n, a in groups.items() if a[0].verdict == NEVER}
    lines = [_row("can be told", "from this size on, 99.7 % (in brackets: not)", "usual", "")]
    lines += [_told(name, answers) for name, answers in told.items()]
    rest = {n: a for n, a in groups.items() if n not in told and n not in never}
    if rest:
        lines.append(_row("cannot be told", "but from this size on", "usual", "why"))
        for name, answers in rest.items():
            why = "like " + answers[0].beside[0] if answers[0].reason.startswith("it cannot") else "no clear trace"
            lines.append(_row(f"  {name}", _sizes(answers), f"{answers[0].typical:.2g}", why))
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


def _told(name: str, answers: list[Answer]) -> str:
    note = next((a.reason.split(":")[0] for a in answers if a.verdict == YES), "")
    return _row(f"  {name}", _sizes(answers), f"{answers[-1].typical:.2g}", note)


def _sizes(answers: list[Answer]) -> str:
    told = any(a.verdict == YES for a in answers)
    shown = [_size(a, told=told, named=len(answers) > 1) for a in answers]
    return f"{', '.join(shown)} {answers[0].unit if answers[0].unit != '1' else ''}".rstrip()


def _size(a: Answer, *, told: bool, named: bool) -> str:
    size = f"{a.smallest:.2g}" if a.smallest < float("inf") else "–"
    text = f"{a.parameter.split('_')[-1]} {size}" if named else size
    return f"({text})" if told and a.verdict != YES else text


def _row(name: str, size: str, usual: str, note: str) -> str:
    return f"{name:<{NAME}} {size:<{SIZE}} {usual:<{USUAL}}{note}".rstrip()[:WIDTH]


def _si(value: float, unit: str) -> str:
    """Return a value with unit, in thousandths or millionths where it is small."""
    if unit == "1":
        return f"{value:.2g}"
    for scale, prefix in PREFIXES:
        if value >= 0.1 * scale or scale == PREFIXES[-1][0]:
            return f"{value / scale:.2g} {prefix}{unit}"
    return f"{value:.2g} {unit}"
