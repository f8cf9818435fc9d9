"""Physical bounds of fitted parameters, and fits that violate them."""

import dataclasses as dc
from itertools import product

import numpy as np

from np_drake.diagnosis.fitting.map_estimate import Fit
from np_drake.effects.base import Effect, MassEffect, MassProperties
from np_drake.vehicle import Vehicle

EDGE = 1e-3  # share of a parameter's range within which it is at its bound [1]; own choice
STEPS = 3  # points of an interval that are tried; own choice


def interval(fit: Fit, i: int, name: str) -> tuple[float, float]:
    """Return the 95 % interval of a parameter of term i, from the covariance of the fit.

    Args:
        fit: of the model.
        i: position of the term.
        name: of the parameter.
    """
    value = float(getattr(fit.terms[i].effect, name))
    own = (k for k, f in enumerate(fit.free) if (f.term, f.name, f.flight) == (i, name, ""))
    half = sum(1.96 * float(np.sqrt(fit.covariance[k, k])) for k in own)
    return value - half, value + half


def at_its_bound(effect: Effect) -> bool:
    """Return whether a parameter lies at a physical bound that is not its neutral value."""
    for p in effect.parameters:
        value, edge = float(getattr(effect, p.name)), EDGE * (p.upper - p.lower)
        ends = value <= p.lower + edge or value >= p.upper - edge
        if ends and not p.choices and abs(value - p.neutral) > edge:
            return True
    return False


def impossible(fit: Fit, i: int, vehicle: Vehicle) -> str:
    """Return why the effect of term i must stand in for another, or "" where it need not.

    A parameter is at its bound, or no rigid body has such parameters within their 95 % intervals.

    Args:
        fit: the fitted model.
        i: position of the term.
        vehicle: the nominal vehicle.
    """
    effect = fit.terms[i].effect
    if at_its_bound(effect):
        return "a figure at its bound is none"
    if not isinstance(effect, MassEffect):
        return ""
    tried = [np.linspace(*interval(fit, i, p.name), STEPS).tolist() for p in effect.parameters]
    figures = (dict(zip(effect.values, some, strict=True)) for some in product(*tried))
    nominal = MassProperties.of(vehicle)
    bodies = (dc.replace(effect, **some).properties(nominal) for some in figures)  # type: ignore[type-var]
    return "" if any(body.rigid for body in bodies) else "no rigid body has such figures"
