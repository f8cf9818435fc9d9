"""Traces of effects in flights, as columns of a regression at usual sizes, and the noise that no
trace explains.
"""

import dataclasses as dc
import math
from collections.abc import Sequence
from functools import reduce
from operator import add

import numpy as np

from np_drake.diagnosis.numerics import NoiseModel, scale_only
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.regressors import (
    DRAG,
    PAYLOAD,
    WIND,
    Candidate,
    hidden_from,
    library_candidates,
    payloads_of,
    wind_candidates,
)
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals, find_outliers
from np_drake.diagnosis.residuals.residual_parts import CHANNELS
from np_drake.diagnosis.selection.conditioning import noise_of
from np_drake.effects.base import Parameter, correlation_root
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.library import LIBRARY, effect_of
from np_drake.effects.parameter import usual_size

TRACE_LENGTHS = np.geomspace(
    0.3, 1.5, 5
)  # of tethers at which an examination asks for a payload [m]; own choice
GUSTS = GustyWind.identifier
LEAST_DRAG = 2.0  # posterior deviations from which a drag is taken as that of the vehicle [1]


@dc.dataclass(frozen=True)
class Trace:
    """Columns (m, 15, k) by flight of one variant of an effect, for parameters at their usual size.

    parameters: of the first columns; further columns are free beside them and not asked for.
    typical: usual size of each.
    sizes: for an effect that is not linear, the size at which its trace is predicted, in the
        parameter's unit; None:
    it is linear.
    """

    identifier: str
    parameters: tuple[Parameter, ...]
    typical: tuple[float, ...]
    columns: dict[str, np.ndarray]
    size: float | None = None


def traces(flights: Sequence[FlightResiduals], priors: Priors) -> list[Trace]:
    """Return the traces of all variants of all effects that such logs can show; payloads at
    `TRACE_LENGTHS`.

    Gusts have none: they are a noise.
    """
    plain = library_candidates(flights)
    found = [_of_candidate(c, flights) for c in plain]
    for c in wind_candidates(flights, plain)[:1]:
        found.append(_of_wind(c, flights))
    return found + payload_traces(flights, TRACE_LENGTHS, priors)


def _of_candidate(c: Candidate, flights: Sequence[FlightResiduals]) -> Trace:
    (identifier,) = c.identifiers
    effect = effect_of(identifier)
    free = tuple(p for p in effect.parameters if not p.choices)
    vehicle = flights[0].vehicle
    usual = tuple(usual_size(p, vehicle) for p in free)
    if effect.linear or len(free) < len(effect.parameters) or not effect.grid(vehicle):
        alone = np.linalg.inv(correlation_root(effect))  # each parameter by itself
        return Trace(identifier, free, usual, {n: X @ alone for n, X in c.columns.items()})
    values = next(iter(c.terms(np.array([0.5])))).effect.values
    size = values[free[0].name] - free[0].neutral
    half = {
        n: 0.5 * X for n, X in c.columns.items()
    }  # at that size; a coefficient of one half stands for it
    return Trace(identifier, free[:1], (usual[0],), half, size)


def _of_wind(c: Candidate, flights: Sequence[FlightResiduals]) -> Trace:
    """Return the trace of a steady wind through the usual drag of such a vehicle."""
    wind = LIBRARY[WIND].parameters
    columns = {n: X[..., 3:] for n, X in c.columns.items()}
    return Trace(WIND, wind, tuple(p.typical for p in wind), columns)


def payload_traces(
    flights: Sequence[FlightResiduals], lengths: np.ndarray, priors: Priors
) -> list[Trace]:
    """Return the traces of payloads on tethers of these lengths; none where library or flights tell
    none.

    Args:
        lengths: (k,) of the tethers [m].
    """
    if PAYLOAD not in LIBRARY or PAYLOAD in hidden_from(flights):
        return []
    mass, found = LIBRARY[PAYLOAD].parameters[:1], []
    usual = usual_size(mass[0], flights[0].vehicle)
    for payload in payloads_of(flights, lengths, priors):
        columns = payload.candidate(flights).columns
        for X in columns.values():
            X[..., 0] *= usual / payload.unit
        found.append(Trace(PAYLOAD, mass, (usual,), columns))
    return found


