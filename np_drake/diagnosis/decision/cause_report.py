"""A term of the best model as a cause or a minor finding."""

import numpy as np

from np_drake.diagnosis.decision.inclusion import Inclusion
from np_drake.diagnosis.fitting import Fit, interval
from np_drake.diagnosis.forward_model import pendulum_error
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.result import Cause, Estimate, Finding

PROBABILITY = "probability"  # figure of a finding that would be a cause if it were surer


def minor_finding(cause: Cause, verdict: Inclusion) -> Finding:
    """Return the finding of an effect that is no cause, with the reason."""
    size = verdict.size
    values = ", ".join(f"{n} {e.value:.3g} {e.unit}" for n, e in cause.parameters.items())
    why = "immaterial" if verdict.confirmed else "not confirmed by the held-out flights"
    figures = {"force": size.force, "torque": size.torque}
    if verdict.confirmed and verdict.material:
        why = f"not sure, {cause.probability:.2g}"
        if verdict.significant and not verdict.stands_for:
            figures |= {PROBABILITY: cause.probability}
    if verdict.stands_for:
        why = verdict.stands_for
    elif verdict.confirmed and verdict.material and not verdict.significant:
        why = "its figures may as well be none"
    text = f"{values}: {why} ({100 * size.force:.2g} % of weight, {100 * size.torque:.2g} % of torque)"
    return Finding(cause.identifier, text, size.gap, figures)


def make_cause(
    fit: Fit,
    i: int,
    probability: float,
    share: float,
    onset: dict[str, float | None],
    alternatives: tuple[str, ...],
    *,
    priors: Priors,
) -> Cause:
    """Return term i of the fit as a cause, with 95 % intervals.

    Args:
        share: of the gap [1].   onset: by flight [s].   alternatives: effects that cannot be told from it.
        priors: with the model error of payloads, which are no ideal pendulums.
    """
    term = fit.terms[i]
    effect = term.effect
    parameters = {}
    for p in effect.parameters:
        value, (lower, upper) = float(getattr(effect, p.name)), interval(fit, i, p.name)
        half = 0.5 * (upper - lower)
        if term.swings:
            half = float(np.hypot(half, 1.96 * pendulum_error(p.name, value, priors)))
        parameters[p.name] = Estimate(value, p.unit, (value - half, value + half))
    return Cause(effect.identifier, probability, parameters, onset, alternatives, share, effect)
