"""Maximum a posteriori fit of a model: nonlinear least squares in whitened channels, with priors.

Several starts are tried where there is a hidden swing.
"""

import dataclasses as dc
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import product

import numpy as np

from np_drake.diagnosis.effect_prior import EffectPrior, file_priors
from np_drake.diagnosis.forward_model import (
    NEVER,
    STATE,
    Stages,
    Term,
    has_swing,
    hidden_size,
    padded,
    predicted_residual,
    swing_wrenches,
)
from np_drake.diagnosis.options import HALF_WIDTH_95, Priors
from np_drake.diagnosis.regressors import Model, RegressionProblem
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.diagnosis.swing_fit import fitted_to_whole_flight
from np_drake.effects.base import Effect, SensorEffect, correlation_root, usual_size
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.estimation.map_fit import SCORE_BLOCK, Minimum, clustered_covariances, minimise
from np_drake.estimation.noise import NoiseModel, scale_only
from np_drake.estimation.regression import places
from np_drake.rigid_body import P
from np_drake.vehicle import Vehicle

LOADS = "loads"  # name of a free entry of `Term.loads`
MASS = SuspendedPayload.parameters[0]


@dc.dataclass(frozen=True)
class Free:
    """Free parameter of term `term`: a parameter by name, an entry of its `loads`, or one of the
    hidden state of a flight.
    """

    term: int
    name: str
    scale: float
    neutral: float
    lower: float
    upper: float
    flight: str = ""
    entry: int = 0


WIDE = 4.0  # deviations of what a file states that are within bounds [1]


def free_parameters(
    terms: Sequence[Term],
    flights: Sequence[FlightResiduals],
    known: Mapping[int, EffectPrior],
    priors: Priors,
) -> list[Free]:
    """Return the free parameters of the terms.

    Args:
        known: by position, what the file allows for of calibration terms, in place of typical
            sizes.
    """
    free = []
    for i, term in enumerate(terms):
        vehicle = flights[0].vehicle
        width = _width(term, vehicle) if term.effect.widens else 1.0
        deviation = known.get(i)
        for p in term.effect.parameters:
            if deviation is not None and p.name in deviation.sigma:
                scale = deviation.sigma[p.name]
                middle = deviation.usual(p)
                upper = max(p.upper, middle + WIDE * scale)
                free.append(Free(i, p.name, scale, middle, p.lower, upper))
            elif deviation is None and not p.choices:
                scale = width * usual_size(p, vehicle)
                free.append(Free(i, p.name, scale, p.neutral, p.lower, p.upper))
        scale = width * usual_size(MASS, vehicle)
        for k in np.flatnonzero(term.loads).tolist():
            free.append(Free(i, LOADS, scale, 0.0, 0.0, MASS.upper, entry=k))
        for flight in flights if term.effect.has_hidden_state else ():
            if term.begins(flight.name) != NEVER:
                scales = priors.swing * np.array([1, 1, 3, 3])  # of angles, and of rates
                free += [
                    Free(i, "swing", scales[k % STATE], 0.0, -4.0, 4.0, flight.name, k)
                    for k in range(hidden_size(flight, term.begins(flight.name)))
                ]
    return free


def prior_whitening(terms: Sequence[Term], free: Sequence[Free]) -> np.ndarray:
    """Return the matrix (k, k) that maps deviations from neutral over scale to independent standard
    ones [1].

    Args:
        terms: terms of a model, with their onsets and hidden states.
    """
    W = np.eye(len(free))
    for i, term in enumerate(terms):
        indices = [k for k, f in enumerate(free) if f.term == i and not f.flight]
        if term.effect.prior_correlation and indices:
            W[np.ix_(indices, indices)] = np.linalg.inv(correlation_root(type(term.effect)))
    return W


def _width(term: Term, vehicle: Vehicle) -> float:
    """Return the width of the prior over the typical one: the size of the effect, at least 1.

    `Gram.evidence_of_sets` uses the same rule.
    """
    sizes = [
        (float(getattr(term.effect, p.name)) - p.neutral) / usual_size(p, vehicle)
        for p in term.effect.parameters
        if not p.choices
    ]
    return max(1.0, float(np.sqrt(np.mean(np.square(sizes)))))


def read(terms: Sequence[Term], free: Sequence[Free]) -> np.ndarray:
    """Return the values (k,) of the free parameters."""
    values = []
    for f in free:
        term = terms[f.term]
        if f.flight:
            values.append(padded(term.hidden.get(f.flight), f.entry + 1)[f.entry])
        else:
            values.append(term.loads[f.entry] if f.name == LOADS else getattr(term.effect, f.name))
    return np.array(values)