def nearest_usual(found: Sequence[Trace]) -> list[Trace]:
    """Return one trace of each effect: of those that are not linear, the one nearest its usual
    size.
    """
    best: dict[str, tuple[float, Trace]] = {}
    for trace in found:
        away = 0.0 if trace.size is None else abs(math.log(abs(trace.size) / trace.typical[0]))
        if trace.identifier not in best or away < best[trace.identifier][0]:
            best[trace.identifier] = (away, trace)
    return [trace for _, trace in best.values()]


@dc.dataclass(frozen=True)
class Explained:
    """Flights with their outliers known, the noise model of what no effect explains, and the drag
    of the vehicle.

    floor: by channel of the wrench, RMS of what no effect explains [N, N·m].
    drag: mean lateral drag that explains them best [N·s/m]; None where it is not told from zero.
    """

    flights: list[FlightResiduals]
    noise: NoiseModel
    floor: dict[str, float]
    drag: float | None


def explain(
    flights: Sequence[FlightResiduals],
    nuisance: Sequence[Candidate],
    traces: Sequence[Trace],
    options: Options,
) -> Explained:
    """Fit all traces and the nuisance together, and return what is left as noise.

    An effect that is in the logs does not count as noise; what no effect explains does.

    Args:
        nuisance: nuisance columns, with prior N(0, 1).
        options: tolerances of sensors, and the share of a linear prediction that is wrong.
    """
    blocks = [c.columns for c in nuisance] + [t.columns for t in traces]
    step = flights[0].grid.step
    _, _, residual = _fitted(flights, blocks, scale_only([e.y for e in flights], step))
    flights = [
        dc.replace(e, outliers=find_outliers(r, step))
        for e, r in zip(flights, residual, strict=True)
    ]
    channels = [e.bridged(e.y) for e in flights]
    _, _, residual = _fitted(flights, blocks, scale_only(channels, step))
    noise = noise_of(flights, residual, channels, options, options.priors.linear_error)
    mean, deviation, residual = _fitted(flights, blocks, noise)
    noise = noise_of(flights, residual, channels, options, options.priors.linear_error)
    floor = {name: float(noise.rms[WRENCH][c]) for c, name in enumerate(CHANNELS)}
    return Explained(list(flights), noise, floor, _drag(mean, deviation, nuisance, traces))


def _fitted(
    flights: Sequence[FlightResiduals], blocks: Sequence[dict[str, np.ndarray]], noise: NoiseModel
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Return coefficients (k,), their deviations, and by flight the residual (m, 15) without
    outliers.
    """
    total = reduce(add, (e.gram(noise, [b[e.name] for b in blocks]) for e in flights))
    mean, covariance = total.posterior(np.arange(len(total.Xy)))
    sizes = [next(iter(b.values())).shape[-1] for b in blocks]
    parts = np.split(mean, np.cumsum(sizes)[:-1])
    residual = [
        e.bridged(e.y - sum(b[e.name] @ part for b, part in zip(blocks, parts, strict=True)))
        for e in flights
    ]
    return mean, np.sqrt(np.diag(covariance)), residual


def _drag(mean, deviation, nuisance: Sequence[Candidate], traces: Sequence[Trace]) -> float | None:
    at = sum(c.size for c in nuisance)
    for trace in traces:
        if trace.identifier == DRAG:
            weight = deviation[at : at + 2] ** -2.0
            size = float(weight @ mean[at : at + 2] / weight.sum())
            return size * trace.typical[0] if size > LEAST_DRAG * weight.sum() ** -0.5 else None
        at += next(iter(trace.columns.values())).shape[-1]
    return None
