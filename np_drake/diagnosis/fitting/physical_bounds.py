"""Physical bounds of fitted parameters, and fits that violate them."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from np_drake.diagnosis.fitting.map_estimate import Fit
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.base import Effect
from np_drake.rigid_body import P
from np_drake.vehicle import Vehicle

EDGE = 1e-3  # share of a parameter's range within which it is at its bound [1]; own choice
STEPS = 3  # points of an interval that are tried; own choice


def interval(fit: Fit, i: int, name: str) -> tuple[float, float]:
    """Return the 95 % interval of a parameter of term i, from the covariance of the fit."""
    value = float(getattr(fit.terms[i].effect, name))
    own = (k for k, f in enumerate(fit.free) if (f.term, f.name, f.flight) == (i, name, ""))
    half = sum(1.96 * float(np.sqrt(fit.covariance[k, k])) for k in own)
    return value - half, value + half


def greatest_height(flights: Sequence[FlightResiduals]) -> float:
    """Return the largest height of flights above the ground [m]; infinite where logs do not tell
    it.
    """
    if any("height" in e.log.lacks for e in flights):
        return np.inf
    return max(float(e.rows.x[:, P][:, 2].max()) for e in flights)


def at_its_bound(effect: Effect) -> bool:
    """Return whether a parameter lies at a physical bound that is not its neutral value."""
    for p in effect.parameters:
        value, edge = float(getattr(effect, p.name)), EDGE * (p.upper - p.lower)
        ends = value <= p.lower + edge or value >= p.upper - edge
        if ends and not p.choices and abs(value - p.neutral) > edge:
            return True
    return False


def impossible(fit: Fit, i: int, vehicle: Vehicle, height: float) -> str:
    """Return why the effect of term i must stand in for another, or "" where it need not.

    A parameter is at its bound, or no vehicle can have such parameters within their 95 % intervals.

    Args:
        height: largest above the ground that it flies at; infinite: not known [m].
    """
    effect = fit.terms[i].effect
    if at_its_bound(effect):
        return "a figure at its bound is none"
    tried = [np.linspace(*interval(fit, i, p.name), STEPS).tolist() for p in effect.parameters]
    figures = (dict(zip(effect.values, some, strict=True)) for some in product(*tried))
    possible = (effect.of({**effect.values, **some}).possible(vehicle, height) for some in figures)
    return "" if any(possible) else "no vehicle can have such figures"


def is_possible(fit: Fit, vehicle: Vehicle, height: float) -> bool:
    """Return whether no effect of a fit need stand in for another.

    Args:
        height: largest above the ground that it flies at; infinite: not known [m].
    """
    return not any(impossible(fit, i, vehicle, height) for i in range(len(fit.terms)))
