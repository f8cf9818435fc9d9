"""Answer of a diagnosis in words: names and numbers, headline, causes, calibration, remainder."""

import math
import re
import string
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.decision import unexplained
from np_drake.diagnosis.gap import CANNOT_TELL, manoeuvre
from np_drake.diagnosis.result import (
    UNKNOWN,
    Cause,
    Diagnosis,
    Estimate,
    GapReduction,
    Remainder,
    ResidualFinding,
    gap_kinds,
)
from np_drake.effects.base import Effect, departure
from np_drake.effects.library import effect_of
from np_drake.files.number_text import (
    NBSP,
    NOTHING,
    departure_unit,
    fixed,
    grouped,
    measure,
    number,
    of_at_least,
    percent,
    probability,
    suited,
    with_unit,
)


def name_of(identifier: str) -> str:
    """Return the name of an effect with its article; of what is none, the words of its
    identifier.
    """
    if identifier == UNKNOWN:
        return "something unknown"
    effect = effect_of(identifier)
    return identifier.replace("_", " ") if effect is Effect else effect.title()


def bare_name(identifier: str) -> str:
    """Return the name of an effect without its article."""
    return name_of(identifier).removeprefix("a ").removeprefix("an ").removeprefix("the ")


def capital(text: str) -> str:
    """Return the text with a capital at its beginning."""
    return text[:1].upper() + text[1:]


def listed(names: Sequence[str], last: str = "and") -> str:
    """Join names as in 'x', 'x and y', 'x, y and z'."""
    return f" {last} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def flights(count: int) -> str:
    """Return 'the held-out flight' or 'the held-out flights'."""
    return f"the held-out flight{'s' if count != 1 else ''}"


def unit_of(cause: Cause, parameter: Estimate) -> str:
    """Return the unit of a parameter: shares for factors, '1' where it has none."""
    return (
        "share"
        if parameter.unit == "1" and effect_of(cause.identifier).shares
        else parameter.unit or "1"
    )


def estimate(parameter: Estimate, unit: str, *, brief: bool = False) -> tuple[str, str]:
    """Return value and 95 % interval as text, in a unit that suits them and with the digits that
    the interval tells.

    Args:
        unit: of the parameter, as `unit_of` gives it.
    """
    lower, upper = parameter.ci95
    half = parameter.half
    if half == 0 and parameter.unit in ("", "1") and parameter.value == round(parameter.value):
        return str(round(parameter.value)), NOTHING  # a choice, such as the number of a rotor
    if not (math.isfinite(half) and half > 0):
        return measure(parameter.value, unit), NOTHING
    largest = max(abs(parameter.value), abs(lower), abs(upper))
    factor, shown = suited(largest, unit)
    significant = -math.floor(math.log10(0.5 * factor * half))
    if significant > 6:
        return measure(
            parameter.value, unit, 3
        ), f"{number(factor * lower)} to {number(factor * upper)}"
    three = 2 - math.floor(math.log10(factor * largest))
    decimals = max(
        min(significant, three) if brief or 10.0**-three <= factor * half else significant, 0
    )
    value, low, high = (fixed(factor * v, decimals) for v in (parameter.value, lower, upper))
    return with_unit(value, shown), f"{low} to {high}"


def phrase(cause: Cause) -> str:
    """Return a cause with its size in few words, as in 'a 4.8 g payload on 0.52 m'."""
    name = name_of(cause.identifier)
    parameters = cause.parameters
    values = {n: estimate(p, unit_of(cause, p), brief=True)[0] for n, p in parameters.items()}
    values |= {"rotor": str(cause.rotor)} if cause.rotor else {}
    unit, *others = {p.unit for p in parameters.values()} or {""}
    template = effect_of(cause.identifier).phrase
    if template and {
        field for _, field, _, _ in string.Formatter().parse(template) if field
    } <= set(values):
        later = listed(_changes(cause), "then")
        return template.format(**values) + (f" ({later})" if later else "")
    if len(values) == 1:
        return f"{name} of {next(iter(values.values()))}"
    if others or unit in ("", "1"):
        return name
    sizes = [p.value for p in parameters.values()]
    if set(parameters) == set("xyz") or "roll" in parameters:
        return f"{name} of {measure(math.hypot(*sizes), unit)}"
    return f"{name} of up to {measure(max(sizes, key=abs), unit)}"


