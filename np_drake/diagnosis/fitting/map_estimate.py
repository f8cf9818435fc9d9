"""Maximum a posteriori parameters of a set of effects: nonlinear least squares in whitened
channels, with priors.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from np_drake.diagnosis.fitting.parameters import (
    Free,
    free_parameters,
    prior_whitening,
    read,
    write,
)
from np_drake.diagnosis.forward_model import StageCache, Term, predicted_residual, swing_wrenches
from np_drake.diagnosis.numerics import NoiseModel, minimise
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors import Candidate
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.effects.base import SensorEffect

BLOCK = 1.0  # length of blocks within which residuals may correlate, for the robust covariance [s]


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
    part by part, in the order of the candidates. onset_prior: log prior of the onsets.
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

    @property
    def calibrated(self) -> tuple[tuple[Callable[[FlightResiduals], np.ndarray], np.ndarray], ...]:
        """Linear parts that all flights share: their columns on any flight, and the
        coefficients.
        """
        return tuple((part.columns, part.coefficients) for part in self.linear if part.columns)

    def calibration_on(self, e: FlightResiduals) -> np.ndarray:
        """Return the channels (m, 15) that the linear calibration of the vehicle gives on any
        flight.
        """
        return sum((columns(e) @ c for columns, c in self.calibrated), start=np.zeros_like(e.y))

    def residual(self, e: FlightResiduals) -> np.ndarray:
        """Return the residual (m, 15) of the model on a flight, with outlier rows interpolated.

        On a flight of the fit, sensor errors are removed as well.
        """
        residual = e.y - predicted_residual(e, self.everything)
        return e.bridged(
            residual - self.sensor_drift[e.name] if e.name in self.sensor_drift else residual
        )

    def onset_prior_of(self, i: int) -> float:
        """Return the part of the log prior of all onsets that is that of term i; 0 if it acts from
        the start.
        """
        begin = [t for t in self.terms if t.onset]
        return self.onset_prior / len(begin) if self.terms[i].onset else 0.0

    @property
    def everything(self) -> list[Term]:
        """Terms and calibration, which together predict the channels."""
        return [*self.terms, *self.calibration]


def refine(
    terms: Sequence[Term],
    calibration: Sequence[tuple[Term, float]],
    flights: Sequence[FlightResiduals],
    noise: NoiseModel,
    *,
    temperature: float,
    linear: Sequence[Candidate] = (),
    white: Callable[[FlightResiduals, Candidate], np.ndarray] | None = None,
    evaluations: int = 8,
    priors: Priors,
) -> Fit:
    """Fit terms and calibration to the flights by bounded Gauss-Newton, starting from the terms'
    values.

    Args:
        temperature: factor on the noise variance [1].
        white: gives the whitened columns (m - p, 15, k) of one of these in a flight; default: by
            `noise`.
    """
    everything = [*terms, *(t for t, _ in calibration)]
    scales = {len(terms) + i: s for i, (_, s) in enumerate(calibration)}
    free = free_parameters(everything, flights, scales, priors)
    scale, neutral, lower, upper = (
        np.array([(f.scale, f.neutral, f.lower, f.upper) for f in free]).reshape(-1, 4).T
    )
    root, n, sizes_of = 1.0 / np.sqrt(temperature), len(free), [c.size for c in linear]
    k = sum(sizes_of)
    sizes = [(len(e.t) - noise.phi.shape[1]) * noise.phi.shape[0] for e in flights]
    spans = [slice(*ends) for ends in pairwise(np.cumsum([0, *sizes]).tolist())]
    rows = sum(sizes)
    # One buffer serves all steps: only the first n columns of its rows change, and each step uses
    # only its own.
    J = np.zeros((rows + n + k, n + k))
    J[rows:] = np.eye(n + k)
    # The prior is a block of rows W z ~ N(0, 1), so that least squares on all rows gives the
    # maximum a posteriori.
    W = prior_whitening(everything, free)
    J[rows : rows + n, :n] = W
    for c, at in zip(linear, pairwise(np.cumsum([n, *sizes_of]).tolist()), strict=True):
        for e, own in zip(flights, spans, strict=True):
            if not c.columns[e.name].any():
                J[own, slice(*at)] = 0.0
                continue
            columns = e.white(noise, c.columns[e.name]) if white is None else white(e, c)
            np.multiply(columns.reshape(-1, c.size), -root, out=J[own, slice(*at)])

    def residual(z: np.ndarray) -> np.ndarray:
        now = write(everything, free, z[:n] * scale)
        r = np.concatenate([np.empty(rows), W @ (z[:n] - neutral / scale), z[n:]])
        for e, own in zip(flights, spans, strict=True):
            np.multiply(e.white(noise, e.y - predicted_residual(e, now)).ravel(), root, out=r[own])
        if k:
            r[:rows] += J[:rows, n:] @ z[n:]
        return r

    def jacobian(z: np.ndarray) -> np.ndarray:
        now = write(everything, free, z[:n] * scale)
        for e, own in zip(flights, spans, strict=True):
            columns = e.white(noise, scaled_jacobian(now, free, e))
            np.multiply(columns.reshape(-1, n), -root, out=J[own, :n])
        return J

    lower, upper = lower / scale, upper / scale
    start = np.clip(read(everything, free) / scale, lower + 1e-6, upper - 1e-6)
    wide = np.full(k, 20.0)  # bounds of linear coefficients, in deviations of their prior
    best = minimise(
        residual,
        jacobian,
        np.concatenate([start, np.zeros(k)]),
        np.concatenate([lower, -wide]),
        np.concatenate([upper, wide]),
        evaluations,
        J[:, n:].T @ J[:, n:] if k else None,
    )
    fitted = write(everything, free, best.z[:n] * scale)
    # Laplace approximation: at the minimum the posterior is Gaussian with covariance (J'J)^-1.
    covariance = np.linalg.inv(best.information)
    robust = _robust(covariance, best.jacobian, best.residual, flights, noise)
    covariance = covariance * np.sqrt(np.outer(robust, robust))
    logdet = np.linalg.slogdet(best.information)[1]
    places = [slice(*at) for at in pairwise(np.cumsum([n, *sizes_of]).tolist())]
    parts = tuple(
        LinearPart(c.generic, best.z[at], covariance[at, at])
        for c, at in zip(linear, places, strict=True)
    )
    pairs = list(zip(linear, parts, strict=True))
    drifted = {
        e.name: sum(c.columns[e.name] @ part.coefficients for c, part in pairs)
        for e in flights
        if pairs
    }
    return Fit(
        tuple(fitted[: len(terms)]),
        tuple(fitted[len(terms) :]),
        tuple(free),
        best.z[:n] * scale,
        covariance[:n, :n] * np.outer(scale, scale),
        float(-best.cost - 0.5 * logdet + np.linalg.slogdet(W)[1]),
        drifted,
        linear=parts,
    )


def scaled_jacobian(
    now: Sequence[Term], free: Sequence[Free], flight: FlightResiduals
) -> np.ndarray:
    """Return the derivative (m, 15, k) of the predicted residual by the free parameters over their
    scales.
    """
    values = read(now, free)
    scale = np.array([f.scale for f in free])
    columns = np.zeros((*flight.y.shape, len(free)))
    base: dict[tuple[int, ...], np.ndarray] = {}
    stages = StageCache()
    swinging: dict[int, list[tuple[int, float, Term]]] = {}
    for k, f in enumerate(free):
        if f.flight and f.flight != flight.name:
            continue
        # A force at rows changes with a delay only when a jump of the held command passes a row.
        step = max(0.01 * scale[k], flight.log.step if now[f.term].effect.pure_delay else 0.0)
        if values[k] + step > f.upper:
            step = -step
        moved = write(now, [f], np.array([values[k] + step]))
        group = _group(now, f.term)
        if now[f.term].has_hidden_state and len(group) == 1:
            swinging.setdefault(f.term, []).append((k, step, moved[f.term]))
            continue
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


def _group(terms: Sequence[Term], i: int) -> tuple[int, ...]:
    """Return the positions of the terms whose predicted residuals interact with that of term i, to
    first order.
    """

    def alone(t: Term) -> bool:
        sensor = isinstance(t.effect, SensorEffect) and not t.effect.shifts_commands
        return sensor or t.has_hidden_state

    if alone(terms[i]):
        return (i,)
    return tuple(j for j, t in enumerate(terms) if not alone(t))


def _robust(covariance, J, fun, flights, noise) -> np.ndarray:
    """Return the factor (k,) by which variances grow for residuals that correlate within blocks, at
    least 1.
    """
    step = flights[0].grid.step
    p, channels = noise.phi.shape[1], noise.phi.shape[0]
    rows = max(1, round(BLOCK / step)) * channels
    meat = np.zeros_like(covariance)
    start = 0
    for e in flights:
        stop = start + (len(e.t) - p) * channels
        for a in range(start, stop, rows):
            b = min(a + rows, stop)
            g = J[a:b].T @ fun[a:b]
            meat += np.outer(g, g)
        start = stop
    # Sandwich estimator (Huber-White), clustered by blocks: C (sum g g') C with the score g of each
    # block.
    sandwich = np.diag(covariance @ meat @ covariance)
    return np.maximum(1.0, sandwich / np.maximum(np.diag(covariance), 1e-300))
