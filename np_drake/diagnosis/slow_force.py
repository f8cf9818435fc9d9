"""Slow forces: whether air or sensors make them, how strong they are, and whether they depend on
position.

The level force of a residual is averaged over bins. It is a first-order Gauss-Markov process beside
the errors of the sensors, and the cosine transform of a stationary process is independent from
frequency to frequency: one likelihood answers all these questions. A force acts on position and
accelerometer alike; an attitude that drifts errs in the one, an accelerometer in the other.
Source: Whittle's likelihood, with cosine transforms, as the spectra are steep; own priors.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from np_drake import attitude
from np_drake.diagnosis.forward_model import Term, has_swing, predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import HALF_WIDTH_95, Options
from np_drake.diagnosis.residuals import FORCE, POSITION, VELOCITY, FlightResiduals, low_pass
from np_drake.diagnosis.selection import Ranking
from np_drake.effects.linear_drag import LinearDrag
from np_drake.rigid_body import P
from np_drake.vehicle import Vehicle

BIN = 0.1  # over which the force is averaged, to a whole number of rows [s]
EDGE = 3
TOP = 1.0  # above it position and attitude tell no force [Hz]
REACH = 3.0  # of a parameter to either side, in deviations of its prior
FREE = 3.0  # deviation of a size of which nothing is known [e-folds]: as good as free
# Deviation of a bin's white noise over the tolerance [1].
ATTITUDE_WHITE = 0.045
ACCELEROMETER_WHITE = 0.45
CURVATURE_STEP = 0.02  # of the logarithms, for their curvature [1]

Residuals = dict[str, np.ndarray]  # by flight, (m, 15) what a model leaves of it
Onsets = dict[str, float | None]  # by flight, since when a wind blows [s]; None: from the start


Misfit = Callable[[np.ndarray], float]


# 1. Level forces in bins, and what they are expected to be.


def bin_rows(flight: FlightResiduals) -> int:
    """Return the number of rows of a bin."""
    return max(1, round(BIN / flight.grid.step))


def width(flight: FlightResiduals) -> float:
    """Return the width of a bin [s]."""
    return bin_rows(flight) * flight.grid.step


def binned(flight: FlightResiduals, values: np.ndarray) -> np.ndarray:
    """Return (k, a) the means over bins of values (m, a) on the grid."""
    size = bin_rows(flight)
    return values[: len(values) // size * size].reshape(-1, size, values.shape[1]).mean(axis=1)


def instants(flight: FlightResiduals) -> np.ndarray:
    """Return (k,) the times at which bins begin [s]."""
    return flight.t[0] + width(flight) * np.arange(len(flight.t) // bin_rows(flight))


def forces(flight: FlightResiduals, residual: np.ndarray) -> np.ndarray:
    """Return (k, 3) the force in W in a residual (m, 15), averaged over bins [N]."""
    return binned(flight, attitude.rotate(flight.q, residual[:, FORCE]))


def cosine_variances(n: int, width: float, deviation: float, time: float) -> np.ndarray:
    """Return (n,) the variances of the orthonormal cosine transform of n bins of an averaged
    Gauss-Markov process [N²].

    Source: own derivation: the covariance of two bins, the double integral of exp(-|t| / time), is
    geometric in their distance; its sum over all pairs of bins, weighted by both cosines.
    """
    b = width / time
    r = np.exp(-b)
    angle = np.pi * np.arange(n) / n
    z = r * np.exp(1j * angle)
    neighbour = 2 * (np.cosh(b) - 1) / b**2  # covariance of bins that far apart, over r^distance
    last = z**n
    by_distance = (z - last) / (1 - z)
    times_distance = (z - n * last + (n - 1) * last * z) / (1 - z) ** 2
    ends = np.zeros(n)
    ends[1:] = by_distance.imag[1:] / np.sin(angle[1:])
    pairs = by_distance.real - (times_distance.real + ends) / n
    return deviation**2 * (2 * (b - 1 + r) / b**2 + 2 * neighbour * pairs)


def transformed(values: np.ndarray) -> np.ndarray:
    """Return the orthonormal cosine transform over the last axis but one."""
    return scipy.fft.dct(values, axis=-2, norm="ortho")


def loss_of(x: np.ndarray, error: np.ndarray, common: np.ndarray) -> np.ndarray:
    """Return (k,) the -2 log likelihood at k frequencies of the channels x (c, k, 2) of two axes.

    error: (c, k) variance of the errors of each channel. common: (k,) of the force that all show.
    Source: matrix determinant lemma and Sherman-Morrison formula.
    """
    precision = 1 / error
    ratio = 1 + common * precision.sum(axis=0)
    shown = np.sum((precision[..., None] * x).sum(axis=0) ** 2, axis=-1)
    power = (precision * np.sum(x**2, axis=-1)).sum(axis=0) - common / ratio * shown
    return power + 2 * (np.log(error).sum(axis=0) + np.log(ratio))


class Spectrum(NamedTuple):
    """Cosine transform x (c, k, 2) of the level forces of n bins, without their mean [N]; width of
    a bin [s].
    """

    x: np.ndarray
    n: int
    width: float


def spectrum(flight: FlightResiduals, bins: np.ndarray, top: float = np.inf) -> Spectrum:
    """Return the spectrum of forces (c, n, 3) on the level axes, up to a frequency [Hz]."""
    n = bins.shape[1]
    last = 1 + int(min(n - 1, 2 * n * width(flight) * top))
    return Spectrum(transformed(bins[..., :2])[:, 1:last], n, width(flight))


def channels(flight: FlightResiduals, residual: np.ndarray) -> np.ndarray:
    """Return (c, k, 3) the force in W that position shows, and beside it what the accelerometer
    reads where it has errors of its own, in bins [N].
    """
    slip = np.gradient(attitude.rotate(flight.q, residual[:, POSITION]), flight.grid.step, axis=0)
    rate = slip + attitude.rotate(flight.q, residual[:, VELOCITY])
    read = forces(flight, residual)
    moved = binned(flight, low_pass(rate, flight.grid.step, 4 * TOP))
    position = read + flight.vehicle.mass * moved
    return np.stack([position, read] if flight.turned else [position])[:, EDGE:-EDGE]


def _prior(spectra: Sequence[Spectrum], vehicle: Vehicle, options: Options) -> np.ndarray:
    """Return (2, a) centre and deviation of the logarithms of what makes the spectra, as forces:
    the air (deviation [N], time [s]), the first channel's errors (slow [N], time [s], white), and
    those of an accelerometer (flicker, white).
    """
    tolerance = options.tolerance
    priors = options.priors
    size = np.sqrt(np.mean([np.sum(s.x[0] ** 2) / (2 * s.n) for s in spectra]))
    turned = vehicle.mass * vehicle.gravity * tolerance.attitude
    read = vehicle.mass * tolerance.acceleration
    flicker, spread = priors.accelerometer_flicker
    pairs = [
        (size, FREE),
        priors.gust_time,
        (turned, priors.attitude_spread),
        priors.attitude_drift,
        (ATTITUDE_WHITE * turned, FREE),
        (flicker * read, spread),
        (ACCELEROMETER_WHITE * read, FREE),
    ]
    if len(spectra[0].x) == 1:
        pairs = pairs[:5]
    return np.array([(np.log(centre), wide) for centre, wide in pairs]).T


def _variances(s: Spectrum, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the variances of each channel's errors (c, k) and of the force (k,) at parameters z
    (a,).
    """
    k = np.arange(1, 1 + s.x.shape[1])
    deviation, time, size, drift, white, *read = np.exp(z)
    error = [cosine_variances(s.n, s.width, size, drift)[k] + white**2]
    if read:
        flicker, white = read
        error.append(flicker**2 * s.n / k + white**2)
    return np.array(error), cosine_variances(s.n, s.width, deviation, time)[k]


