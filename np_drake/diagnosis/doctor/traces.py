"""Traces of effects in flights: columns of a regression at usual sizes for the vehicle, by effect."""

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors import (
    PAYLOAD,
    WIND,
    Candidate,
    PayloadColumns,
    library_candidates,
    payloads_of,
    wind_candidates,
)
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.effects.base import Parameter
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.library import LIBRARY, effects_for
from np_drake.effects.parameter import usual_size
from np_drake.effects.parameter_prior import correlation_root

GUSTS = GustyWind.identifier
LENGTHS = np.geomspace(0.3, 1.5, 5)  # of the tethers at which a payload is asked for [m]; own choice


@dc.dataclass(frozen=True)
class Trace:
    """Columns (m, 15, k) by flight of one variant of an effect, for parameters at their usual size.

    parameters: of the first columns; further columns are free beside them and not asked for.
    typical: usual size of each.
    sizes: for an effect that is not linear, the size at which its trace is predicted, in the parameter's unit; None:
    it is linear.
    """

    identifier: str
    parameters: tuple[Parameter, ...]
    typical: tuple[float, ...]
    columns: dict[str, np.ndarray]
    size: float | None = None


def traces(flights: Sequence[FlightResiduals], priors: Priors) -> list[Trace]:
    """Return the traces of all variants of all effects that such logs can show; payloads at `LENGTHS`.

    Gusts have none: they are a noise.
    """
    plain = library_candidates(flights)
    found = [_of_candidate(c, flights) for c in plain]
    for c in wind_candidates(flights, plain)[:1]:
        found.append(_of_wind(c, flights))
    return found + _of_payloads(flights, priors)


def _of_candidate(c: Candidate, flights: Sequence[FlightResiduals]) -> Trace:
    (identifier,) = c.identifiers
    effect = effects_for(flights[0].log.input)[identifier]
    free = tuple(p for p in effect.parameters if not p.choices)
    vehicle = flights[0].vehicle
    usual = tuple(usual_size(p, vehicle) for p in free)
    if effect.linear or len(free) < len(effect.parameters) or not effect.grid(vehicle):
        alone = np.linalg.inv(correlation_root(effect))  # each parameter by itself
        return Trace(identifier, free, usual, {n: X @ alone for n, X in c.columns.items()})
    values = next(iter(c.terms(np.array([0.5])))).effect.values
    size = values[free[0].name] - free[0].neutral
    half = {n: 0.5 * X for n, X in c.columns.items()}  # at that size; a coefficient of one half stands for it
    return Trace(identifier, free[:1], (usual[0],), half, size)


def _of_wind(c: Candidate, flights: Sequence[FlightResiduals]) -> Trace:
    """Return the trace of a steady wind through the usual drag of such a vehicle."""
    wind = LIBRARY[WIND].parameters
    columns = {n: X[..., 3:] for n, X in c.columns.items()}
    return Trace(WIND, wind, tuple(p.typical for p in wind), columns)


def _of_payloads(flights: Sequence[FlightResiduals], priors: Priors) -> list[Trace]:
    if PAYLOAD not in LIBRARY:
        return []
    return [_of_payload(payload, flights) for payload in payloads_of(flights, LENGTHS, priors)]


def payload_at(flights: Sequence[FlightResiduals], length: float, priors: Priors) -> Trace:
    """Return the trace of a payload on a tether of this length [m]."""
    (payload,) = payloads_of(flights, np.array([length]), priors)
    return _of_payload(payload, flights)


def _of_payload(payload: PayloadColumns, flights: Sequence[FlightResiduals]) -> Trace:
    mass = LIBRARY[PAYLOAD].parameters[:1]
    usual = usual_size(mass[0], flights[0].vehicle)
    columns = {}
    for e in flights:
        X = np.zeros((*e.y.shape, payload.size))
        X[:, WRENCH][..., payload.at(e.name)] = payload.own[e.name]
        X[..., 0] *= usual / payload.unit
        columns[e.name] = X
    return Trace(PAYLOAD, mass, (usual,), columns)


def nearest_usual(found: Sequence[Trace]) -> list[Trace]:
    """Return one trace of each effect: of those that are not linear, the one nearest its usual size."""
    best: dict[str, tuple[float, Trace]] = {}
    for trace in found:
        away = 0.0 if trace.size is None else abs(math.log(abs(trace.size) / trace.typical[0]))
        if trace.identifier not in best or away < best[trace.identifier][0]:
            best[trace.identifier] = (away, trace)
    return [trace for _, trace in best.values()]
