"""Bayesian regression of flights on candidates: evidence of sets of them, and columns that begin in
flight.
"""

import dataclasses as dc
from collections.abc import Iterable, Sequence
from functools import cached_property, reduce
from itertools import pairwise
from operator import add
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.regressors.library_regressors import LINEAR, Candidate
from np_drake.diagnosis.residuals import SIZE, FlightResiduals
from np_drake.effects.library import LIBRARY, effect_of
from np_drake.estimation.noise import NoiseModel
from np_drake.estimation.regression import Gram, places


def prior_of(identifiers: Iterable[str], priors: Priors) -> float:
    """Return the log prior of a set of effects.

    An effect through which another acts, as a wind through drag, adds no cost.
    Source: own choice.
    """
    named = set(identifiers)
    needs = [LIBRARY[name].needs for name in named if name in LIBRARY]
    implied = {next((name for name in alternatives if name in named), "") for alternatives in needs}
    return sum(priors.of_effect(name) for name in named - implied)


class WhiteNuisance:
    """Linear nuisance of some flights, whitened.

    columns: by flight, those that act there (rows, k'), and their positions (k',) among all.
    gram: (k, k) over all flights, with the prior. rows: by flight, of the whitened residual.

    Args:
        root: factor on whitened values [1].
    """

    def __init__(
        self,
        flights: Sequence[FlightResiduals],
        linear: Sequence[Candidate],
        noise: NoiseModel,
        root: float,
    ):
        self.gram = np.eye(sum(c.size for c in linear))
        self.columns: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.rows: dict[str, slice] = {}
        first = 0
        order = noise.phi.shape[1]
        for flight in flights:
            parts = [flight.y[..., None][..., :0], *(c.columns[flight.name] for c in linear)]
            columns = np.concatenate(parts, axis=-1)
            at = np.flatnonzero(columns.any(axis=(0, 1)))
            last = first + (len(flight.t) - order) * noise.phi.shape[0]
            X = root * flight.white(noise, columns[..., at]).reshape(last - first, len(at))
            self.rows[flight.name] = slice(first, last)
            first = last
            self.columns[flight.name] = X, at
            self.gram[np.ix_(at, at)] += X.T @ X


@dc.dataclass(frozen=True)
class Model:
    """Set of candidates by position, with its log evidence over the empty model, prior included."""

    members: tuple[int, ...]
    score: float