def _changes(cause: Cause, flight: str = "") -> list[str]:
    """Return the changes of a payload's mass, as in '+250 g at 7.0 s' and 'dropped at 13.0 s'; in
    no flight, without their times.
    """
    changes = []
    mass = cause.parameters["mass"].value if cause.loads else 0.0
    steps = cause.steps(flight) if flight else [(math.inf, load) for load in cause.loads]
    for time, load in steps:
        size = load.value - mass
        mass = load.value
        sign = "+" if size > 0 else "−"
        what = f"{sign}{measure(abs(size), 'kg', 3)}" if mass else "dropped"
        changes.append(what + (f" at {time:.1f}{NBSP}s" if math.isfinite(time) else ""))
    return changes


def begins(cause: Cause, longest: int = 36) -> list[str]:
    """Return by flight when a cause begins and a payload's mass changes, where it does."""
    lines = []
    for flight, time in cause.onset.items():
        when = "" if time is None else f"{time:.1f}{NBSP}s" if math.isfinite(time) else "not at all"
        if later := _changes(cause, flight):
            mass = measure(cause.parameters["mass"].value, "kg", 3)
            when = ", ".join([mass + (f" at {when}" if when else ""), *later])
        if when:
            lines.append(f"{plain_name(flight, longest)}: {when}")
    return lines


def changed(cause: Cause) -> str:
    """Return what changed, with its 95 % interval where it is one number."""
    effect = effect_of(cause.identifier)
    free = [p for p in effect.parameters if not p.choices]
    if cause.effect is None or len(free) != 1 or not free[0].departure:
        return phrase(cause)
    p = free[0]
    one = cause.parameters[free[0].name]
    unit, text = departure(p, one.value - p.neutral, cause.rotor, shares=effect.shares)
    factor, shown = departure_unit(unit)
    low, high = (measure(factor * (end - p.neutral), shown) for end in one.ci95)
    return f"{text} ({low} to {high})"


def described(finding: ResidualFinding) -> str:
    """Return what a finding says, with the figures that its text leaves out."""
    text = finding.text.rstrip(".")
    figures = finding.figures
    more = []
    if "frequency" in figures and "Hz" not in text:
        more.append(f"near {measure(figures['frequency'], 'Hz')}")
    if "time" in figures and " s" not in text:
        more.append(f"at {figures['time']:.1f}{NBSP}s")
    if "share" in figures:
        more.append(f"{percent(figures['share'])} of weight")
    elif figures.get("force") and not re.search(rf"\d[ {NBSP}][mµ]?N\b", text):
        more.append(f"{measure(figures['force'], 'N')} RMS")
    elif figures.get("torque"):
        more.append(f"{measure(figures['torque'], 'N·m')} RMS")
    return ", ".join([text, *more])


def plain_name(name: str, longest: int = 36) -> str:
    """Return a file name for a figure, with characters that fonts lack replaced, and shortened to
    `longest`.
    """
    shown = "".join(sign if sign.isprintable() and ord(sign) < 0x250 else "?" for sign in name)
    return shown if len(shown) <= longest else f"{shown[: longest - 10]}…{shown[-9:]}"


GAP_HEADER = ["held-out residual, RMS", "nominal", "with causes", "noise", "left"]


