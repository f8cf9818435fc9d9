"""Headline of a diagnosis and the sentence below it; for page and terminal alike."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.report.remainder import has_gap, share_left, sizes_left
from np_drake.diagnosis.report.words import bare_name, capital, flights, listed, measure, phrase
from np_drake.diagnosis.residuals.residual_parts import gap_kinds
from np_drake.diagnosis.result import UNKNOWN, Cause, Diagnosis, Finding, GapReduction
from np_drake.files.number_text import NBSP, number, of_at_least, percent, probability

PLAIN_GAP = 1.4  # residual over noise above which a simulator does not agree with the logs [1]; own choice
CONTRADICTED = -0.02  # held-out gain below which flights contradict a cause [1]; own choice
MOST_NAMED = 3  # causes in the headline; the table has all
SURE_UNKNOWN = 0.9  # probability of the unknown above which the headline says it [1]; own choice
PLAIN_GAIN = 1.1  # ratio of errors of the replay from which it is better or worse [1]; own choice


def headline(diagnosis: Diagnosis) -> str:
    """Return the answer in one sentence: the causes, their share of the whole gap, and what the replay makes of it.

    At most `MOST_NAMED` causes are named, those with the largest share of the gap. Where the held-out flights show no
    gap above the noise, that is the answer, and nothing is named.
    """
    if diagnosis.cannot_tell:
        return "These logs cannot tell"
    reduction, judges = diagnosis.gap_reduction, _judges(diagnosis)
    if not has_gap(reduction):
        return f"There is no gap above the noise on {judges}"
    causes, told = named_causes(diagnosis), probability(diagnosis.unknown_probability)
    if causes:
        return capital(_explained(diagnosis, causes)) + _unknown(diagnosis)
    sizes = sizes_left(diagnosis.localisation)
    residual = f"{number(reduction.after, 2)} times the noise on {judges}"
    if UNKNOWN in diagnosis.verdict:
        size = f"{sizes}, " if sizes else ""
        return f"No effect explains what is left ({told}): {size}{residual}"
    calibrated = "with calibration, " if diagnosis.calibration else ""
    if _unexplained(reduction):
        return f"No cause is told: {calibrated}the gap is {residual}"
    return f"Nothing material is missing: {calibrated}the residual is {residual}"


def _unknown(diagnosis: Diagnosis) -> str:
    """Return what is left that no effect explains, where that is probable and above the noise."""
    sizes = sizes_left(diagnosis.localisation)
    if UNKNOWN not in diagnosis.verdict or diagnosis.unknown_probability <= SURE_UNKNOWN or not sizes:
        return ""
    left = percent(share_left(diagnosis.gap_reduction))
    return f"; {left} remains unexplained: {sizes} (probability {probability(diagnosis.unknown_probability)})"


def _explained(diagnosis: Diagnosis, causes: Sequence[Cause]) -> str:
    """Return the causes as subject, what flights contradict, the share of the gap, and whether the replay improves."""
    names = [phrase(cause) for cause in causes[:MOST_NAMED]]
    rest = len(causes) - len(names)
    names += [f"{rest} more"] * (rest > 0) + ["calibration"] * bool(diagnosis.calibration)
    one, share, judges = len(names) == 1, diagnosis.gap_reduction.fraction, _judges(diagnosis)
    if share < 0:
        return f"{listed(names)} {'does' if one else 'do'} not help: the gap on {judges} grows"
    text = f"{listed(names)} explain{'s' if one else ''} {percent(share)} of the gap on {judges}"
    against = [bare_name(c.identifier) for c in causes if c.held_out_gain < CONTRADICTED]
    if against:
        text += f", which {'is' if len(diagnosis.held_out) == 1 else 'are'} predicted better without {listed(against)}"
    if grown := [part.kind for part in gap_kinds(diagnosis.localisation.channels) if part.grows]:
        text += f" and make{'s' * one} {listed(grown)} worse"
    return text + _replayed(diagnosis.gap_reduction)


def _replayed(reduction: GapReduction) -> str:
    """Return how the position error of the replay changes at its last horizon; empty where it was not made."""
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
    """Return what stands below the headline: probabilities, what remains, and what the second answer adds."""
    reduction, said = diagnosis.gap_reduction, []
    if diagnosis.cannot_tell:
        return "The training flights excite too little to tell one effect from another."
    causes, gap = named_causes(diagnosis), has_gap(reduction)
    if causes and gap:
        least = min(cause.probability for cause in causes)
        one = f"probability {probability(least)}"
        said.append(one if len(causes) == 1 else f"each has a probability {of_at_least(least)}")
    elif causes:
        them = listed([bare_name(c.identifier) for c in causes])
        said.append(f"training names {them}, which these flights do not need")
    elif UNKNOWN not in diagnosis.verdict and gap:
        agrees = "nothing in training shows its cause" if _unexplained(reduction) else "the simulator agrees"
        said.append(agrees)
    elif UNKNOWN not in diagnosis.verdict:
        said.append("the simulator agrees with the logs, and nothing is named")
    if UNKNOWN in diagnosis.verdict:
        traces = diagnosis.unexplained
        said.append(
            f"to find what remains: {main_remainder(traces).measurement}" if traces else "it has no trace of its own"
        )
    if diagnosis.new_on_held_out:
        said.append(f"new on {_judges(diagnosis)}: {diagnosis.new_on_held_out[0].text.rstrip('.')}")
    if diagnosis.refit is not None and diagnosis.refit.verdict != diagnosis.verdict:
        said.append("a second answer, which knows halves of the held-out flights, differs: see below")
    return capital("; ".join(said)) + "."


def main_remainder(remains: Sequence[Finding]) -> Finding:
    """Return the finding with the largest share of weight, else with the largest force, else the first."""
    return max(remains, key=lambda f: (f.figures.get("share", 0.0), f.figures.get("force", 0.0)))


def named_causes(diagnosis: Diagnosis) -> list[Cause]:
    """Return the causes of the verdict, the one with the largest share of the gap first."""
    named = [cause for cause in diagnosis.causes if cause.identifier in diagnosis.verdict]
    return sorted(named, key=lambda cause: -np.nan_to_num(cause.share))


def _unexplained(reduction: GapReduction) -> bool:
    """Return whether the held-out residual is too large for the simulator to agree with the logs."""
    return reduction.after > PLAIN_GAP * reduction.floor


Diagnosis.headline = headline