def write(terms: Sequence[Term], free: Sequence[Free], values: np.ndarray) -> list[Term]:
    """Return the terms with the free parameters set to `values` (k,); other terms are unchanged.

    Args:
        values: (k,) in physical units.
    """
    written = list(terms)
    for f, value in zip(free, values.tolist(), strict=True):
        term = written[f.term]
        if f.flight:
            before = term.hidden.get(f.flight, np.zeros(0))
            swing = padded(before, max(f.entry + 1, len(before)))
            swing[f.entry] = value
            written[f.term] = dc.replace(term, hidden={**term.hidden, f.flight: swing})
        elif f.name == LOADS:
            loads = (*term.loads[: f.entry], value, *term.loads[f.entry + 1 :])
            written[f.term] = dc.replace(term, loads=loads)
        else:
            moved = dc.replace(term.effect, **{f.name: value})  # type: ignore[type-var]
            written[f.term] = dc.replace(term, effect=moved)
    return written


@dc.dataclass(frozen=True)
class LinearPart:
    """Nuisance with free coefficients (k,) of prior N(0, 1), and their covariance (k, k).

    columns: of any flight, if all flights share it.
    """

    columns: Callable[[FlightResiduals], np.ndarray] | None
    coefficients: np.ndarray
    covariance: np.ndarray


@dc.dataclass(frozen=True)
class Fit:
    """Fitted model of effects and calibration.

    terms, calibration: fitted terms.
    free, values: free parameters and their values (k,) in physical units; covariance (k, k): of
    these. log_evidence: log evidence of the model on the flights of the fit [nat]. sensor_drift: by
    flight, (m, 15) contribution of linear nuisance: sensor errors and calibration. linear: the same
    part by part, in the order of the candidates. onset_prior: log prior of the onsets. allowed:
    priors of the calibration.
    """

    terms: tuple[Term, ...]
    calibration: tuple[Term, ...]
    free: tuple[Free, ...]
    values: np.ndarray
    covariance: np.ndarray
    log_evidence: float
    sensor_drift: dict[str, np.ndarray] = dc.field(default_factory=dict)
    onset_prior: float = 0.0
    linear: tuple[LinearPart, ...] = ()
    allowed: tuple[EffectPrior, ...] = ()

    @property
    def calibrated(self) -> tuple[tuple[Callable[[FlightResiduals], np.ndarray], np.ndarray], ...]:
        """Linear parts that all flights share: their columns on any flight, and the
        coefficients.
        """
        return tuple((part.columns, part.coefficients) for part in self.linear if part.columns)

    def residual(self, flight: FlightResiduals) -> np.ndarray:
        """Return the residual (m, 15) of the model on a flight, with outlier rows interpolated.

        On a flight of the fit, sensor errors are removed as well.
        """
        drift = self.sensor_drift.get(flight.name, 0.0)
        return flight.bridged(flight.y - predicted_residual(flight, self.everything) - drift)

    def onset_prior_of(self, i: int) -> float:
        """Return the part of the log prior of all onsets that is that of term i; 0 if it acts from
        the start.
        """
        late = [bool(t.onset or t.changes) for t in self.terms]
        return self.onset_prior / sum(late) if late[i] else 0.0

    @property
    def everything(self) -> list[Term]:
        """Terms and calibration, which together predict the channels."""
        return [*self.terms, *self.calibration]