def gap_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Return (kind, before, after, noise, left) of each kind of gap, and of all channels in noise
    units.
    """
    rows = []
    for part in gap_kinds(diagnosis.localisation.channels):
        factor, unit = suited(part.before, part.unit)
        sizes = [number(factor * value, 2) for value in (part.before, part.after, part.noise)]
        rows.append((f"{part.kind} [{unit}]", *sizes, percent(part.remaining)))
    total = diagnosis.gap_reduction
    share = NOTHING
    sizes = [number(value, 2) for value in (total.before, total.after, total.floor)]
    if total.material:
        low, high = total.ci95
        least, most = (percent(min(1 - end, 1.0)) for end in (high, low))
        share = f"{percent(total.remainder.share)} ({least.removesuffix(NBSP + '%')} to {most})"
    return [*rows, ("all, over noise [1]", *sizes, share)]


def sizes_left(remainder: Remainder) -> str:
    """Return the remainder's force, torque and position error, as in '1.5 mN, 20 µN·m and 3 cm
    after 1 s', and how far noise alone leads where that is farther.
    """
    sizes = [
        measure(size, unit)
        for size, unit in ((remainder.force, "N"), (remainder.torque, "N·m"))
        if size > 0
    ]
    after = f"after 1{NBSP}s"
    sizes += (
        [f"{measure(remainder.position, 'm')} {after}"] if math.isfinite(remainder.position) else []
    )
    hides = 0 < remainder.noise < math.inf and not remainder.position > remainder.noise
    alone = (
        f", beside up to {measure(remainder.noise, 'm')} {after} by noise alone" if hides else ""
    )
    return f"{listed(sizes) or 'nothing'}{alone}"


def remains(diagnosis: Diagnosis) -> str:
    """Return how much of the held-out gap is left, and the probability that it is material."""
    remainder = diagnosis.gap_reduction.remainder
    if not diagnosis.gap_reduction.material:
        return (
            f"The held-out gap is immaterial: {measure(remainder.position_before, 'm')} after "
            f"1{NBSP}s, beyond the noise."
        )
    least = unexplained.NOTHING
    below = f" (immaterial below {percent(least)})" if remainder.share < least else ""
    sentence = f"{percent(remainder.share)} of the held-out gap is left beyond the noise{below}"
    return (
        f"{sentence}: {sizes_left(remainder)}. Probability that this is material: "
        f"{probability(remainder.probability)}."
    )


CONTRADICTED = -0.02  # held-out gain below which flights contradict a cause [1]; own choice
# residual with the causes over that without, and over noise, from which it grows [1]; own choice
GROWN = 1.1
MOST_NAMED = 3  # causes in the headline; the table has all
PLAIN_GAIN = 1.1  # ratio of errors of the replay from which it is better or worse [1]; own choice


def headline(diagnosis: Diagnosis) -> str:
    """Return the answer in one sentence: the causes, their share of the whole gap, and what the
    replay makes of it.

    At most `MOST_NAMED` causes are named, those with the largest share of the gap. Where the
    held-out flights show no material gap, that is the answer, and nothing is named.
    """
    if diagnosis.cannot_tell:
        return CANNOT_TELL
    reduction = diagnosis.gap_reduction
    judges = _judges(diagnosis)
    remainder = reduction.remainder
    sizes = sizes_left(remainder)
    unknown = UNKNOWN in diagnosis.verdict
    causes = named_causes(diagnosis)
    first = causes[:MOST_NAMED]
    more = [f"{len(causes) - len(first)} more"] if len(causes) > len(first) else []
    if diagnosis.before:
        since = f"since the flight{'s' if len(diagnosis.before) > 1 else ''} before"
        left_over = (
            f"; {percent(remainder.share)} of the gap on {judges} remains unexplained"
            if unknown
            else ""
        )
        if not causes:
            return (
                f"Nothing changed {since} that these flights would show: {seen(diagnosis)} "
                f"would{left_over}"
            )
        named = [*(changed(c) + _or_else(c) for c in first), *more]
        # What the balance of rotors alone tells explains nothing of the gap.
        acts = reduction.material and any(np.isfinite(c.held_out_gain) for c in causes)
        explained = f"; {_explained(diagnosis, causes, ['this'])}" if acts else ""
        return f"Changed {since}: {listed(named)}{explained}{left_over}"
    if not reduction.material:
        return f"There is no material gap on {judges}"
    if causes:
        text = capital(_explained(diagnosis, causes, [*map(phrase, first), *more]))
        rest = (
            f"; {percent(remainder.share)} remains unexplained: {sizes} (probability that it is "
            f"material {probability(remainder.probability)})"
        )
        return text + rest * unknown
    if unknown:
        return (
            f"No effect explains what is left on {judges} "
            f"({probability(diagnosis.unknown_probability)}): {sizes}"
        )
    calibrated = "with calibration, " if diagnosis.calibration else ""
    return f"Nothing material is missing: {calibrated}the remainder on {judges} is {sizes}"


def _or_else(cause: Cause) -> str:
    """Return what else may be the cause; empty where the flights tell it."""
    others = [name_of(name) for name in cause.indistinguishable_from]
    return f" or {listed(others, 'or')}, which these flights do not tell apart" if others else ""


def _explained(diagnosis: Diagnosis, causes: Sequence[Cause], names: Sequence[str]) -> str:
    """Return the names of causes as subject, what flights contradict, the share of the gap, and
    whether the replay improves.
    """
    names = [*names, *(["calibration"] if diagnosis.calibration else [])]
    one = len(names) == 1
    share = diagnosis.gap_reduction.fraction
    judges = _judges(diagnosis)
    if share < 0:
        return f"{listed(names)} {'does' if one else 'do'} not help: the gap on {judges} grows"
    text = f"{listed(names)} explain{'s' if one else ''} {percent(share)} of the gap on {judges}"
    against = [bare_name(c.identifier) for c in causes if c.held_out_gain < CONTRADICTED]
    if against:
        text += (
            f", which {'is' if len(diagnosis.held_out) == 1 else 'are'} predicted better "
            f"without {listed(against)}"
        )
    kinds = gap_kinds(diagnosis.localisation.channels)
    if grown := [p.kind for p in kinds if p.after > GROWN * max(p.before, p.noise)]:
        text += f" and make{'s' if one else ''} {listed(grown)} worse"
    return text + _replayed(diagnosis.gap_reduction)


def _replayed(reduction: GapReduction) -> str:
    """Return how the position error of the replay changes at its last horizon; empty where it was
    not made.
    """
    before = reduction.replay_before
    after = reduction.replay_after
    if before is None or after is None:
        return ""
    was = float(before.position[-1, 0])
    now = float(after.position[-1, 0])
    horizon = f"after {before.horizon[-1]:g}{NBSP}s"
    if not np.isfinite(now):
        return f"; the corrected simulator loses the vehicle {horizon}"
    if not np.isfinite(was):
        return f"; the replay, lost until now, is off by {measure(now, 'm')} {horizon}"
    if now < was / PLAIN_GAIN:
        return f"; the replay improves from {measure(was, 'm')} to {measure(now, 'm')} {horizon}"
    worse = "gets worse" if now > PLAIN_GAIN * was else "does not improve"
    return f"; the replay {worse} ({measure(was, 'm')} to {measure(now, 'm')} {horizon})"


def _judges(diagnosis: Diagnosis) -> str:
    return f"{'the second half of ' if diagnosis.joined else ''}{flights(len(diagnosis.held_out))}"


def lead(diagnosis: Diagnosis) -> str:
    """Return what stands below the headline: probabilities, what remains, and what the second
    answer adds.
    """
    if diagnosis.cannot_tell:
        return "The training flights excite too little to tell one effect from another."
    causes = named_causes(diagnosis)
    sentences = []
    unknown = UNKNOWN in diagnosis.verdict
    traces = diagnosis.unexplained
    if causes and diagnosis.gap_reduction.material:
        least = min(cause.probability for cause in causes)
        one = f"probability {probability(least)}"
        sentences.append(
            one if len(causes) == 1 else f"each has a probability {of_at_least(least)}"
        )
        if diagnosis.before:
            there = listed([bare_name(c.identifier) for c in diagnosis.causes if not c.changed])
            sentences.append(
                f"{seen(diagnosis)} would have been seen"
                + (f"; there already before: {there}" if there else "")
            )
    elif causes:
        them = listed([bare_name(c.identifier) for c in causes])
        sentences.append(f"training names {them}, which these flights do not need")
    elif not unknown:
        sentences.append("the simulator agrees with the logs, and nothing is named")
    if unknown and traces:
        # That with the largest share of weight, else with the largest force, else the first.
        main = max(traces, key=lambda f: (f.figures.get("share", 0.0), f.figures.get("force", 0.0)))
        sentences.append(f"to find what remains: {main.measurement}")
    elif unknown:
        sentences.append("it has no trace of its own")
    if diagnosis.new_on_held_out:
        sentences.append(
            f"new on {_judges(diagnosis)}: {diagnosis.new_on_held_out[0].text.rstrip('.')}"
        )
    if diagnosis.refit is not None and diagnosis.refit.verdict != diagnosis.verdict:
        sentences.append(
            "a second answer, which knows halves of the held-out flights, differs: see below"
        )
    return capital("; ".join(sentences)) + "."


def seen(diagnosis: Diagnosis) -> str:
    """Return the smallest changes of a mass and a rotor that these flights would show."""
    masses, rotors = (
        [size for name, size in diagnosis.visible.items() if name.startswith(effect)]
        for effect in ("mass_error", "weak_rotor")
    )
    sizes = [*(measure(v, "kg", 2) for v in masses), *(f"{percent(v)} of a rotor" for v in rotors)]
    return f"at least {listed(sizes, 'or')}" if sizes else "larger ones"


def named_causes(diagnosis: Diagnosis) -> list[Cause]:
    """Return the causes of the verdict, the one with the largest share of the gap first."""
    named = [cause for cause in diagnosis.causes if cause.identifier in diagnosis.verdict]
    return sorted(named, key=lambda cause: -np.nan_to_num(cause.share))


DIFFERENCE_HEADER = ["difference", "95 % interval", "healthy vehicles"]
MOST_DIFFERENCES = 8  # that are shown
# of the standard deviation of healthy vehicles, below which none is shown [1]; own choice
LEAST_DIFFERENCE = 0.5
SHOWN = 6  # columns of the table of causes that are always there


def difference_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Return (what differs, its 95 % interval, the standard deviation of healthy vehicles), the
    largest first.
    """
    rows = []
    large = [d for d in diagnosis.calibration if d.in_deviations > LEAST_DIFFERENCE]
    for d in large[:MOST_DIFFERENCES]:
        factor, unit = departure_unit(d.unit)
        sizes = (0.5 * (d.ci95[1] - d.ci95[0]), d.deviation)
        shown = (f"±{NBSP}{measure(factor * s, unit)}" if s == s else NOTHING for s in sizes)
        rows.append((capital(d.text), *shown))
    return rows


