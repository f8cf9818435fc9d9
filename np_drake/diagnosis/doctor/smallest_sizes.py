"""Smallest size of each effect that logs can tell from zero, beside nuisance parameters and the
effects it resembles.

With whitened columns X of an effect and N of the nuisance (prior N(0, 1)), the information on its
parameters is X'X - X'N (N'N + 1)^-1 N'X. Three deviations of the inverse are the smallest size at
99.7 %. An effect that is not linear is told where the trace that it leaves at a size is three
deviations long.

Source: Cramér-Rao bound of linear regression with Gaussian priors on nuisance parameters.
"""

import dataclasses as dc
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from np_drake.diagnosis.doctor.traces import Trace, nearest_usual
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.regressors import Candidate
from np_drake.diagnosis.residuals import FlightResiduals

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
    known = nearest_usual(information.traces)
    found = []
    for main in known:
        name = main.identifier
        variants = [t for t in information.traces if t.identifier == name]
        others = [t for t in known if t.identifier != name]
        alone = _sizes(information, variants, ())
        wider = {}
        for other in others:
            if information.inside(main, other):
                continue
            ratio = float(
                np.max(_sizes(information, [main], [other]) / _sizes(information, [main], ()))
            )
            if ratio > RESEMBLES:
                wider[other.identifier] = ratio, other
        most = sorted(wider.values(), key=lambda pair: -pair[0])[:MOST_BESIDE]
        beside = np.maximum(alone, _sizes(information, variants, [t for _, t in most]))
        names = tuple(p.name for p in main.parameters)
        found.append(Smallest(name, names, alone, beside, tuple(t.identifier for _, t in most)))
    return found


def _sizes(
    information: Information, variants: Sequence[Trace], beside: Sequence[Trace]
) -> np.ndarray:
    """Return the smallest size (k,) of each parameter."""
    linear = [t for t in variants if t.size is None]
    if linear:
        each = [
            DEVIATIONS * information.deviations(t, beside) * np.array(t.typical) for t in linear
        ]
        return np.max(each, axis=0)
    sizes = []
    for sign in (1, -1):
        same = sorted(
            (t for t in variants if sign * float(t.size or 0) > 0), key=lambda t: abs(t.size or 0.0)
        )
        if same:
            at = np.array([abs(t.size or 0.0) for t in same])
            told = np.array(
                [1 / max(float(information.deviations(t, beside)[0]), 1e-12) for t in same]
            )
            sizes.append(_crossing(at, told))
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
