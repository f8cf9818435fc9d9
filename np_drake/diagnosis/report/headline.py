"""Headline of a diagnosis and the sentence below it; for page and terminal alike."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.report.remainder import share_left, sizes_left
from np_drake.diagnosis.report.words import bare_name, capital, flights, listed, measure, phrase
from np_drake.diagnosis.residuals.residual_parts import gap_kinds
from np_drake.diagnosis.result import UNKNOWN, Cause, Diagnosis, Finding, GapReduction
from np_drake.files.number_text import NBSP, of_at_least, percent, probability

CONTRADICTED = -0.02  # held-out gain below which flights contradict a cause [1]; own choice
MOST_NAMED = 3  # causes in the headline; the table has all
PLAIN_GAIN = 1.1  # ratio of errors of the replay from which it is better or worse [1]; own choice


def headline(diagnosis: Diagnosis) -> str:
    """Return the answer in one sentence: the causes, their share of the whole gap, and what the
    replay makes of it.

    At most `MOST_NAMED` causes are named, those with the largest share of the gap. Where the
    held-out flights show no material gap, that is the answer, and nothing is named.
    """
    if diagnosis.cannot_tell:
        return "These logs cannot tell"
    reduction, judges = diagnosis.gap_reduction, _judges(diagnosis)
    if not reduction.material:
        return f"There is no material gap on {judges}"
    causes = named_causes(diagnosis)
    if causes:
        return capital(_explained(diagnosis, causes)) + _unknown(diagnosis)
    sizes = sizes_left(reduction.left)
    if UNKNOWN in diagnosis.verdict:
        return (
            f"No effect explains what is left on {judges} "
            f"({probability(diagnosis.unknown_probability)}): {sizes}"
        )
    calibrated = "with calibration, " if diagnosis.calibration else ""
    return f"Nothing material is missing: {calibrated}the remainder on {judges} is {sizes}"


def _unknown(diagnosis: Diagnosis) -> str:
    """Return what is left that no effect explains, where that is probably material."""
    if UNKNOWN not in diagnosis.verdict:
        return ""
    left, reduction = diagnosis.gap_reduction.left, diagnosis.gap_reduction
    told = f"probability that it is material {probability(left.probability)}"
    return f"; {percent(share_left(reduction))} remains unexplained: {sizes_left(left)} ({told})"


def _explained(diagnosis: Diagnosis, causes: Sequence[Cause]) -> str:
    """Return the causes as subject, what flights contradict, the share of the gap, and whether the
    replay improves.
    """
    names = [phrase(cause) for cause in causes[:MOST_NAMED]]
    rest = len(causes) - len(names)
    names += [f"{rest} more"] * (rest > 0) + ["calibration"] * bool(diagnosis.calibration)
    one, share, judges = len(names) == 1, diagnosis.gap_reduction.fraction, _judges(diagnosis)
    if share < 0:
        return f"{listed(names)} {'does' if one else 'do'} not help: the gap on {judges} grows"
    text = f"{listed(names)} explain{'s' if one else ''} {percent(share)} of the gap on {judges}"
    against = [bare_name(c.identifier) for c in causes if c.held_out_gain < CONTRADICTED]
    if against:
        text += (
            f", which {'is' if len(diagnosis.held_out) == 1 else 'are'} predicted better "
            f"without {listed(against)}"
        )
    if grown := [part.kind for part in gap_kinds(diagnosis.localisation.channels) if part.grows]:
        text += f" and make{'s' * one} {listed(grown)} worse"
    return text + _replayed(diagnosis.gap_reduction)


def _replayed(reduction: GapReduction) -> str:
    """Return how the position error of the replay changes at its last horizon; empty where it was
    not made.
    """
    before, after = reduction.replay_before, reduction.replay_after
    if before is None or after is None:
        return ""
    was, now = float(before.position[-1, 0]), float(after.position[-1, 0])
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
    reduction, said = diagnosis.gap_reduction, []
    if diagnosis.cannot_tell:
        return "The training flights excite too little to tell one effect from another."
    causes, gap = named_causes(diagnosis), reduction.material
    if causes and gap:
        least = min(cause.probability for cause in causes)
        one = f"probability {probability(least)}"
        said.append(one if len(causes) == 1 else f"each has a probability {of_at_least(least)}")
    elif causes:
        them = listed([bare_name(c.identifier) for c in causes])
        said.append(f"training names {them}, which these flights do not need")
    elif UNKNOWN not in diagnosis.verdict:
        said.append("the simulator agrees with the logs, and nothing is named")
    if UNKNOWN in diagnosis.verdict:
        traces = diagnosis.unexplained
        said.append(
            f"to find what remains: {main_remainder(traces).measurement}"
            if traces
            else "it has no trace of its own"
        )
    if diagnosis.new_on_held_out:
        said.append(f"new on {_judges(diagnosis)}: {diagnosis.new_on_held_out[0].text.rstrip('.')}")
    if diagnosis.refit is not None and diagnosis.refit.verdict != diagnosis.verdict:
        said.append(
            "a second answer, which knows halves of the held-out flights, differs: see below"
        )
    return capital("; ".join(said)) + "."


def main_remainder(remains: Sequence[Finding]) -> Finding:
    """Return the finding with the largest share of weight, else with the largest force, else the
    first.
    """
    return max(remains, key=lambda f: (f.figures.get("share", 0.0), f.figures.get("force", 0.0)))


def named_causes(diagnosis: Diagnosis) -> list[Cause]:
    """Return the causes of the verdict, the one with the largest share of the gap first."""
    named = [cause for cause in diagnosis.causes if cause.identifier in diagnosis.verdict]
    return sorted(named, key=lambda cause: -np.nan_to_num(cause.share))


Diagnosis.headline = headline