class _WhitenedModel:
    """Whitened residual of a model on the flights of a problem, and its normal equations.

    z (n + k,): free parameters over their scales, then coefficients of linear nuisance. The prior
    is a block of rows W z ~ N(0, 1), so that least squares on all rows gives the maximum a
    posteriori.
    """

    def __init__(
        self, problem: RegressionProblem, terms: list[Term], free: Sequence[Free], noise: NoiseModel
    ):
        self._flights = problem.flights
        self._noise = noise
        self._terms = terms
        self._free = free
        self._root = 1.0 / np.sqrt(problem.temperature)
        self._white = problem.white_nuisance(noise)
        self._rows = max((rows.stop for rows in self._white.rows.values()), default=0)
        self._derivatives: dict[str, np.ndarray] = {}
        self._stages: dict[str, Stages] = {}  # of the last residual
        self.prior = prior_whitening(terms, free)
        self.scale, neutral, lower, upper = (
            np.array([(f.scale, f.neutral, f.lower, f.upper) for f in free]).reshape(-1, 4).T
        )
        self._neutral = neutral / self.scale
        self._bounds = (lower / self.scale, upper / self.scale)

    def terms_at(self, z: np.ndarray) -> list[Term]:
        """Return the terms with the parameters of z."""
        return write(self._terms, self._free, z[: len(self._free)] * self.scale)

    def residual(self, z: np.ndarray) -> np.ndarray:
        """Return whitened residuals, then the rows of the prior."""
        n = len(self._free)
        now = self.terms_at(z)
        r = np.concatenate([np.empty(self._rows), self.prior @ (z[:n] - self._neutral), z[n:]])
        for flight in self._flights:
            X, at = self._white.columns[flight.name]
            stages = self._stages[flight.name] = {}
            predicted = predicted_residual(flight, now, stages)
            missed = flight.white(self._noise, flight.y - predicted).ravel()
            r[self._white.rows[flight.name]] = self._root * missed - X @ z[n + at]
        return r

    def normal(self, z: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return J'J and J'r."""
        n = len(self._free)
        rows = self._rows
        W = self.prior
        now = self.terms_at(z)
        H = np.zeros((len(z), len(z)))
        g = np.concatenate([W.T @ r[rows : rows + n], r[rows + n :]])
        H[:n, :n] = W.T @ W
        H[n:, n:] = self._white.gram
        for flight in self._flights:
            X, at = self._white.columns[flight.name]
            missed = r[self._white.rows[flight.name]]
            jacobian = flight.white(
                self._noise, scaled_jacobian(now, self._free, flight, self._stages[flight.name])
            )
            J = self._root * jacobian.reshape(len(missed), n)
            self._derivatives[flight.name] = J
            H[:n, :n] += J.T @ J
            H[:n, n + at] += J.T @ X
            g[:n] -= J.T @ missed
            g[n + at] -= X.T @ missed
        H[n:, :n] = H[:n, n:].T
        return H, g

    def minimum(self, evaluations: int) -> Minimum:
        """Return the minimum by bounded Gauss-Newton from the values of the terms."""
        lower, upper = self._bounds
        start = np.clip(read(self._terms, self._free) / self.scale, lower + 1e-6, upper - 1e-6)
        k = len(self._white.gram)
        wide = np.full(k, 20.0)  # bounds of linear coefficients, in deviations of their prior
        return minimise(
            self.residual,
            self.normal,
            np.concatenate([start, np.zeros(k)]),
            np.concatenate([lower, -wide]),
            np.concatenate([upper, wide]),
            evaluations,
        )

    def covariance(self, best: Minimum) -> np.ndarray:
        """Return the covariance of z at the minimum.

        Source: Laplace approximation; variances grow for residuals that correlate within blocks by
        the sandwich estimator (Huber-White).
        """
        n = len(self._free)
        covariance = np.linalg.inv(best.information)
        rows = max(1, round(SCORE_BLOCK / self._flights[0].grid.step))
        size = rows * self._noise.phi.shape[0]
        scores = []
        for flight in self._flights:
            X, at = self._white.columns[flight.name]
            missed = best.residual[self._white.rows[flight.name]]
            starts = range(0, len(missed), size)
            scores.append(np.zeros((len(starts), len(best.z))))
            for score, start in zip(scores[-1], starts, strict=True):
                block = slice(start, start + size)
                score[:n] = missed[block] @ self._derivatives[flight.name][block]
                score[n + at] = missed[block] @ X[block]
        prior = np.eye(len(best.z))
        prior[:n, :n] = self.prior.T @ self.prior
        least, *clustered = clustered_covariances(covariance, prior, scores)
        variance = np.diag(least)
        robust = np.max([np.diag(c) / variance for c in (least, *clustered)], axis=0)
        return covariance * np.sqrt(np.outer(robust, robust))


def refine(
    problem: RegressionProblem,
    terms: Sequence[Term],
    calibration: Sequence[EffectPrior],
    noise: NoiseModel,
    evaluations: int = 8,
) -> Fit:
    """Fit terms and calibration to the flights of a problem by bounded Gauss-Newton, starting from
    the terms' values.
    """
    flights = problem.flights
    everything = [*terms, *(d.term for d in calibration)]
    known = dict(enumerate(calibration, start=len(terms)))
    free = free_parameters(everything, flights, known, problem.options.priors)
    n = len(free)
    model = _WhitenedModel(problem, everything, free, noise)
    best = model.minimum(evaluations)
    covariance = model.covariance(best)
    fitted = model.terms_at(best.z)
    _, logdet = np.linalg.slogdet(best.information)
    _, prior = np.linalg.slogdet(model.prior)
    linear = problem.linear
    parts = list(zip(linear, places((c.size for c in linear), n), strict=True))
    drift = {
        flight.name: sum(c.columns[flight.name] @ best.z[at] for c, at in parts)
        for flight in flights
        if parts
    }
    return Fit(
        tuple(fitted[: len(terms)]),
        tuple(fitted[len(terms) :]),
        tuple(free),
        best.z[:n] * model.scale,
        covariance[:n, :n] * np.outer(model.scale, model.scale),
        float(-best.cost - 0.5 * logdet + prior),
        drift,
        linear=tuple(LinearPart(c.generic, best.z[at], covariance[at, at]) for c, at in parts),
        allowed=tuple(calibration),
    )


def scaled_jacobian(
    now: Sequence[Term], free: Sequence[Free], flight: FlightResiduals, stages: Stages | None = None
) -> np.ndarray:
    """Return the derivative (m, 15, k) of the predicted residual by the free parameters over their
    scales.

    Args:
        stages: parts of the flight's predicted residual that are known.
    """
    values = read(now, free)
    scale = np.array([f.scale for f in free])
    columns = np.zeros((*flight.y.shape, len(free)))
    base: dict[tuple[int, ...], np.ndarray] = {}
    stages = {} if stages is None else stages
    swinging: dict[int, list[tuple[int, float, Term]]] = {}
    # Terms whose predicted residuals interact, to first order.
    interact = tuple(
        i
        for i, t in enumerate(now)
        if not t.effect.has_hidden_state
        and (not isinstance(t.effect, SensorEffect) or t.effect.shifts_commands)
    )
    for k, f in enumerate(free):
        if f.flight and f.flight != flight.name:
            continue
        # A force at rows changes with a delay only when a jump of the held command passes a row.
        step = max(0.01 * scale[k], flight.log.step if now[f.term].effect.pure_delay else 0.0)
        if values[k] + step > f.upper:
            step = -step
        moved = write(now, [f], np.array([values[k] + step]))
        if now[f.term].effect.has_hidden_state:
            swinging.setdefault(f.term, []).append((k, step, moved[f.term]))
            continue
        group = interact if f.term in interact else (f.term,)
        if group not in base:
            base[group] = predicted_residual(flight, [now[i] for i in group], stages)
        columns[..., k] = (
            (predicted_residual(flight, [moved[i] for i in group], stages) - base[group])
            / step
            * scale[k]
        )
    for term, moves in swinging.items():
        wrench = swing_wrenches(flight, [now[term], *(m for _, _, m in moves)]) * flight.shown
        for i, (k, step, _) in enumerate(moves, start=1):
            columns[:, WRENCH, k] = (wrench[:, i] - wrench[:, 0]) / step * scale[k]
    return columns


BOUND_EDGE = 1e-3  # share of a parameter's range within which it is at its bound [1]; own choice
INTERVAL_POINTS = 3  # points of an interval that are tried; own choice


def interval(fit: Fit, i: int, name: str) -> tuple[float, float]:
    """Return the 95 % interval of a parameter of term i, from the covariance of the fit."""
    value = float(getattr(fit.terms[i].effect, name))
    half = half_width(fit, i, name)
    return value - half, value + half


def half_width(fit: Fit, i: int, name: str, entry: int = 0) -> float:
    """Return half the 95 % interval of a parameter of term i, or of an entry of its `LOADS`."""
    return sum(
        HALF_WIDTH_95 * float(np.sqrt(fit.covariance[k, k]))
        for k, f in enumerate(fit.free)
        if (f.term, f.name, f.flight, f.entry) == (i, name, "", entry)
    )


def greatest_height(flights: Sequence[FlightResiduals]) -> float:
    """Return the largest height of flights above the ground [m]; infinite where logs do not tell
    it.
    """
    if any("height" in flight.log.lacks for flight in flights):
        return np.inf
    return max(float(flight.rows.x[:, P][:, 2].max()) for flight in flights)


def at_its_bound(effect: Effect) -> bool:
    """Return whether a parameter lies at a physical bound that is not its neutral value."""
    for p in effect.parameters:
        value = float(getattr(effect, p.name))
        edge = BOUND_EDGE * (p.upper - p.lower)
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
    tried = [
        np.linspace(*interval(fit, i, p.name), INTERVAL_POINTS).tolist() for p in effect.parameters
    ]
    possible = (
        effect.of(dict(zip(effect.values, figures, strict=True))).possible(vehicle, height)
        for figures in product(*tried)
    )
    return "" if any(possible) else "no vehicle can have such figures"


FIT_ITERATIONS = 6
AGAIN = 3  # largest number of restarts of a descent with a hidden swing; own choice


def refit(
    problem: RegressionProblem,
    model: Model,
    known: Fit | None,
    noise: NoiseModel | None = None,
    iterations: int = FIT_ITERATIONS,
) -> Fit:
    """Fit a model's parameters, starting from a known fit of the same effects where there is one.

    Args:
        known: an earlier fit, or None.
        noise: noise model that whitens; default: that of the problem.
    """
    noise = noise or problem.noise
    terms = _terms_at_posterior(problem, model)
    starts: list[Sequence[Term]] = [terms]
    kind = [(type(t.effect), t.onset, t.changes) for t in terms]
    if known is not None and [(type(t.effect), t.onset, t.changes) for t in known.terms] == kind:
        starts = [known.terms, terms] if has_swing(terms) else [known.terms]
    onset_prior = problem.onset_prior(model)
    fits = [_descend(problem, start, noise, iterations, onset_prior) for start in starts]
    return max(fits, key=lambda f: f.log_evidence)


def first_fit(problem: RegressionProblem, model: Model, iterations: int) -> Fit:
    """Fit a model's parameters where no fit is known; its residual becomes the noise of the next.

    A swing starts as it suits the posterior's other parameters, flight by flight, under white
    noise.
    """
    flights = problem.flights
    terms = _terms_at_posterior(problem, model)
    if not has_swing(terms):
        return refit(problem, model, None, iterations=iterations)
    same_scale = scale_only(
        [
            flight.known(flight.bridged(flight.y - predicted_residual(flight, terms)))
            for flight in flights
        ],
        flights[0].grid.step,
    )
    fitted_terms = {
        flight.name: fitted_to_whole_flight(terms, flight, same_scale, problem.options.priors)
        for flight in flights
    }
    swung = [
        dc.replace(
            t, hidden={n: now[i].hidden[n] for n, now in fitted_terms.items() if n in now[i].hidden}
        )
        for i, t in enumerate(terms)
    ]
    return _descend(problem, swung, same_scale, iterations, problem.onset_prior(model))


def restart(problem: RegressionProblem, fit: Fit, noise: NoiseModel) -> Fit:
    """Return the fit, restarted until it gains no more where it has a hidden swing.

    Args:
        fit: a `refit` with this noise.
    """
    for _ in range(AGAIN if has_swing(fit.terms) else 0):
        before = fit
        fit = _descend(problem, fit.terms, noise, FIT_ITERATIONS, fit.onset_prior)
        if fit.log_evidence < before.log_evidence + 1.0:
            return max(before, fit, key=lambda f: f.log_evidence)
    return fit


def fit_of_subset(
    problem: RegressionProblem, fit: Fit, names: Collection[str], noise: NoiseModel
) -> Fit:
    """Return the fit of some effects of another fit alone, with the calibration that suits them."""
    kept = [i for i, t in enumerate(fit.terms) if t.effect.identifier in names]
    onset_prior = sum(fit.onset_prior_of(i) for i in kept)
    return _descend(problem, [fit.terms[i] for i in kept], noise, FIT_ITERATIONS, onset_prior)


def _descend(
    problem: RegressionProblem,
    start: Sequence[Term],
    noise: NoiseModel,
    iterations: int,
    onset_prior: float,
) -> Fit:
    # An effect takes the place of what the file states of it.
    acting = [t.effect for t in start if not t.onset]
    calibration = [
        d
        for d in file_priors(problem.flights[0].vehicle, problem.options.tolerance)
        if not (d.stated and any(map(d.is_of, acting)))
    ]
    fit = refine(problem, start, calibration, noise, iterations)
    return dc.replace(fit, onset_prior=onset_prior)


def _terms_at_posterior(problem: RegressionProblem, model: Model) -> list[Term]:
    """Return the terms of a model's members at the posterior of the linear regression, given that
    each is physical.
    """
    mean, covariance = problem.total.posterior(problem.columns(model.members))
    first = sum(c.size for c in problem.nuisance)
    chosen = [problem.candidates[i] for i in model.members]
    parts = list(zip(chosen, places((c.size for c in chosen), first), strict=True))
    for candidate, columns in parts:
        if candidate.physical is None:
            continue
        coefficients, _ = candidate.physical(mean[columns], covariance[columns, columns])
        # Conditioning of a Gaussian: fixing some coefficients moves the others by their covariance
        # with them.
        mean = mean + covariance[:, columns] @ np.linalg.solve(
            covariance[columns, columns], coefficients - mean[columns]
        )
    return [term for candidate, columns in parts for term in candidate.terms(mean[columns])]
