"""Slow forces: whether air or sensors make them, and whether they depend on position.

A force acts on position and accelerometer alike; an attitude that drifts errs in the one, an
accelerometer that drifts in the other. Gusts do not depend on position.
Source: Whittle's likelihood, with cosine transforms, as the spectra are steep; own priors.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from np_drake import attitude
from np_drake.diagnosis.gusts import (
    Begins,
    WindForce,
    binned,
    drags,
    forces,
    spans,
    whitened,
    width,
    wind_force,
)
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FORCE, POSITION, VELOCITY, FlightResiduals, low_pass
from np_drake.rigid_body import P

TOP = 1.0  # of what counts as slow [Hz]
REACH = 3.0  # spreads to either side
WHITE = 3.0  # deviation of the white noise of attitude and accelerometer [e-folds]: as good as free
STARTS = (0.2, 1.0)  # of the force's size, over the attitude's


# Of one flight: f (k,) [Hz], and values (c, k, 2) of position, or of position and accelerometer, by
# level axes, whose squares are in the mean one-sided power spectral densities [m²/s³].
Spectra = tuple[np.ndarray, np.ndarray]


def slow_force(
    flights: Sequence[FlightResiduals], residual: Mapping[str, np.ndarray], options: Options
) -> tuple[float, float]:
    """Return the log evidence of a Gauss-Markov force over sensors alone in a residual (m, 15) by
    flight, and its deviation by level axis [N].

    Args:
        residual: by flight, (m, 15) what a model leaves of it.
    """
    spectra = [_spectra(flight, residual[flight.name]) for flight in flights]
    mass = flights[0].vehicle.mass
    gravity = flights[0].vehicle.gravity
    centre, spread = _prior(options, gravity, max(len(values) for _, values in spectra))
    bounds = list(zip(centre - REACH * spread, centre + REACH * spread, strict=True))
    n = len(centre)
    time, times = options.priors.gust_time

    def misfit(z: np.ndarray, force: np.ndarray | None = None) -> float:
        return _loss(spectra, z, force) + 0.5 * float(np.sum(((z - centre) / spread) ** 2))

    def with_force(z: np.ndarray) -> float:
        return misfit(z[:n], z[n:]) + 0.5 * ((z[n + 1] - np.log(time)) / times) ** 2

    sensors = scipy.optimize.minimize(misfit, centre, method="L-BFGS-B", bounds=bounds)
    about = [
        (centre[0] - 4, centre[0] + 4),
        (np.log(time) - REACH * times, np.log(time) + REACH * times),
    ]
    ends = (
        scipy.optimize.minimize(
            with_force,
            [*z, centre[0] + np.log(s), np.log(time)],
            method="L-BFGS-B",
            bounds=[*bounds, *about],
        )
        for z, s in zip((sensors.x, centre), STARTS, strict=True)
    )
    best = min(ends, key=lambda end: end.fun)
    return max(float(sensors.fun - best.fun), 0.0), mass * float(np.exp(best.x[n]))


def _slow_power(flights: Sequence[FlightResiduals], residual: Mapping[str, np.ndarray]) -> float:
    """Return the mean square of the slow force on a level axis, its mean apart [N²], from a
    residual (m, 15) by flight.

    In the body as in W: an attitude that is read askew turns with a vehicle that yaws.
    """
    spectra = [_spectra(flight, residual[flight.name], upright=True) for flight in flights]
    power = [np.sum(np.mean(values[0] ** 2, axis=1)) * f[0] for f, values in spectra]
    return float(flights[0].vehicle.mass ** 2 * np.mean(power))


def _spectra(flight: FlightResiduals, residual: np.ndarray, *, upright: bool = False) -> Spectra:
    """Return the spectra of what is left of a flight (m, 15); `upright`: without its mean in body
    axes, (3,).
    """
    step = flight.grid.step
    R = flight.q
    slip = attitude.rotate(R, residual[:, POSITION])
    from_position = np.gradient(slip, step, axis=0) + attitude.rotate(R, residual[:, VELOCITY])
    read = residual[:, FORCE] / flight.vehicle.mass
    both = [read + attitude.rotate_back(R, from_position), *([read] if flight.turned else [])]
    both = [b - b.mean(axis=0) for b in both] if upright else both
    across = [attitude.rotate(R, b * [1.0, 1.0, 0.0])[:, :2] for b in both]
    edge = round(0.25 / (TOP * step))
    slow = [low_pass(a, step, 4 * TOP)[edge : len(a) - edge] for a in across]
    n = len(slow[0])
    f = np.arange(n) / (2 * n * step)
    in_band = (f > 0) & (f <= TOP)
    values = [scipy.fft.dct(a, axis=0, norm="ortho")[in_band] * np.sqrt(2 * step) for a in slow]
    return f[in_band], np.stack(values)


def _prior(options: Options, gravity: float, channels: int) -> tuple[np.ndarray, np.ndarray]:
    """Return centre and spread of log sensor errors: attitude (RMS [m/s²], time [s], white),
    accelerometer.
    """
    tolerance = options.tolerance
    priors = options.priors
    turned = gravity * tolerance.attitude
    pairs = [(turned, priors.attitude_spread), priors.attitude_drift, (0.02 * turned, WHITE)]
    if channels == 2:
        size, spread = priors.accelerometer_flicker
        pairs += [(size * tolerance.acceleration, spread)]
        pairs += [(0.2 * tolerance.acceleration, WHITE)]
    return np.log([centre for centre, _ in pairs]), np.array([wide for _, wide in pairs])


def _markov(f: np.ndarray, rms: float, time: float) -> np.ndarray:
    """Return (k,) the one-sided power spectral density of a first-order Gauss-Markov process, of
    the logarithms.
    """
    return 4 * np.exp(2 * rms + time) / (1 + (2 * np.pi * f * np.exp(time)) ** 2)


def _loss(spectra: Sequence[Spectra], z: np.ndarray, force: np.ndarray | None) -> float:
    """Return minus the log likelihood, up to a constant; sensors' z and the force's (size, time)
    are logarithms.
    """
    total = 0.0
    for f, values in spectra:
        common = np.zeros(len(f)) if force is None else _markov(f, *force)
        position = _markov(f, z[0], z[1]) + np.exp(2 * z[2]) + common
        if len(values) == 1:
            total += float(
                np.sum(0.5 * np.sum(values[0] ** 2, axis=1) / position + np.log(position))
            )
            continue
        read = np.exp(2 * z[3]) / f + np.exp(2 * z[4]) + common
        # Whittle: at every frequency both channels are Gaussian, with the force as common part of
        # their spectra.
        det = position * read - common**2
        pp, pr, rr = (np.sum(values[i] * values[j], axis=1) for i, j in ((0, 0), (0, 1), (1, 1)))
        total += float(
            np.sum(0.5 * (read * pp - 2 * common * pr + position * rr) / det + np.log(det))
        )
    return total


def gust_probability(
    flights: Sequence[FlightResiduals],
    residual: Mapping[str, np.ndarray],
    held_out: Sequence[FlightResiduals],
    held_out_residual: Mapping[str, np.ndarray],
    options: Options,
    *,
    hidden: bool,
) -> float:
    """Return the probability of a slow force in the air; 0 where training flights show none.

    Args:
        residual: by flight, (m, 15) what a model leaves of them.
        hidden: whether the model has a payload, whose swing may have been lost.
    """
    seen, _ = slow_force(flights, residual, options)
    evidence, deviation = slow_force(
        [*flights, *held_out], {**residual, **held_out_residual}, options
    )
    thresholds = options.thresholds
    matters = deviation > options.materiality.force * flights[0].weight
    shown = seen > thresholds.held_out_share * thresholds.slow_force_evidence
    lost = hidden and _slow_power(flights, residual) < thresholds.held_out_share * _slow_power(
        flights, {flight.name: flight.y for flight in flights}
    )
    if not matters or not shown or lost:
        return 0.0
    return float(scipy.special.expit(evidence - thresholds.slow_force_evidence))


def position_p_value(
    flights: Sequence[FlightResiduals], residual: Mapping[str, np.ndarray], begins: Begins
) -> float:
    """Return the probability that gusts follow the position as much as this force does [1].

    Args:
        residual: by flight, (m, 15) what a model leaves of it.
        begins: by flight, when the wind begins [s]; None: from the start.
    Source: likelihood ratio of a level force that is quadratic in the position beside gusts, a mean
        in each span and a
    drag, under the gusts' covariance, as strong in each flight as they are there.
    """
    wind = wind_force(flights, residual, begins)
    x = np.concatenate([flight.rows.x[:, P] for flight in flights])
    # [m], for a height that is kept
    middle = x.mean(axis=0)
    size = x.std(axis=0) + 1e-9
    first, second = np.triu_indices(3)
    white = []
    for flight in flights:
        at = np.stack(
            [np.interp(flight.t, flight.rows.t, axis) for axis in flight.rows.x[:, P].T], axis=1
        )
        place = (at - middle) / size
        level = np.hstack(
            [
                forces(flight, residual[flight.name])[:, :2],
                *np.moveaxis(drags(flight)[:, :2], 1, 0),
                binned(flight, place),
                binned(flight, place[:, first] * place[:, second]),
            ]
        )
        pieces = [
            _about_its_mean(p, width(flight), wind)
            for p in spans(flight, level, begins.get(flight.name))
        ]
        if pieces:
            columns = np.concatenate(pieces)
            white.append(columns / np.sqrt(np.mean(columns[:, :2] ** 2)))
    if not white:
        return 1.0
    force, drag_x, drag_y, place = np.split(np.concatenate(white), [2, 5, 8], axis=1)
    less = scipy.linalg.orth(np.vstack([drag_x, drag_y]))
    more = scipy.linalg.orth(
        np.hstack([np.vstack([drag_x, drag_y]), scipy.linalg.block_diag(place, place)])
    )
    both = force.T.ravel()
    # Likelihood ratio: the power that the position explains beside the drag, by projection on both
    # column spaces.
    gain = np.sum((more.T @ both) ** 2) - np.sum((less.T @ both) ** 2)
    return float(scipy.stats.chi2.sf(gain, more.shape[1] - less.shape[1]))


def _about_its_mean(span: np.ndarray, width: float, wind: WindForce) -> np.ndarray:
    """Return (k, a) columns whitened, without what is constant before it was."""
    white, one, _ = whitened([span], width, wind.deviation[0], wind.correlation_time[0], wind.white)
    return white - np.outer(one, one @ white) / (one @ one)
