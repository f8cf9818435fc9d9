"""Causes that are withdrawn for what stands beside them, or does not."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.held_out import HeldOut, remaining_residual
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.regressors import SHIFTING
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Finding


def without_missing_drag(causes: list[Cause], minor: list[Finding]) -> tuple[list[Cause], list[Finding]]:
    """A wind pushes through a drag alone: where none is a cause, neither is it."""
    named = {c.identifier for c in causes}
    unfelt = [c for c in causes if c.effect and c.effect.needs and not named & {*c.effect.needs}]
    texts = [Finding(c.identifier, "no cause through which it would be felt", c.share, {}) for c in unfelt]
    return [c for c in causes if c not in unfelt], [*minor, *texts]


def without_faint_shifts(
    causes: list[Cause], minor: list[Finding], least: float
) -> tuple[list[Cause], list[Finding]]:
    """Lag, delay and clock all move commands against states: where one does, a trace of another is its misfit."""
    largest = max((c.share for c in causes if c.identifier in SHIFTING), default=0.0)
    faint = [c for c in causes if c.identifier in SHIFTING and c.share < least * largest]
    texts = [
        Finding(c.identifier, f"a {c.share / largest:.2g} of what another shift of time does", c.share, {})
        for c in faint
    ]
    return [c for c in causes if c not in faint], [*minor, *texts]


def without_superfluous(
    causes: Sequence[Cause], flights: Sequence[FlightResiduals], noise: NoiseModel, held: HeldOut
) -> tuple[list[Cause], list[Finding]]:
    """Causes by which the ladder goes down, and those by which it does not: what is not known stands behind them.

    They are taken off one by one, the worst first; a drag that a wind among them acts through stays with it.
    """
    kept, idle = list(causes), []
    while kept:
        whole = remaining_residual(kept, flights, noise, held)
        gains = [
            remaining_residual([c for c in kept if c is not o], flights, noise, held) - whole for o in kept
        ]
        felt = {name for c in kept if c.effect is not None for name in type(c.effect).needs}
        gains = [np.inf if c.identifier in felt else gain for c, gain in zip(kept, gains, strict=True)]
        worst = int(np.argmin(gains))
        if gains[worst] > 0:
            break
        idle.append(kept.pop(worst))
    why = "beside what is unknown it takes nothing off what held-out flights leave"
    return kept, [Finding(c.identifier, why, c.share, {}) for c in idle]
