"""Causes withdrawn for other causes that stand beside them, or are absent."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.held_out import HeldOut, remaining_residual
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.regressors import SHIFTING
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Finding


def without_missing_drag(causes: list[Cause], minor: list[Finding]) -> tuple[list[Cause], list[Finding]]:
    """Return causes and minor findings with winds moved to the latter where no drag is a cause."""
    named = {c.identifier for c in causes}
    unfelt = [c for c in causes if c.effect and c.effect.needs and not named & {*c.effect.needs}]
    texts = [Finding(c.identifier, "no cause through which it would be felt", c.share, {}) for c in unfelt]
    return [c for c in causes if c not in unfelt], [*minor, *texts]


def without_faint_shifts(
    causes: list[Cause], minor: list[Finding], least: float
) -> tuple[list[Cause], list[Finding]]:
    """Return causes and minor findings with time shifts moved to the latter that a larger one explains.

    least: share of the largest shift [1]. Lag, delay and clock all move commands against states.
    """
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
    """Return the causes that lower the held-out residual, and findings for those that do not.

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
