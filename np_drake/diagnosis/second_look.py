"""Held-out flights may show what training flights do not excite: a drag, where those hover.

Then the first half of each joins the fit, and its second half alone judges.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.attribute import misfit
from np_drake.diagnosis.evidence import Evidence, make_evidence
from np_drake.diagnosis.look import Look

UNFORESEEN = {True: 1.6, False: 1.25}  # residual over noise, on a rig and in a laboratory [1]; own choice
LEAST = 4.0  # that either half must last [s]; own choice
NAME = "first half of {}"


def unforeseen(first: Look) -> bool:
    """Is more left on some channel of the held-out flights than noise, or a force or torque that these do not excite?

    Gusts, which repeat nowhere, and a payload, whose swing may be lost, do not count.
    """
    if first.gusty or any(t.swings for t in first.ranking.named.terms):
        return False
    if first.left.novel:
        return True
    ratio = misfit(first.left.held, first.ranking.noise)
    return bool(ratio.max() > UNFORESEEN[first.ranking.tolerance.real])


def halved(flights: Sequence[Evidence]) -> tuple[list[Evidence], list[Evidence]]:
    """First halves of long enough flights, as flights of their own; and all flights, these rows not counting."""
    halves, judges = [], []
    for e in flights:
        log = e.log
        middle = 0.5 * (log.t[0] + log.t[-1])
        if middle - log.t[0] < LEAST:
            judges.append(e)
            continue
        half = dc.replace(log.rows(0, int(np.searchsorted(log.t, middle))), name=NAME.format(e.name))
        halves.append(dc.replace(make_evidence(half, e.vehicle, e.grid.step), goes_on=True))
        judges.append(dc.replace(e, joined=e.t <= middle))
    return halves, judges