class RegressionProblem:
    """Whitened flights with candidates as columns, whose Gram matrix is computed on first use.

    Args:
        nuisance: candidates that every model has (calibration within its tolerance).
        temperature: factor on the noise variance [1].
    """

    def __init__(
        self,
        flights: Sequence[FlightResiduals],
        noise: NoiseModel,
        nuisance: list[Candidate],
        candidates: list[Candidate],
        *,
        temperature: float,
        options: Options,
    ):
        self.flights = list(flights)
        self.noise = noise
        self.temperature = temperature
        self.nuisance = nuisance
        self.candidates = candidates
        self.options = options
        self._columns = [np.r_[at] for at in places(c.size for c in (*nuisance, *candidates))]
        self._nuisance = sum(c.size for c in nuisance)
        self.linear = [c for c in nuisance if c.variant == LINEAR]
        self._white: tuple[NoiseModel, WhiteNuisance] | None = None

    def white_nuisance(self, noise: NoiseModel) -> WhiteNuisance:
        """Return the linear nuisance whitened by a noise model; that of the last one is kept."""
        if self._white is None or self._white[0] is not noise:
            root = self.temperature**-0.5
            self._white = noise, WhiteNuisance(self.flights, self.linear, noise, root)
        return self._white[1]

    @cached_property
    def total(self) -> Gram:
        """Gram matrix of nuisance and candidates over all flights."""
        grams = (
            flight.gram(
                self.noise, [c.columns[flight.name] for c in (*self.nuisance, *self.candidates)]
            )
            for flight in self.flights
        )
        return reduce(add, grams).tempered(self.temperature)

    @cached_property
    def _rest(self) -> Gram:
        """Gram matrix of the candidates with all nuisance in every model."""
        return self.total.given(self._nuisance)

    def extended(
        self, more: Sequence[Candidate], noise: NoiseModel | None = None
    ) -> "RegressionProblem":
        """Return the problem with more candidates, after the present ones; noise: another one."""
        return RegressionProblem(
            self.flights,
            noise or self.noise,
            self.nuisance,
            [*self.candidates, *more],
            temperature=self.temperature,
            options=self.options,
        )

    def columns_of(self, member: int) -> np.ndarray:
        """Return the column indices of one candidate."""
        return self._columns[len(self.nuisance) + member]

    def columns(self, members: Sequence[int]) -> np.ndarray:
        """Return the column indices of the nuisance and the members."""
        return np.concatenate([np.arange(self._nuisance), *(self.columns_of(i) for i in members)])

    def score(self, members: Sequence[int]) -> float:
        """Return the log evidence plus log prior of a set [nat]."""
        return self.scores([members])[0]

    def scores(self, sets: Sequence[Sequence[int]]) -> list[float]:
        """Return `score` of many sets, solved together."""
        priors = np.array([self._log_prior(members) for members in sets]) + self._log_probability(
            sets
        )
        possible = np.flatnonzero(np.isfinite(priors)).tolist()
        evidence = np.zeros(len(sets))
        evidence[possible] = self._rest.evidence_of_sets(
            [[self.columns_of(k) - self._nuisance for k in sets[i]] for i in possible],
            [[self.candidates[k].widens for k in sets[i]] for i in possible],
        )
        return (evidence + priors).tolist()

    def deviations(self, member: int, others: Sequence[int]) -> np.ndarray:
        """Return the deviation (k,) of a candidate's coefficients as the flights alone tell them,
        beside nuisance and some members.
        """
        index = np.concatenate([self.columns_of(i) for i in (*others, member)]) - self._nuisance
        XX = self._rest.XX[np.ix_(index, index)]
        marginal = Gram(XX, np.zeros(len(XX))).given(len(XX) - self.candidates[member].size).XX
        return np.sqrt(np.diag(np.linalg.pinv(marginal)))

    def onset_prior(self, model: Model) -> float:
        """Return the log prior of the onsets of a model."""
        return sum(self.candidates[i].onset_prior for i in model.members)

    def _log_prior(self, members: Sequence[int]) -> float:
        chosen = [self.candidates[i] for i in members]
        return prior_of(
            {name for c in chosen for name in c.identifiers}, self.options.priors
        ) + sum(c.log_prior + c.onset_prior for c in chosen)

    def _log_probability(self, sets: Sequence[Sequence[int]]) -> np.ndarray:
        """Return the log probability (n,) under the posterior that all members of each set are
        physical.
        """
        total = np.zeros(len(sets))
        constrained = [
            k for k, members in enumerate(sets) if any(self.candidates[i].physical for i in members)
        ]
        posteriors = self._rest.posteriors(
            [self.columns(sets[k])[self._nuisance :] - self._nuisance for k in constrained]
        )
        for k, (mean, covariance) in zip(constrained, posteriors, strict=True):
            chosen = [self.candidates[i] for i in sets[k]]
            for c, columns in zip(chosen, places(c.size for c in chosen), strict=True):
                total[k] += (
                    c.physical(mean[columns], covariance[columns, columns])[1]
                    if c.physical
                    else 0.0
                )
        return total

    def fits_together(self, members: Sequence[int]) -> bool:
        """Return whether no effect occurs twice, nor is calibrated already, and at most one is a
        pure delay.
        """
        names = [name for i in members for name in self.candidates[i].identifiers]
        return (
            not any(self.candidates[i].calibrated for i in members)
            and len(names) == len(set(names))
            and sum(effect_of(name).pure_delay for name in names) < 2
        )


class Sums(NamedTuple):
    """Sums over whitened rows of one flight for columns X.

    XX: (n, k, k) X'X. XB: (n, k, b') X'B, of the columns of B that act in the flight. Xy: (n, k)
        X'y. at: (b',) positions of these columns among all of B.
    """

    XX: np.ndarray
    XB: np.ndarray
    Xy: np.ndarray
    at: np.ndarray

    def rows(self, index: Any) -> "Sums":
        """Return the sums of some rows alone."""
        return Sums(self.XX[index], self.XB[index], self.Xy[index], self.at)

    def joined(self, others: "Sums", order: Any = slice(None)) -> "Sums":
        """Return these rows and others, in an order."""
        XX, XB, Xy = (
            np.concatenate(pair)[order] for pair in list(zip(self, others, strict=True))[:3]
        )
        return Sums(XX, XB, Xy, self.at)


