"""Headline of a diagnosis and the sentence below it; for page and terminal alike."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.report.words import bare_name, capital, described, flights, listed, measure, phrase
from np_drake.diagnosis.result import UNKNOWN, Cause, Diagnosis, Finding, GapReduction
from np_drake.files.number_text import NBSP, number, of_at_least, percent, probability

PLAIN_GAP = 1.4  # residual over noise above which a simulator does not agree with the logs [1]; own choice
LEAST_GAP = 1.05  # residual over noise below which a share of the gap has no meaning [1]; own choice
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
        return capital(_explained(diagnosis, causes)) + (f"; {_unknown(told)} remains" if _sure(diagnosis) else "")
    residual = f"{number(reduction.before, 2)} times the noise on {judges}"
    if UNKNOWN in diagnosis.verdict:
        return capital(f"{_unknown(told)} leaves a gap of {residual}")
    if _unexplained(reduction):
        return f"No cause is told: the gap is {residual}"
    return f"Nothing material is missing: the residual is {residual}"


def _unknown(told: str) -> str:
    return f"something that no effect explains ({told})"


def _sure(diagnosis: Diagnosis) -> bool:
    """Return whether something unknown remains with a probability that the headline says."""
    return UNKNOWN in diagnosis.verdict and diagnosis.unknown_probability > SURE_UNKNOWN


def _explained(diagnosis: Diagnosis, causes: Sequence[Cause]) -> str:
    """Return the causes as subject, the share of the gap that they explain, and whether the replay improves."""
    names = [phrase(cause) for cause in causes[:MOST_NAMED]]
    rest = len(causes) - len(names)
    who = listed([*names, f"{rest} more"] if rest else names)
    one, share, judges = len(causes) == 1, diagnosis.gap_reduction.fraction, _judges(diagnosis)
    if share < 0:
        return f"{who} {'does' if one else 'do'} not help: the gap on {judges} grows"
    text = f"{who} explain{'s' if one else ''} {percent(share)} of the gap on {judges}"
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
        said.append(_what_remains(diagnosis))
    if diagnosis.new_on_held_out:
        said.append(f"new on {_judges(diagnosis)}: {diagnosis.new_on_held_out[0].text.rstrip('.')}")
    if diagnosis.refit is not None and diagnosis.refit.verdict != diagnosis.verdict:
        said.append("a second answer, which knows halves of the held-out flights, differs: see below")
    return capital("; ".join(said)) + "."


def _what_remains(diagnosis: Diagnosis) -> str:
    named = bool(named_causes(diagnosis))
    if diagnosis.unexplained:
        trace = described(main_remainder(diagnosis.unexplained))
        return f"{'what remains' if named else 'its clearest trace'}: {trace}"
    if named:
        return f"something that no effect explains remains, {probability(diagnosis.unknown_probability)}"
    return "it has no trace of its own"


def main_remainder(remains: Sequence[Finding]) -> Finding:
    """Return the finding with the largest share of weight, else with the largest force, else the first."""
    return max(remains, key=lambda f: (f.figures.get("share", 0.0), f.figures.get("force", 0.0)))


def named_causes(diagnosis: Diagnosis) -> list[Cause]:
    """Return the causes of the verdict, the one with the largest share of the gap first."""
    named = [cause for cause in diagnosis.causes if cause.identifier in diagnosis.verdict]
    return sorted(named, key=lambda cause: -np.nan_to_num(cause.share))


def has_gap(reduction: GapReduction) -> bool:
    """Return whether the held-out residual exceeds the noise enough for a closed fraction to have meaning."""
    return reduction.before > LEAST_GAP * reduction.floor


def _unexplained(reduction: GapReduction) -> bool:
    """Return whether the held-out residual is too large for the simulator to agree with the logs."""
    return reduction.before > PLAIN_GAP * reduction.floor


Diagnosis.headline = headline
