"""Causes that are withdrawn for what stands beside them, or does not."""

from np_drake.diagnosis.result import Cause, Finding
from np_drake.diagnosis.selection.beam_search import SHIFTING

FAINT = 0.03  # of the largest among them [1]; own choice, as linear columns are `INEXACT`


def without_unfelt(causes: list[Cause], minor: list[Finding]) -> tuple[list[Cause], list[Finding]]:
    """A wind pushes through a drag alone: where none is a cause, neither is it."""
    named = {c.identifier for c in causes}
    unfelt = [c for c in causes if c.effect and c.effect.needs and not named & {*c.effect.needs}]
    texts = [Finding(c.identifier, "no cause through which it would be felt", c.share, {}) for c in unfelt]
    return [c for c in causes if c not in unfelt], [*minor, *texts]


def without_faint_shifts(causes: list[Cause], minor: list[Finding]) -> tuple[list[Cause], list[Finding]]:
    """Lag, delay and clock all move commands against states: where one does, a trace of another is its misfit."""
    largest = max((c.share for c in causes if c.identifier in SHIFTING), default=0.0)
    faint = [c for c in causes if c.identifier in SHIFTING and c.share < FAINT * largest]
    texts = [
        Finding(c.identifier, f"a {c.share / largest:.2g} of what another shift of time does", c.share, {})
        for c in faint
    ]
    return [c for c in causes if c not in faint], [*minor, *texts]
