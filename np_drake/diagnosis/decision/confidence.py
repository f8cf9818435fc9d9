"""Confidence in names, from what held-out flights leave."""

import dataclasses as dc

import numpy as np

from np_drake.diagnosis.adequacy import Unexplained
from np_drake.diagnosis.held_out import misfit
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import PREFIX
from np_drake.diagnosis.result import Cause, Finding
from np_drake.diagnosis.selection import Ranking


def leaves_more_than_noise(ranking: Ranking, unexplained: Unexplained, *, gusty: bool = False) -> bool:
    """Return whether held-out flights leave more than noise, so that names are doubted."""
    thresholds, rows = (
        ranking.options.thresholds,
        sum(int(some.sum()) for some in unexplained.held.rows.values()),
    )
    limit = thresholds.misfit_in_gusts if gusty else thresholds.misfit
    return bool(
        largest_misfit(ranking, unexplained, gusty=gusty)
        > max(limit, 1 + thresholds.misfit_deviations / np.sqrt(2 * rows))
    )


def is_vague_drift(cause: Cause, options: Options) -> bool:
    """Return whether the cause is a vague drift of thrust, which the drift of real sensors resembles."""
    rate = cause.parameters.get("rate")
    if not options.tolerance.real or cause.identifier != "thrust_drift" or rate is None:
        return False
    return rate.ci95[1] - rate.ci95[0] > 2 * options.thresholds.vague_rate * abs(rate.value)


def largest_misfit(ranking: Ranking, unexplained: Unexplained, *, gusty: bool) -> float:
    """Return the largest held-out residual over noise of the channels that are tested [1].

    A payload's swing may be lost, with real sensors an attitude that wanders turns thrust into force across it, and
    gusts are level: none of these is asked.
    """
    if any(t.swings for t in ranking.named.terms):
        return 0.0
    ratio = misfit(unexplained.held, ranking.noise)
    return float(np.max(ratio[2:] if gusty or ranking.options.tolerance.real else ratio))


def structure_instead(ranking: Ranking, unexplained: Unexplained) -> tuple[bool, float, Unexplained]:
    """Return whether generic structure is the more likely explanation, its probability, and the findings with it.

    Asked where something acts and no name is sure.
    """
    shares = {n: p for n, p in ranking.probability.items() if n.startswith(PREFIX)}
    name = max(shares, key=lambda n: shares[n], default="")
    if shares.get(name, 0.0) <= 0.5:
        return unexplained.unknown, unexplained.probability, unexplained
    text = "structure that says as much as effects of which none is sure"
    found = Finding(name.removeprefix(PREFIX), text, shares[name], {})
    return (
        True,
        min(shares[name], ranking.options.thresholds.trust),
        dc.replace(unexplained, findings=(*unexplained.findings, found)),
    )
