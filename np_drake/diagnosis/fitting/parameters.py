"""Free parameters of a model, read from terms and written into them."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.forward_model import NEVER, STATE, Term, hidden_size, padded
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.base import correlation_root
from np_drake.effects.parameter import usual_size
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class Free:
    """Free parameter of term `term`: a parameter by name, or an entry of the hidden state of a
    flight.
    """

    term: int
    name: str
    scale: float
    neutral: float
    lower: float
    upper: float
    flight: str = ""
    entry: int = 0


def free_parameters(
    terms: Sequence[Term],
    flights: Sequence[FlightResiduals],
    scales: dict[int, float],
    priors: Priors,
) -> list[Free]:
    """Return the free parameters of the terms.

    Args:
        scales: by position, the prior standard deviation of calibration terms, in place of the
            typical one.
    """
    found = []
    for i, term in enumerate(terms):
        vehicle = flights[0].vehicle
        width = _width(term, vehicle) if term.effect.widens else 1.0
        for p in term.effect.parameters:
            if not p.choices:
                scale = scales.get(i, width * usual_size(p, vehicle))
                found.append(Free(i, p.name, scale, p.neutral, p.lower, p.upper))
        if not term.has_hidden_state:
            continue
        for e in flights:
            if term.begins(e.name) != NEVER:
                scales_of = [
                    priors.swing * (1 if k % STATE < 2 else 3)
                    for k in range(hidden_size(e, term.begins(e.name)))
                ]
                found += [
                    Free(i, "swing", s, 0.0, -4.0, 4.0, e.name, k) for k, s in enumerate(scales_of)
                ]
    return found


def prior_whitening(terms: Sequence[Term], free: Sequence[Free]) -> np.ndarray:
    """Return the matrix (k, k) that maps deviations from neutral over scale to independent standard
    ones [1].

    Args:
        terms: terms of a model, with their onsets and hidden states.
    """
    W = np.eye(len(free))
    for i, term in enumerate(terms):
        own = [k for k, f in enumerate(free) if f.term == i and not f.flight]
        if term.effect.prior_correlation and own:
            W[np.ix_(own, own)] = np.linalg.inv(correlation_root(type(term.effect)))
    return W


def _width(term: Term, vehicle: Vehicle) -> float:
    """Return the width of the prior over the typical one: the size of the effect, at least 1.

    `Gram.evidence_of_sets` uses the same rule.
    """
    free = [p for p in term.effect.parameters if not p.choices]
    sizes = [
        (float(getattr(term.effect, p.name)) - p.neutral) / usual_size(p, vehicle) for p in free
    ]
    return max(1.0, float(np.sqrt(np.mean(np.square(sizes)))))


def read(terms: Sequence[Term], free: Sequence[Free]) -> np.ndarray:
    """Return the values (k,) of the free parameters."""

    def value(f: Free) -> float:
        if f.flight:
            return padded(terms[f.term].hidden.get(f.flight), f.entry + 1)[f.entry]
        return getattr(terms[f.term].effect, f.name)

    return np.array([value(f) for f in free])


def write(terms: Sequence[Term], free: Sequence[Free], values: np.ndarray) -> list[Term]:
    """Return the terms with the free parameters set to `values` (k,); other terms are unchanged.

    Args:
        values: (k,) in physical units.
    """
    moved = {f.term for f in free}
    fields: list[dict[str, float]] = [{} for _ in terms]
    hidden = {i: {k: np.array(v) for k, v in terms[i].hidden.items()} for i in moved}
    for f, value in zip(free, values, strict=True):
        if f.flight:
            known = padded(
                hidden[f.term].get(f.flight),
                max(f.entry + 1, len(hidden[f.term].get(f.flight, ()))),
            )
            known[f.entry] = value
            hidden[f.term][f.flight] = known
        else:
            fields[f.term][f.name] = float(value)
    return [
        dc.replace(t, effect=dc.replace(t.effect, **fields[i]), hidden=hidden[i])  # type: ignore[type-var]
        if i in moved
        else t
        for i, t in enumerate(terms)
    ]