def _misfit(spectra: Sequence[Spectrum], prior: np.ndarray, *, air: bool = True) -> Misfit:
    """Return the -log posterior of parameters (a,), up to a constant, with or without a force."""

    def misfit(z: np.ndarray) -> float:
        variances = (_variances(s, z) for s in spectra)
        losses = (
            np.sum(loss_of(s.x, error, air * common))
            for s, (error, common) in zip(spectra, variances, strict=True)
        )
        return 0.5 * float(sum(losses) + np.sum(((z - prior[0]) / prior[1]) ** 2))

    return misfit


def _least(misfit: Misfit, prior: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the least misfit and where it is."""
    reach = REACH * np.outer([-1, 1], prior[1])
    least = scipy.optimize.minimize(
        misfit, prior[0], method="L-BFGS-B", bounds=(prior[0] + reach).T
    )
    return float(least.fun), least.x


# 2. Whether there is one.


def slow_force(
    flights: Sequence[FlightResiduals], residual: Residuals, options: Options
) -> tuple[float, float]:
    """Return the log evidence of a slow force over sensors alone, and its deviation [N]."""
    spectra = [spectrum(flight, channels(flight, residual[flight.name]), TOP) for flight in flights]
    prior = _prior(spectra, flights[0].vehicle, options)
    alone, _ = _least(_misfit(spectra, prior, air=False), prior)
    least, z = _least(_misfit(spectra, prior), prior)
    return max(alone - least, 0.0), float(np.exp(z[0]))


def slow_power(flights: Sequence[FlightResiduals], residual: Residuals) -> float:
    """Return the mean square of the slow force on a level axis, its mean apart [N²]."""
    spectra = [spectrum(flight, channels(flight, residual[flight.name]), TOP) for flight in flights]
    return float(np.mean([np.sum(s.x[0] ** 2) / (2 * s.n) for s in spectra]))


def gust_probability(ranking: Ranking, held_out: HeldOut) -> float:
    """Return the probability of a slow force in the air; 0 where training flights show none, or
    where a payload may have lost its swing.
    """
    flights = ranking.problem.flights
    options = ranking.options
    thresholds = options.thresholds
    residual = residuals_of(ranking, held_out)
    seen, _ = slow_force(flights, residual, options)
    evidence, deviation = slow_force([*flights, *held_out.flights], residual, options)
    matters = deviation > options.materiality.force * flights[0].weight
    shown = seen > thresholds.held_out_share * thresholds.slow_force_evidence
    before = {flight.name: flight.y for flight in flights}
    lost = has_swing(ranking.best.terms) and (
        slow_power(flights, residual) < thresholds.held_out_share * slow_power(flights, before)
    )
    if not matters or not shown or lost:
        return 0.0
    return float(scipy.special.expit(evidence - thresholds.slow_force_evidence))


def residuals_of(ranking: Ranking, held_out: HeldOut, but: Sequence[str] = ()) -> Residuals:
    """Return by flight the residual (m, 15) of the best model without some of its effects."""
    residual = {flight.name: ranking.best.residual(flight) for flight in ranking.problem.flights}
    residual |= {flight.name: held_out.swing_free_residual(flight) for flight in held_out.flights}
    for flight in (*ranking.problem.flights, *held_out.flights):
        terms = held_out.terms.get(flight.name, ranking.best.terms)
        gone = [term for term in terms if term.effect.identifier in but]
        residual[flight.name] = residual[flight.name] + predicted_residual(flight, gone)
    return residual


# 3. Whether a place makes it.


def position_p_value(
    flights: Sequence[FlightResiduals], residual: Residuals, options: Options
) -> float:
    """Return the probability that gusts follow the position as much as this force does [1].

    Source: likelihood ratio of a level force that is quadratic in the position beside gusts, a mean
    in each flight and a drag, under the gusts' covariance, as strong in each flight as they are
    there.
    """
    wind = wind_force(flights, residual, {}, options)
    x = np.concatenate([flight.rows.x[:, P] for flight in flights])
    middle = x.mean(axis=0)
    size = x.std(axis=0) + 1e-9  # [m], for a height that is kept
    first, second = np.triu_indices(3)
    white = []
    for flight in flights:
        at = [np.interp(flight.t, flight.rows.t, axis) for axis in flight.rows.x[:, P].T]
        place = (np.transpose(at) - middle) / size
        columns = np.hstack(
            [
                forces(flight, residual[flight.name])[:, :2],
                *np.moveaxis(drags(flight)[:, :2], 1, 0),
                binned(flight, place),
                binned(flight, place[:, first] * place[:, second]),
            ]
        )
        variance = wind.variances(len(columns), width(flight))
        columns = (transformed(columns) / np.sqrt(variance)[:, None])[1:]
        white.append(columns / np.sqrt(np.mean(columns[:, :2] ** 2)))
    force, drag_x, drag_y, place = np.split(np.concatenate(white), [2, 5, 8], axis=1)
    drag = np.vstack([drag_x, drag_y])
    less = scipy.linalg.orth(drag)
    more = scipy.linalg.orth(np.hstack([drag, scipy.linalg.block_diag(place, place)]))
    both = force.T.ravel()
    # The power that the position explains beside the drag.
    gain = np.sum((more.T @ both) ** 2) - np.sum((less.T @ both) ** 2)
    return float(scipy.stats.chi2.sf(gain, more.shape[1] - less.shape[1]))


def drags(flight: FlightResiduals) -> np.ndarray:
    """Return (k, 3, 3) the force in W of a unit drag along each body axis (the last), averaged over
    bins [m/s].
    """
    unit = [[Term(LinearDrag(*axis))] for axis in np.eye(3).tolist()]
    return np.stack([forces(flight, predicted_residual(flight, terms)) for terms in unit], axis=-1)


# 4. How strong it is.


@dc.dataclass(frozen=True)
class WindForce:
    """Force in W of a wind on a vehicle, as a Gauss-Markov process beside errors of the sensors.

    mean (3, 2): axes by value and half width of the 95 % interval [N]. deviation [N], time [s]:
    value, lower and upper end. size, drift [N, s]: of the slow error. white: of a bin [N].
    """

    mean: np.ndarray
    deviation: tuple[float, float, float]
    time: tuple[float, float, float]
    size: float
    drift: float
    white: float

    def variances(self, n: int, width: float, *, blows: bool = True) -> np.ndarray:
        """Return (n,) the variances of the cosine transform of n bins, with or without the wind."""
        wind = cosine_variances(n, width, self.deviation[0], self.time[0])
        return blows * wind + cosine_variances(n, width, self.size, self.drift) + self.white**2

    def loss(self, bins: np.ndarray, width: float, *, blows: bool) -> float:
        """Return the -2 log likelihood of level forces (n, 2), with or without the wind, about an
        unknown mean.
        """
        if not len(bins):
            return 0.0
        variance = self.variances(len(bins), width, blows=blows)
        variance[0] += len(bins) * (self.deviation[0] if blows else self.size) ** 2
        power = transformed(bins) ** 2 / variance[:, None]
        return float(np.sum(power) + 2 * np.sum(np.log(variance)))


def wind_force(
    flights: Sequence[FlightResiduals], residual: Residuals, onsets: Onsets, options: Options
) -> WindForce:
    """Return the force of a wind that a residual shows from its onset in each flight on.

    Source: maximum a posteriori, the mean of each axis taken out; the intervals by its curvature in
    the logarithms. Deviation and time are those of the two level axes together.
    """
    pieces = [
        (flight, since(flight, forces(flight, residual[flight.name]), onsets.get(flight.name)))
        for flight in flights
    ]
    pieces = [(flight, bins) for flight, bins in pieces if len(bins) > 1]
    spectra = [spectrum(flight, bins[None]) for flight, bins in pieces]
    prior = _prior(spectra, flights[0].vehicle, options)
    misfit = _misfit(spectra, prior)
    _, z = _least(misfit, prior)
    E = CURVATURE_STEP * np.eye(len(z))

    def slope(z: np.ndarray) -> np.ndarray:
        return np.array([misfit(z + e) - misfit(z - e) for e in E]) / (2 * CURVATURE_STEP)

    curvature = np.array([slope(z + e) - slope(z - e) for e in E]) / (2 * CURVATURE_STEP)
    # A figure may not matter at all: a weak prior.
    values, vectors = np.linalg.eigh(curvature)
    covariance = vectors / np.maximum(values, 0.25) @ vectors.T
    wide = np.exp(HALF_WIDTH_95 * np.sqrt(np.diag(covariance)))
    deviation, time = (
        (float(v), float(v / w), float(v * w)) for v, w in zip(np.exp(z[:2]), wide[:2], strict=True)
    )
    every = np.concatenate([bins for _, bins in pieces])
    wind = WindForce(np.zeros((3, 2)), deviation, time, *np.exp(z[2:]))
    slowest = wind.variances(len(every), width(flights[0]))[0]
    half = HALF_WIDTH_95 * np.sqrt(slowest / len(every))
    return dc.replace(wind, mean=np.stack([every.mean(axis=0), np.full(3, half)], axis=1))


def since(flight: FlightResiduals, bins: np.ndarray, onset: float | None) -> np.ndarray:
    """Return the bins (k, a) of a flight from `onset` on [s]; None: from the start."""
    return bins[0 if onset is None else np.searchsorted(instants(flight), onset) :]