LONGEST_NAME = 20  # of a flight in a column of the table [characters]


def cause_table(diagnosis: Diagnosis) -> tuple[list[str], list[tuple[str, ...]]]:
    """Return header and rows of the causes, a row for every parameter; the first has what is of the
    whole cause.

    When an effect begins, and what it cannot be told from, are columns only where there is such a
    thing to say.
    """
    header = [
        "cause",
        "parameter",
        "value",
        "95 % interval",
        "probability",
        "held-out gain",
        "begins",
        "or else",
    ]
    rows: list[tuple[str, ...]] = []
    for cause in named_causes(diagnosis):
        last = [probability(cause.probability), percent(cause.held_out_gain)]
        last += ["\n".join(begins(cause, LONGEST_NAME)), "\n".join(cause.indistinguishable_from)]
        for k, (name, parameter) in enumerate(cause.parameters.items() or [("", None)]):
            shown = estimate(parameter, unit_of(cause, parameter)) if parameter else ("", "")
            if name == "rotor" and cause.rotor:
                called = ", ".join(filter(None, (cause.rotor.place, cause.rotor.log)))
                shown = f"{shown[0]}: {called}", NOTHING
            rows.append(
                (cause.identifier, name, *shown, *last)
                if k == 0
                else ("", name, *shown, "", "", "", "")
            )
    keep = [k for k in range(len(header)) if k < SHOWN or any(row[k] for row in rows)]
    return [header[k] for k in keep], [tuple(row[k] for k in keep) for row in rows]