class SwitchedRegressors:
    """Sums over the whitened rows of one flight, for columns X that begin at any of them.

    Target y (m', 15) and columns B (m', 15, b) that act as well are not whitened yet. t (m,): times
    of the whitened rows [s]. at (b',): positions of the columns of B that act in the flight.

    Args:
        target: (m', 15) channels y.
        others: groups (m', 15, b_i) of the columns B.
        scale: factor on whitened values [1].
    """

    def __init__(
        self,
        flight: FlightResiduals,
        noise: NoiseModel,
        target: np.ndarray,
        others: Sequence[np.ndarray] = (),
        scale=1.0,
    ):
        self._flight = flight
        self._noise = noise
        self._scale = scale
        self._order = noise.phi.shape[1]
        self.t = flight.t[self._order :]
        self._rise = flight.rise()
        # Whitened rows about an onset in which switched and whole columns differ: they begin half
        # a rise before it.
        self._near = len(self._rise) + self._order
        both = [flight.bridged(X) for X in (*others, target[..., None])]
        driven = noise.driven(both, flight.name)
        last = sum(X.shape[-1] for X in others)
        acting = np.unique(np.concatenate([[last], *(at for _, at, _ in driven)]))
        self.at = acting[:-1]
        # Innovations times `_facing` (15, m, b' + 1) equal whitened values times whitened B and y;
        # rows beyond either end are zero.
        half = len(self._rise) // 2
        m = len(self.t)
        padded = np.zeros((target.shape[1], half + m + half + self._order, len(acting)))
        self._facing = padded[:, half : half + m]
        self._windows = sliding_window_view(padded, self._near, axis=1)
        for c, at, part in driven:
            column = np.searchsorted(acting, at)
            for d in np.flatnonzero(noise.weight[c]):
                self._facing[d][:, column] += scale * noise.weight[c, d] * part

    def suffix_sums(self, X: np.ndarray, known: np.ndarray | None = None) -> Sums:
        """Return the sums for columns (m', 15, k) over all rows from each row (m + 1) on, without a
        jump there.

        Args:
            known: coefficients (b',) of B, which y is then without; None: not known.
        """
        facing = self._facing
        if known is not None:
            facing = (facing @ np.append(-known, 1.0))[..., None]
        channels = self._channels(X)
        driven, weighted = self._driven(channels, self._flight.bridged(X[:, channels]))
        by_row = driven.transpose(1, 2, 0)  # (m, k, c), c active channels
        # (m, k, k) and (m, k, b' + 1) products of each row, then sums from each row on (m + 1, …)
        XX, XBy = (by_row @ np.swapaxes(a, 0, 1) for a in (weighted, facing[channels]))
        XX, XBy = (np.concatenate([np.cumsum(a[::-1], axis=0)[::-1], 0 * a[:1]]) for a in (XX, XBy))
        return Sums(XX, XBy[..., :-1], XBy[..., -1], self.at)

    def begun(self, X: np.ndarray, suffix: Sums, rows: np.ndarray) -> Sums:
        """Return the sums for columns (m', 15, k) switched on at each of `rows`, smeared by the
        grid.

        Args:
            X: (m', 15, k) columns.
            suffix: their sums from `suffix_sums`.
            rows: (n,) whitened rows at which they begin.
        """
        half = len(self._rise) // 2
        order = self._order
        m = len(self.t)
        # Rows about an onset: l of the grid, and l - p whitened ones. c: active channels.
        offsets = np.arange(-half - order, half + order + 1)  # (l,)
        gate = np.concatenate([np.zeros((order, SIZE)), self._rise, np.ones((order, SIZE))])
        near = np.clip(rows + order + offsets[:, None], 0, len(X) - 1)  # (l, n) rows of X
        channels = self._channels(X)  # (c,)
        # (l, n, c, k) columns that begin at each of the onsets
        late = self._flight.bridged(X[:, channels])[near] * gate[:, None, channels, None]
        row = rows - half + np.arange(self._near)[:, None]  # (l - p, n) whitened rows
        there = ((row >= 0) & (row < m))[..., None]
        driven, weighted = (  # (c, n, k, l - p)
            np.where(there, part, 0.0).transpose(0, 2, 3, 1)
            for part in self._driven(channels, np.moveaxis(late, 2, 1))
        )
        XX, XB, Xy, at = suffix.rows(np.clip(rows - half + self._near, 0, m))
        XX += np.sum(driven @ np.swapaxes(weighted, 2, 3), axis=0)
        for part, c in zip(driven, channels, strict=True):
            XBy = part @ np.swapaxes(self._windows[c][rows], 1, 2)  # (n, k, b' + 1)
            XB += XBy[..., :-1]
            Xy += XBy[..., -1]
        return Sums(XX, XB, Xy, at)

    def _channels(self, X: np.ndarray) -> np.ndarray:
        """Return the active channels in which a column is not zero."""
        return np.flatnonzero(self._noise.active & X.any(axis=(0, 2)))

    def _driven(self, channels: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the innovations (a, m - p, ...) of the channels (a,), for values (m, a, ...), and
        these times the inverse of their covariance.
        """
        parts = [
            self._noise.driven_in(c, values[:, i], self._flight.name)
            for i, c in enumerate(channels.tolist())
        ]
        shape = (len(parts), len(values) - self._order, *values.shape[2:])
        innovations = self._scale * np.reshape(parts, shape)
        return innovations, np.tensordot(
            self._noise.weight[np.ix_(channels, channels)], innovations, 1
        )


def onset_log_likelihood(
    flight: FlightResiduals,
    noise: NoiseModel,
    target: np.ndarray,
    prediction: np.ndarray,
    sizes: Sequence[float] = (1.0,),
    cost: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (n,) times of the grid, the last one `NEVER`, log likelihoods if `prediction` begins
    there, and the rows at which it then changes (`ordered_changes`).

    Args:
        target: (m, 15) residual without the effect.
        prediction: (m, 15) what the effect leaves.
        sizes: of `prediction` from its begin on, and after each change [1].
        cost: log likelihood that a change must bring.
    """
    columns = SwitchedRegressors(flight, noise, target)
    t = columns.t
    X = prediction[..., None]
    suffix = columns.suffix_sums(X)
    begun = columns.begun(X, suffix, np.arange(1, len(t)))
    XX, Xy = (
        np.concatenate([a[:1], b, 0 * a[:1]])
        for a, b in ((suffix.XX[..., 0], begun.XX[..., 0]), (suffix.Xy, begun.Xy))
    )
    times = np.append(t, NEVER)
    barred = (times < t[0] + 0.3) & (times > t[0])
    return times, *ordered_changes(XX[:, 0], Xy[:, 0], sizes, cost, barred)


def ordered_changes(
    XX: np.ndarray, Xy: np.ndarray, sizes: Sequence[float], cost: float, barred: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (n,) log likelihoods if a column begins at a row and changes as is best from then on,
    and (k, n) the rows of those changes: of each, if the one before it is at a row.

    Args:
        XX: (n,) X'X over all whitened rows from each row on; the last row is none.
        Xy: (n,) X'y over the same.
        sizes: (k + 1,) of the column from its begin on, and after each change [1].
        cost: log likelihood that a change must bring.
        barred: (n,) rows at which nothing begins or changes.
    Source: dynamic programming over ordered rows.
    """
    following = list[np.ndarray]()
    later = np.zeros(len(XX))
    last = len(XX) - 1
    for k in reversed(range(len(sizes))):
        before = ([0.0, *sizes])[k]
        size = sizes[k]
        gain = (size - before) * Xy - 0.5 * (size**2 - before**2) * XX + later
        gain[:-1] -= cost * (k > 0)
        gain[barred] = -np.inf
        later = np.maximum.accumulate(gain[::-1])[::-1]
        first = np.where(gain >= later, np.arange(len(gain)), last)
        following.insert(0, np.minimum.accumulate(first[::-1])[::-1])
    return gain, np.array(following[1:], int).reshape(len(sizes) - 1, len(XX))


def times_of_changes(t: np.ndarray, following: np.ndarray, first: int) -> tuple[float, ...]:
    """Return the times of changes [s] after a begin at row `first`; infinite: one that the next
    overtakes.

    Args:
        t: (n,) times [s], the last one `NEVER`.
        following: (k, n) rows by `ordered_changes`.
    """
    rows = [first]
    for after in following:
        rows.append(int(after[rows[-1]]))
    pairs = pairwise([*rows[1:], len(t) - 1])
    return tuple(NEVER if row >= end else float(t[row]) for row, end in pairs)
