"""What the figures of a fit can be, and what they cannot."""

import dataclasses as dc
from itertools import product

import numpy as np

from np_drake.diagnosis.fitting.map_estimate import Fit
from np_drake.diagnosis.options import Thresholds
from np_drake.diagnosis.regressors import DRAG, DRAGS
from np_drake.effects.base import Effect, MassEffect, MassProperties
from np_drake.vehicle import Vehicle

EDGE = 1e-3  # of a figure's range, within which it lies at its bound [1]; own choice
STEPS = 3  # in which an interval is gone through; own choice


def interval(fit: Fit, i: int, name: str) -> tuple[float, float]:
    """Of 95 %, of a figure of term i, as far as the fit knows."""
    value = float(getattr(fit.terms[i].effect, name))
    own = (k for k, f in enumerate(fit.free) if (f.term, f.name, f.flight) == (i, name, ""))
    half = sum(1.96 * float(np.sqrt(fit.covariance[k, k])) for k in own)
    return value - half, value + half


def at_its_bound(effect: Effect) -> bool:
    """Does a figure lie at the end of what is physical, without being neutral there?

    Then the effect stands for something else, which would need more of it.
    """
    for p in effect.parameters:
        value, edge = float(getattr(effect, p.name)), EDGE * (p.upper - p.lower)
        ends = value <= p.lower + edge or value >= p.upper - edge
        if ends and not p.choices and abs(value - p.neutral) > edge:
            return True
    return False


def _pushes(fit: Fit, i: int, deviations: float) -> bool:
    """Is it a drag, and surely less than none along an axis? Of two drags one may make up for the other."""
    effect = fit.terms[i].effect
    if effect.identifier not in DRAGS:
        return False
    own = [k for k, f in enumerate(fit.free) if f.term == i and not f.flight]
    return any(fit.values[k] < -deviations * np.sqrt(fit.covariance[k, k]) for k in own)


def impossible(fit: Fit, i: int, vehicle: Vehicle, thresholds: Thresholds, *, gusty: bool = False) -> str:
    """Why term i's effect must stand for something else: a figure is at its bound, a drag pushes, or no rigid body has

    such figures, wherever in their 95 % intervals; "": it need not.   gusty: do gusts blow? They are what a drag that
    feels them stands for where it is at its bound or pushes: fitted without them, it may lose an axis to them.
    """
    effect = fit.terms[i].effect
    if not (gusty and effect.identifier == DRAG):
        if at_its_bound(effect):
            return "a figure at its bound is none"
        if _pushes(fit, i, thresholds.pushing_drag):
            return "no drag pushes"
    if not isinstance(effect, MassEffect):
        return ""
    tried = [np.linspace(*interval(fit, i, p.name), STEPS).tolist() for p in effect.parameters]
    figures = (dict(zip(effect.values, some, strict=True)) for some in product(*tried))
    nominal = MassProperties.of(vehicle)
    bodies = (dc.replace(effect, **some).properties(nominal) for some in figures)  # type: ignore[type-var]
    return "" if any(body.rigid for body in bodies) else "no rigid body has such figures"
