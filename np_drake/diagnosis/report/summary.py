"""Summary of a diagnosis: causes, gap by kind and next steps; for page and terminal alike."""

import dataclasses as dc

import numpy as np

from np_drake.diagnosis.localisation.identifiability import manoeuvre
from np_drake.diagnosis.report.headline import LEAST_GAP, has_gap, main_remainder, named_causes
from np_drake.diagnosis.report.words import (
    bare_name,
    capital,
    described,
    estimate,
    listed,
    name_of,
    onset,
    percent_interval,
    plain_name,
    suited,
    unit_of,
)
from np_drake.diagnosis.result import UNKNOWN, Cause, Diagnosis, Localisation
from np_drake.effects.library import effect_of
from np_drake.files.number_text import NOTHING, number, percent, probability

KINDS = {"lateral force": ("force x", "force y"), "lift": ("force z",), "torque": ("torque x", "torque y", "torque z")}
GAP_HEADER = ["held-out residual, RMS", "nominal", "with causes", "noise", "explained"]
LOOSE = 0.5  # half-width of an interval over the value, above which it is loose [1]; own choice


@dc.dataclass(frozen=True)
class GapPart:
    """Held-out residual of one kind, RMS of its vector: before and after the causes, and of noise [unit].

    explained: share of the square above the noise that the causes take away [1]; NaN where there is hardly a gap.
    """

    kind: str
    unit: str
    before: float
    after: float
    noise: float
    explained: float


def gap_parts(localisation: Localisation) -> list[GapPart]:
    """Return the held-out gap in lateral force, lift and torque, each pooled over its body axes."""
    out = []
    for kind, names in KINDS.items():
        channels = [c for c in localisation.channels if c.channel in names]
        sizes = [[c.rms, c.after, c.noise_floor] for c in channels]
        before, after, noise = np.sqrt(np.sum(np.square(sizes), axis=0)) if channels else (0.0, 0.0, 0.0)
        if noise > 0 and before > 0:
            share = 1 - (after**2 - noise**2) / (before**2 - noise**2) if before > LEAST_GAP * noise else np.nan
            explained = float(np.clip(share, -1.0, 1.0))
            out.append(GapPart(kind, channels[0].unit, float(before), float(after), float(noise), explained))
    return out


def gap_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Return (kind, before, after, noise, explained) of each kind of gap, and of all channels in noise units."""
    rows = []
    for part in gap_parts(diagnosis.localisation):
        factor, unit = suited(part.before, part.unit)
        sizes = [number(factor * value, 2) for value in (part.before, part.after, part.noise)]
        rows.append((f"{part.kind} [{unit}]", *sizes, percent(part.explained)))
    total = diagnosis.gap_reduction
    sizes = [number(value, 2) for value in (total.before, total.after, total.floor)]
    share = f"{percent(total.fraction)} ({percent_interval(total.ci95)})" if has_gap(total) else NOTHING
    return [*rows, ("all, over noise [1]", *sizes, share)]


def cause_table(diagnosis: Diagnosis, longest: int = 36) -> tuple[list[str], list[tuple[str, ...]]]:
    """Return header and rows of the causes, a row for every parameter; name and probability stand on the first.

    When an effect begins, and what it cannot be told from, are columns only where there is such a thing to say.

    Args:
        diagnosis: the result.
        longest: characters of a flight's name.
    """
    header = ["cause", "probability", "parameter", "value", "95 % interval", "begins", "or else"]
    rows: list[tuple[str, ...]] = []
    for cause in named_causes(diagnosis):
        begins = [onset(t, plain_name(n, longest)) for n, t in cause.onset.items() if t is not None]
        first = (cause.identifier, probability(cause.probability))
        last = ("\n".join(begins), "\n".join(cause.indistinguishable_from))
        for name, parameter in cause.parameters.items() or [("", None)]:
            shown = estimate(parameter, unit_of(cause, parameter)) if parameter else ("", "")
            rows.append((*first, name, *shown, *last))
            first, last = ("", ""), ("", "")
    if UNKNOWN in diagnosis.verdict:
        rows.append((UNKNOWN, probability(diagnosis.unknown_probability), *[""] * 5))
    keep = [k for k in range(len(header)) if k < 5 or any(row[k] for row in rows)]
    return [header[k] for k in keep], [tuple(row[k] for k in keep) for row in rows]


def unseen(diagnosis: Diagnosis) -> str:
    """Return which effects would leave no trace in the training flights at their usual size; empty: none."""
    alone = [item.effects[0] for item in diagnosis.identifiability.not_identifiable if len(item.effects) == 1]
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
        tried = [item.manoeuvre for item in diagnosis.identifiability.not_identifiable if item.manoeuvre]
        return [f"Fly with more motion in every axis{f', such as: {tried[0]}' if tried else ''}. Diagnose again."]
    causes = named_causes(diagnosis)
    out = [
        f"To check {name_of(c.identifier)}: {check}." for c in causes if (check := effect_of(c.identifier).bench_check)
    ]
    for cause in causes:
        others = cause.indistinguishable_from
        if others:
            between = f"{name_of(cause.identifier)} from {listed([name_of(o) for o in others], 'or')}"
            how = manoeuvre((cause.identifier, *others)).rstrip(".")
            out.append(f"To tell {between}, fly: {how}; or the flight of np-drake next-flight.")
        elif loose := _loose(cause):
            more = effect_of(cause.identifier).excited_by or "a longer one with more motion"
            out.append(f"Intervals of {cause.identifier} are wide ({listed(loose)}); a better flight: {more}.")
    if UNKNOWN in diagnosis.verdict and diagnosis.unexplained:
        out.append(f"Look for the source of what remains: {described(main_remainder(diagnosis.unexplained))}.")
    if any("not tested" in sentence for sentence in diagnosis.coverage):
        out.append("Hold out a flight that moves like the training flights.")
    if diagnosis.not_flyable:
        out.insert(0, f"Do not fly the corrected simulator: {diagnosis.not_flyable}.")
    elif causes:
        them = "it" if len(causes) == 1 else "them"
        out.append(f"Add {them} to the simulator with the values of the table, and diagnose new flights with that.")
    return [capital(step) for step in out]


def _loose(cause: Cause) -> list[str]:
    """Return the parameters whose interval is wide, if the widest of the effect's values is one of them."""
    wide = {name: 0.5 * (p.ci95[1] - p.ci95[0]) > LOOSE * abs(p.value) > 0 for name, p in cause.parameters.items()}
    alike = max((abs(p.value) for p in cause.parameters.values()), default=0.0)
    main = [name for name, p in cause.parameters.items() if abs(p.value) == alike]
    return [name for name in wide if wide[name]] if any(wide[name] for name in main) else []
