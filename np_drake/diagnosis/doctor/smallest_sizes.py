"""Smallest sizes of effects that flights tell, beside nuisance and what they resemble."""

import dataclasses as dc
import math
from collections.abc import Sequence
from functools import reduce
from itertools import pairwise
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
from np_drake.diagnosis.residuals import FlightResiduals, find_outliers
from np_drake.diagnosis.selection.map_model import noise_of
from np_drake.effects.base import Parameter, correlation_root, usual_size
from np_drake.effects.library import LIBRARY, effect_of

TRACE_LENGTHS = np.geomspace(
    0.3, 1.5, 5
)  # of tethers at which an examination asks for a payload [m]; own choice
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
    `TRACE_LENGTHS`, a steady wind through the usual drag of such a vehicle.

    Gusts have none: they are a noise.
    """
    plain = library_candidates(flights)
    found = [_of_candidate(c, flights) for c in plain]
    wind = LIBRARY[WIND].parameters
    for c in wind_candidates(flights, plain)[:1]:
        columns = {n: X[..., 3:] for n, X in c.columns.items()}
        found.append(Trace(WIND, wind, tuple(p.typical for p in wind), columns))
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


def explain(
    flights: Sequence[FlightResiduals],
    nuisance: Sequence[Candidate],
    traces: Sequence[Trace],
    options: Options,
) -> tuple[list[FlightResiduals], NoiseModel, float | None]:
    """Fit all traces and the nuisance together, and return the flights with their outliers known,
    what is left as noise, and the mean lateral drag [N·s/m]; None where that is not told from zero.

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
    return list(flights), noise, _drag(mean, deviation, nuisance, traces)


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


DEVIATIONS = 3.0  # 99.7 %
RESEMBLES = (
    2.0  # factor by which another effect must widen the smallest size to be named [1]; own choice
)
MOST_BESIDE = 3  # effects that are named and modelled beside one [1]; own choice
NESTED = (
    1e-3  # share of a trace outside another's, below which it is a case of that [1]; own choice
)
SINGULAR = 1e-9  # share of the largest information below which there is none [1]


@dc.dataclass(frozen=True)
class Smallest:
    """Smallest sizes (k,) of the parameters of an effect, in their units: alone, and beside those
    it resembles.
    """

    identifier: str
    parameters: tuple[str, ...]
    alone: np.ndarray
    beside: np.ndarray
    resembles: tuple[str, ...]


class Information:
    """Whitened inner products of traces, less what nuisance parameters explain.

    Args:
        nuisance: nuisance columns, with prior N(0, 1).
    """

    def __init__(
        self,
        flights: Sequence[FlightResiduals],
        noise: NoiseModel,
        nuisance: Sequence[Candidate],
        traces: Sequence[Trace],
    ):
        self.traces = list(traces)
        blocks = [c.columns for c in nuisance] + [t.columns for t in traces]
        sizes = [next(iter(b.values())).shape[-1] for b in blocks]
        ends = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        total = np.zeros((ends[-1], ends[-1]))
        for e in flights:
            total += noise.products([e.bridged(b[e.name]) for b in blocks], e.name)
        n = int(ends[len(nuisance)])
        cross = np.linalg.solve(total[:n, :n] + np.eye(n), total[:n, n:])
        self._matrix = total[n:, n:] - total[:n, n:].T @ cross
        spans = list(pairwise(ends[len(nuisance) :] - n))
        self._at = {id(t): np.arange(*span) for t, span in zip(self.traces, spans, strict=True)}

    def deviations(self, trace: Trace, beside: Sequence[Trace] = ()) -> np.ndarray:
        """Return the deviation (k,) of a trace's coefficients over their usual size, beside others
        with their prior.

        Further columns of the trace itself have that prior too.
        """
        own, asked = self._at[id(trace)], len(trace.parameters)
        index = np.concatenate([own, *(self._at[id(t)] for t in beside)])
        prior = np.ones(len(index))
        prior[:asked] = 0.0
        A = self._matrix[np.ix_(index, index)] + np.diag(prior)
        left = A[:asked, :asked] - A[:asked, asked:] @ np.linalg.solve(
            A[asked:, asked:], A[asked:, :asked]
        )
        scale = np.sqrt(np.maximum(np.diag(self._matrix)[own[:asked]], 1e-12))
        unit = left / np.outer(scale, scale)
        values, vectors = np.linalg.eigh(0.5 * (unit + unit.T))
        variance = (vectors**2) @ (1 / np.maximum(values, SINGULAR))
        return np.sqrt(variance) / scale

    def inside(self, trace: Trace, other: Trace) -> bool:
        """Return whether a trace is that of an effect with more parameters, of which it is the
        simpler case.
        """
        if len(other.parameters) <= len(trace.parameters):
            return False
        a, b = self._at[id(trace)], self._at[id(other)]
        own, cross, theirs = (self._matrix[np.ix_(i, j)] for i, j in ((a, a), (a, b), (b, b)))
        if not np.trace(theirs) > 0:  # of a flight in which it leaves nothing
            return False
        ridge = SINGULAR * np.trace(theirs) * np.eye(len(b))
        left = np.diag(own - cross @ np.linalg.solve(theirs + ridge, cross.T))
        return bool(np.all(left < NESTED * np.diag(own)))