def warnings(diagnosis: Diagnosis) -> list[str]:
    """Return every warning once, but for what is said before the answer; what holds of several
    flights names them in one line.
    """
    lines = grouped(
        (*diagnosis.identifiability.warnings, *diagnosis.warnings),
        diagnosis.train + diagnosis.held_out,
    )
    return [line for line in lines if line.rstrip(".") not in diagnosis.doubts]


def next_steps(diagnosis: Diagnosis) -> list[str]:
    """Return what to do next, the most useful first."""
    if diagnosis.cannot_tell:
        return ["Fly with more motion in every axis, as np-drake fly multisine does."]
    causes = named_causes(diagnosis)
    out = [
        f"To check {f'the {c.rotor}' if c.rotor else name_of(c.identifier)}: {check}."
        for c in causes
        if (check := effect_of(c.identifier).bench_check)
    ]
    for cause in causes:
        others = cause.indistinguishable_from
        if others:
            between = (
                f"{name_of(cause.identifier)} from {listed([name_of(o) for o in others], 'or')}"
            )
            how = manoeuvre((cause.identifier, *others)).rstrip(".")
            out.append(f"To tell {between}, fly: {how}; or np-drake fly multisine.")
    if diagnosis.not_flyable:
        out.insert(0, f"Do not fly the corrected simulator: {diagnosis.not_flyable}.")
    elif causes:
        them = "it" if len(causes) == 1 else "them"
        out.append(
            f"Add {them} to the simulator with the values of the table, and diagnose new "
            f"flights with that."
        )
    return [capital(step) for step in out]
