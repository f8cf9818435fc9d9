"""What is left once the causes are taken out: is it noise, or something the library does not have?"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.answer import Finding
from np_drake.diagnosis.attribute import HeldOut, on_held_out
from np_drake.diagnosis.evidence import FORCE, TORQUE, Evidence
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


def remains(ranking: Ranking, fit: Fit, flights: Sequence[Evidence], unseen: Sequence[Evidence]) -> Remains:
    """The traces of what is left, judged for size."""
    held = on_held_out(fit, unseen, ranking.noise)
    left = {e.name: fit.left(e) for e in flights} | held.left
    found = traces(
        flights, left, ranking.noise, temperature=ranking.problem.temperature, held_out=unseen
    )
    best = found[0]
    score = min(best.gain, best.held_out + 3.0)
    probability = float(1 / (1 + np.exp(-np.clip(score - GAIN, -50, 50))))
    findings = tuple(
        Finding(t.name, t.text, t.share, {"force": t.force, "torque": t.torque, **t.figures})
        for t in found
        if t.gain > GAIN
    )
    return Remains(probability > 0.5, probability, findings, tuple(found), held)


__all__ = ["FORCE", "TORQUE", "Remains", "remains"]
