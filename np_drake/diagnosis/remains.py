"""What is left once the causes are taken out: is it noise, or something the library does not have?"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.answer import Finding
from np_drake.diagnosis.attribute import HeldOut, on_held_out
from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.gusts import SlowForce, slow_force
from np_drake.diagnosis.refine import Fit
from np_drake.diagnosis.unknown import Trace, traces
from np_drake.diagnosis.which import Ranking

GAIN = 6.0  # log evidence a trace must bring, all groups' multiplicity included; own choice


@dc.dataclass(frozen=True)
class Remains:
    """unknown: is something material left?   findings: where it lives.   held: the fit on unseen flights."""

    unknown: bool
    probability: float
    findings: tuple[Finding, ...]
    traces: tuple[Trace, ...]
    held: HeldOut
    slow: SlowForce
    slow_probability: float


def remains(ranking: Ranking, fit: Fit, flights: Sequence[Evidence], unseen: Sequence[Evidence]) -> Remains:
    """The traces of what is left, judged for size."""
    held = on_held_out(fit, unseen, ranking.noise)
    left = {e.name: fit.left(e) for e in flights} | held.left
    found = traces(
        flights, left, ranking.noise, temperature=ranking.problem.temperature, held_out=unseen
    )
    slow = slow_force(flights, {e.name: left[e.name] for e in flights}, ranking.tolerance)
    findings = tuple(
        Finding(t.name, t.text, t.share, {"force": t.force, "torque": t.torque, **t.figures})
        for t in found
        if t.gain > GAIN
    )
    best = max((_probability(t, flights) for t in found), default=0.0)
    return Remains(
        best > 0.5, best, findings, tuple(found), held, slow, slow.probability(ranking.tolerance)
    )


def _probability(trace: Trace, flights: Sequence[Evidence]) -> float:
    """That a trace is real: it is significant, and the flights that it was not fitted to bear it out."""
    score = min(trace.gain - GAIN, trace.held_out + 2.0 if trace.repeats else np.inf)
    return float(1 / (1 + np.exp(-np.clip(score, -50, 50))))


__all__ = ["Remains", "remains"]
