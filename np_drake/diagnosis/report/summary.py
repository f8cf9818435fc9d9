"""Summary of a diagnosis: calibration, causes and next steps; for page and terminal alike."""

from np_drake.diagnosis.localisation.identifiability import manoeuvre
from np_drake.diagnosis.report.headline import named_causes
from np_drake.diagnosis.report.words import (
    bare_name,
    capital,
    estimate,
    listed,
    name_of,
    onset,
    plain_name,
    spread,
    unit_of,
)
from np_drake.diagnosis.result import Cause, Diagnosis
from np_drake.effects.library import effect_of
from np_drake.files.number_text import percent, probability

DIFFERENCE_HEADER = ["difference", "95 % interval", "healthy vehicles"]
MOST_DIFFERENCES = 8  # that are shown
LEAST_DIFFERENCE = (
    0.5  # of the standard deviation of healthy vehicles, below which none is shown [1]; own choice
)
SHOWN = 6  # columns of the table of causes that are always there
LOOSE = 0.5  # half-width of an interval over the value, above which it is loose [1]; own choice


def difference_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Return (what differs, its 95 % interval, the standard deviation of healthy vehicles), the
    largest first.
    """
    large = [d for d in diagnosis.calibration if d.in_deviations > LEAST_DIFFERENCE]
    return [(capital(d.text), *spread(d)) for d in large[:MOST_DIFFERENCES]]


def cause_table(diagnosis: Diagnosis, longest: int = 20) -> tuple[list[str], list[tuple[str, ...]]]:
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
        begins = [onset(t, plain_name(n, longest)) for n, t in cause.onset.items() if t is not None]
        last = [probability(cause.probability), percent(cause.held_out_gain)]
        last += ["\n".join(begins), "\n".join(cause.indistinguishable_from)]
        for k, (name, parameter) in enumerate(cause.parameters.items() or [("", None)]):
            shown = estimate(parameter, unit_of(cause, parameter)) if parameter else ("", "")
            rows.append(
                (cause.identifier, name, *shown, *last)
                if k == 0
                else ("", name, *shown, "", "", "", "")
            )
    keep = [k for k in range(len(header)) if k < SHOWN or any(row[k] for row in rows)]
    return [header[k] for k in keep], [tuple(row[k] for k in keep) for row in rows]


def unseen(diagnosis: Diagnosis) -> str:
    """Return which effects would leave no trace in the training flights at their usual size; empty:
    none.
    """
    alone = [
        item.effects[0]
        for item in diagnosis.identifiability.not_identifiable
        if len(item.effects) == 1
    ]
    names = listed([bare_name(name) for name in alone])
    return f"At its usual size the training flights would not show: {names}." if alone else ""


def warnings(diagnosis: Diagnosis) -> list[str]:
    """Return every warning once; what holds of several flights names them in one line."""
    flights_of: dict[str, list[str]] = {}
    for warning in dict.fromkeys((*diagnosis.identifiability.warnings, *diagnosis.warnings)):
        name, _, text = warning.partition(": ")
        known = name in diagnosis.train + diagnosis.held_out
        flights_of.setdefault(text if known else warning, []).extend([name] if known else [])
    return [f"{', '.join(names)}: {text}" if names else text for text, names in flights_of.items()]


def next_steps(diagnosis: Diagnosis) -> list[str]:
    """Return what to do next, the most useful first."""
    if diagnosis.cannot_tell:
        tried = [
            item.manoeuvre for item in diagnosis.identifiability.not_identifiable if item.manoeuvre
        ]
        return [
            (
                f"Fly with more motion in every "
                f"axis{f', such as: {tried[0]}' if tried else ''}. Diagnose again."
            )
        ]
    causes = named_causes(diagnosis)
    out = [
        f"To check {name_of(c.identifier)}: {check}."
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
        elif loose := _loose(cause):
            more = effect_of(cause.identifier).excited_by or "a longer one with more motion"
            out.append(
                f"Intervals of {cause.identifier} are wide ({listed(loose)}); a better "
                f"flight: {more}."
            )
    if any("not tested" in sentence for sentence in diagnosis.coverage):
        out.append("Hold out a flight that moves like the training flights.")
    if diagnosis.not_flyable:
        out.insert(0, f"Do not fly the corrected simulator: {diagnosis.not_flyable}.")
    elif causes:
        them = "it" if len(causes) == 1 else "them"
        out.append(
            f"Add {them} to the simulator with the values of the table, and diagnose new "
            f"flights with that."
        )
    return [capital(step) for step in out]


def _loose(cause: Cause) -> list[str]:
    """Return the parameters whose interval is wide, if the widest of the effect's values is one of
    them.
    """
    wide = {
        name: 0.5 * (p.ci95[1] - p.ci95[0]) > LOOSE * abs(p.value) > 0
        for name, p in cause.parameters.items()
    }
    alike = max((abs(p.value) for p in cause.parameters.values()), default=0.0)
    main = [name for name, p in cause.parameters.items() if abs(p.value) == alike]
    return [name for name in wide if wide[name]] if any(wide[name] for name in main) else []