def smallest_sizes(information: Information) -> list[Smallest]:
    """Return the smallest sizes of all effects; of several variants, those of the variant that
    shows least.
    """
    known, found = nearest_usual(information.traces), []
    for main in known:
        variants = [t for t in information.traces if t.identifier == main.identifier]
        alone, near = _sizes(information, variants, ()), _sizes(information, [main], ())
        wider = []
        for other in known:
            if other is not main and not information.inside(main, other):
                ratio = float(np.max(_sizes(information, [main], [other]) / near))
                wider += [(ratio, other)] * (ratio > RESEMBLES)
        most = [t for _, t in sorted(wider, key=lambda pair: -pair[0])[:MOST_BESIDE]]
        beside = np.maximum(alone, _sizes(information, variants, most))
        names = tuple(p.name for p in main.parameters)
        like = tuple(t.identifier for t in most)
        found.append(Smallest(main.identifier, names, alone, beside, like))
    return found


def _sizes(
    information: Information, variants: Sequence[Trace], beside: Sequence[Trace]
) -> np.ndarray:
    """Return the smallest size (k,) of each parameter."""
    linear = [t for t in variants if t.size is None]
    if linear:
        sizes = [information.deviations(t, beside) * np.array(t.typical) for t in linear]
        return np.max(DEVIATIONS * np.array(sizes), axis=0)
    sizes = []
    for sign in (1, -1):
        at = {sign * (t.size or 0.0): t for t in variants}
        same = [size for size in sorted(at) if size > 0]
        if same:
            told = [max(float(information.deviations(at[s], beside)[0]), 1e-12) for s in same]
            sizes.append(_crossing(np.array(same), 1 / np.array(told)))
    return np.array([max(sizes)])


def _crossing(size: np.ndarray, told: np.ndarray) -> float:
    """Return the size at which a trace is `DEVIATIONS` long, given its length at some sizes: a
    power of the size.
    """
    x, y = np.log(size), np.log(np.maximum(told, 1e-9) / DEVIATIONS)
    if len(x) == 1:
        return float(size[0] * math.exp(-y[0]))
    above = np.flatnonzero(y >= 0)
    k = max(1, int(above[0])) if len(above) else len(x) - 1
    slope = (y[k] - y[k - 1]) / (x[k] - x[k - 1])
    return float(math.exp(x[k] - y[k] / max(slope, 0.3)))


def smallest_gust(noise: NoiseModel, seconds: float, time: float = 1.0) -> float:
    """Return the least deviation of a lateral force of gusts that is told from the noise [N].

    The log likelihood of a spectrum is a sum over independent frequencies (Whittle), and so is the
    information on the power of a first-order process.

    Args:
        seconds: length of all flights [s].
        time: correlation time of the force [s].
    """
    frequency = np.arange(1, max(2, int(0.4 / noise.step * seconds))) / seconds
    gust = (
        4 * time / (1 + (2 * np.pi * frequency * time) ** 2)
    )  # one-sided, of unit variance [1/Hz]
    information = sum(
        np.sum((gust / own) ** 2) for own in noise.spectrum(frequency)[:2] if own[0] > 0
    )
    return math.sqrt(DEVIATIONS / math.sqrt(information)) if information > 0 else math.inf


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
