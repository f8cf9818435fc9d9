"""Log evidence and coefficients that a payload adds to other candidates."""

import dataclasses as dc
import math
from collections.abc import Sequence
from functools import reduce
from operator import add

import numpy as np

from np_drake.diagnosis.forward_model import jumps
from np_drake.diagnosis.numerics import Gram, NoiseModel
from np_drake.diagnosis.regressors import (
    AT_REST,
    SHAPE,
    Candidate,
    Onset,
    PayloadColumns,
    heavy_enough,
)
from np_drake.diagnosis.residuals import FlightResiduals, bridge

CHANNELS = 6  # force and torque alone see a payload
HORIZONS = (5.0, 10.0, math.inf)  # over which a guess is followed, one after the other [s]
AFTER_OUTLIER = 2.0  # a horizon of its own, for the swing that an outlier leaves [s]


@dc.dataclass(frozen=True)
class WhitenedPayload:
    """Whitened columns of a payload, flight by flight, and its log prior.

    columns: (rows x channels, k') by flight; at: (k',) their positions among all `size` of them.
    """

    columns: list[np.ndarray]
    at: list[np.ndarray]
    size: int
    log_prior: float


class OtherRegressors:
    """The columns of others, whitened, with their Gram matrices up to each horizon.

    Args:
        onset: onsets of the payload by flight [s].
        horizons: up to which a payload is followed [s]; default: `HORIZONS` and after outliers.
    """

    def __init__(
        self,
        flights: Sequence[FlightResiduals],
        noise: NoiseModel,
        others: Sequence[Candidate],
        onset: Onset | None,
        horizons: Sequence[float] = (),
    ):
        self._flights, self._noise, self._onset = list(flights), noise.head(CHANNELS), onset or {}
        self._heads: dict[float, list[FlightResiduals]] = {}
        self._white = []
        for e in flights:
            y = e.y[:, :CHANNELS, None]
            X = np.concatenate(
                [y[..., :0], *(c.columns[e.name][: len(y), :CHANNELS] for c in others)], axis=-1
            )
            self._white.append((self._flat(e, X), self._flat(e, y)[:, 0]))
        self.horizons = sorted({*(horizons or (*HORIZONS, *self._after_outliers()))})
        self._base = {horizon: self._gram(horizon) for horizon in self.horizons}

    @property
    def size(self) -> int:
        """Number of columns of the others."""
        return self._white[0][0].shape[1]

    def heads(self, horizon: float) -> list[FlightResiduals]:
        """Return the flights up to the horizon [s]."""
        if horizon not in self._heads:
            ends = [int(np.searchsorted(e.t, self._begin(e) + horizon)) for e in self._flights]
            self._heads[horizon] = [e.head(end) for e, end in zip(self._flights, ends, strict=True)]
        return self._heads[horizon]

    def _begin(self, e: FlightResiduals) -> float:
        return max(self._onset.get(e.name) or 0.0, e.t[0])

    def _after_outliers(self) -> list[float]:
        """Seconds after the payload's begin by which a jump shows, those that are close to one
        another once.
        """
        found = [(e, k) for e in self._flights for k in jumps(e, self._onset.get(e.name))]
        ends = sorted(float(e.t[k] - self._begin(e) + AFTER_OUTLIER) for e, k in found)
        later = [*ends[1:], math.inf]
        return [end for end, following in zip(ends, later, strict=False) if following - end > 1.0]

    def _rows(self, e: FlightResiduals, horizon: float) -> int:
        """Whitened rows times channels until the horizon after the payload's begin."""
        end = self._begin(e) + horizon
        skipped = self._noise.phi.shape[1]
        return max(0, int(np.searchsorted(e.t, end)) - skipped) * CHANNELS

    def _gram(self, horizon: float) -> tuple[Gram, float]:
        """Gram matrix of the others and their log evidence."""
        parts = []
        for e, (X, y) in zip(self._flights, self._white, strict=True):
            n = self._rows(e, horizon)
            parts.append(Gram(X[:n].T @ X[:n], X[:n].T @ y[:n]))
        total = reduce(add, parts)
        return total, total.log_evidence(np.arange(len(total.Xy)))

    def white(self, payload: PayloadColumns) -> WhitenedPayload:
        """Return the payload's columns whitened, of the flights or of `heads`."""
        own = [self._flat(e, payload.own[e.name]) for e in self._flights]
        at = [payload.at(e.name) for e in self._flights]
        return WhitenedPayload(own, at, payload.size, payload.log_prior)

    def gain(self, candidate: WhitenedPayload, horizon: float) -> tuple[float, np.ndarray]:
        """Return the log evidence that the candidate adds, priors included, and its physical
        coefficients.

        Args:
            horizon: up to which rows count, from the payload's begin on [s].
        """
        (both,), n = self.joints(candidate, [horizon]), self.size
        mean, covariance = both.posterior(np.arange(len(both.Xy)))
        mean, log_probability = heavy_enough(mean[n:], covariance[n:, n:])
        return self.gain_of(both, candidate, horizon) + log_probability, mean

    def gain_of(self, both: Gram, candidate: WhitenedPayload, horizon: float) -> float:
        """Return the log evidence alone, of one of the candidate's `joints`.

        Args:
            horizon: up to which rows count, from the payload's begin on [s].
        """
        evidence = both.log_evidence(np.arange(len(both.Xy))) - self._base[horizon][1]
        return evidence + candidate.log_prior

    def swing_alone(self, candidate: WhitenedPayload, horizon: float, mass: float) -> np.ndarray:
        """Return (k,) coefficients of a `shaped` payload with the mass given; hook, length and
        damping stay.

        Args:
            horizon: up to which rows count, from the payload's begin on [s].
        """
        (both,), n = self.joints(candidate, [horizon]), self.size
        first = AT_REST + SHAPE
        free = np.r_[:n, n + first : len(both.Xy)]
        residual = Gram(both.XX, both.Xy - both.XX[:, n] * mass)
        fixed = np.concatenate([[mass], np.zeros(first - 1)])
        return np.concatenate([fixed, residual.posterior(free)[0][n:]])

    def joints(self, candidate: WhitenedPayload, horizons: Sequence[float]) -> list[Gram]:
        """Return Gram matrices of others and candidate up to these horizons [s], from one pass over
        the rows.

        Args:
            horizons: [s].
        """
        n, k = self.size, candidate.size
        PX, PP, Py = np.zeros((k, n)), np.zeros((k, k)), np.zeros(k)
        done = dict.fromkeys((e.name for e in self._flights), 0)
        found = {}
        for horizon in sorted(horizons):
            for e, (X, y), columns, some in zip(
                self._flights, self._white, candidate.columns, candidate.at, strict=True
            ):
                rows = slice(done[e.name], self._rows(e, horizon))
                P = columns[rows]
                PX[some] += P.T @ X[rows]
                PP[np.ix_(some, some)] += P.T @ P
                Py[some] += P.T @ y[rows]
                done[e.name] = rows.stop
            base, _ = self._base[horizon]
            XX = np.block([[base.XX, PX.T], [PX, PP]])
            found[horizon] = Gram(XX, np.concatenate([base.Xy, Py]))
        return [found[horizon] for horizon in horizons]

    def _flat(self, e: FlightResiduals, values: np.ndarray) -> np.ndarray:
        """Return (rows x channels, k) force and torque (m, 6, k), of the first m rows, whitened."""
        white = self._noise.whiten(bridge(values, e.outliers[: len(values)]))
        return white.reshape(len(white) * CHANNELS, values.shape[-1])
