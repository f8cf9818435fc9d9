"""Verdict in two sentences: what is missing, and how far adding it closes the gap."""

from np_drake.diagnosis.report.words import (
    NBSP,
    estimate,
    listed,
    name_of,
    number,
    percent,
    percent_interval,
    probability,
    unit_of,
)
from np_drake.diagnosis.result import UNKNOWN, Cause, Diagnosis, GapReduction

PLAIN_GAP = (
    1.4  # residual over its floor above which a simulator does not agree with the logs [1]; own choice
)
LEAST_GAP = 1.05  # residual over its floor below which a share of the gap has no meaning [1]; own choice


def verdict_sentences(diagnosis: Diagnosis) -> tuple[str, str]:
    """Return two sentences: what is missing, and how far adding it closes the gap or what to do next."""
    if diagnosis.cannot_tell:
        return _cannot_tell(diagnosis)
    named = [cause for cause in diagnosis.causes if cause.identifier in diagnosis.verdict]
    if UNKNOWN in diagnosis.verdict:
        return _partly_known(diagnosis, named) if named else _unknown(diagnosis)
    return _named(diagnosis, named) if named else _nothing(diagnosis)


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in a few words."""
    if diagnosis.cannot_tell:
        return "These logs cannot tell"
    if not diagnosis.verdict:
        return "No cause is told" if _unexplained(diagnosis.shrink) else "Nothing material is missing"
    names = listed([name_of(identifier) for identifier in diagnosis.verdict])
    return f"Missing: {names}"


def _cannot_tell(diagnosis: Diagnosis) -> tuple[str, str]:
    first = "These logs cannot tell what the simulator lacks: they excite too little of it."
    manoeuvres = list(
        dict.fromkeys(item.manoeuvre for item in diagnosis.check.not_identifiable if item.manoeuvre)
    )
    if not manoeuvres:
        return first, "Fly with more motion in every axis, and diagnose again."
    return first, f"What would tell: {manoeuvres[0].rstrip('.')}."


def _nothing(diagnosis: Diagnosis) -> tuple[str, str]:
    reduction = diagnosis.shrink
    residual = f"{number(reduction.before, 2)} times the noise"
    if _unexplained(reduction):
        first = (
            "No effect of the library, and no structure, is told in what is left, "
            f"which is {residual} of the training flights."
        )
        second = "The flights that judge are noisier, or differ in what the training flights do not excite"
    else:
        first = "Nothing material is missing: on flights it has not seen, the simulator agrees with the logs."
        second = f"What is left is {residual}, where noise alone would give {number(reduction.floor, 2)}"
    minor = len(diagnosis.minor)
    return first, second + (f"; {minor} minor finding{'s' * (minor > 1)} below." if minor else ".")


def _named(diagnosis: Diagnosis, causes: list[Cause]) -> tuple[str, str]:
    first = f"The simulator lacks {listed([_with_figures(cause, len(causes)) for cause in causes])}."
    return first, _closes(diagnosis, "Adding it" if len(causes) == 1 else "Adding them") + "."


def _partly_known(diagnosis: Diagnosis, causes: list[Cause]) -> tuple[str, str]:
    known = listed([_with_figures(cause, len(causes) + 1) for cause in causes])
    first = (
        f"The simulator lacks {known}, and something else that no effect of the library explains "
        f"(probability {probability(diagnosis.unknown_probability)})."
    )
    added = "it" if len(causes) == 1 else "them"
    return first, _closes(diagnosis, f"Adding {added}") + "; what remains is described below."


def _unknown(diagnosis: Diagnosis) -> tuple[str, str]:
    first = (
        "Something is missing that no effect of the library explains "
        f"(probability {probability(diagnosis.unknown_probability)})."
    )
    if not diagnosis.remains:
        return first, f"The residual is {number(diagnosis.shrink.before, 2)} times the noise."
    return first, f"Its clearest trace: {diagnosis.remains[0].text.rstrip('.')}."


def _with_figures(cause: Cause, count: int) -> str:
    """Return the cause with its probability and, where it has few, its parameters."""
    details = _figures(cause) if len(cause.parameters) == 1 or count == 1 else []
    details.append(f"probability {probability(cause.probability)}")
    others = [name_of(other) for other in cause.indistinguishable_from]
    if others:
        details.append(f"these logs cannot tell it from {listed(others, 'or')}")
    return f"{name_of(cause.identifier)} ({'; '.join(details)})"


def _figures(cause: Cause) -> list[str]:
    """Return the text of up to three parameters, with the interval where there is only one."""
    if len(cause.parameters) > 3:
        return []
    shown = []
    for name, parameter in cause.parameters.items():
        value, bounds = estimate(parameter)
        unit = unit_of(parameter.unit)
        text = f"{name} {value}{NBSP * bool(unit)}{unit}"
        shown.append(f"{text}, 95{NBSP}% interval {bounds}" if len(cause.parameters) == 1 else text)
    return [", ".join(shown)]


def _unexplained(reduction: GapReduction) -> bool:
    """Return whether the held-out residual is too large for the simulator to agree with the logs."""
    return reduction.before > PLAIN_GAP * reduction.floor


def has_gap(reduction: GapReduction) -> bool:
    """Return whether the held-out residual exceeds the noise enough for a closed fraction to have meaning."""
    return reduction.before > LEAST_GAP * reduction.floor


def _closes(diagnosis: Diagnosis, subject: str) -> str:
    reduction = diagnosis.shrink
    judges = f"{'the second half of ' if diagnosis.joined else ''}held-out flights"
    change = f"from {number(reduction.before, 2)} to {number(reduction.after, 2)} times the noise"
    adding = subject[:1].lower() + subject[1:]
    if not has_gap(reduction):
        return f"{judges.capitalize()} have no gap above the noise to close: {adding} takes the residual {change}"
    if reduction.fraction < 0:
        return f"On {judges} {adding} does not help: the residual goes {change}"
    return (
        f"{subject} closes {percent(min(reduction.fraction, 1.0))} of the gap on {judges} "
        f"(95{NBSP}% interval {percent_interval(reduction.ci95)}): {change}"
    )
