"""Thrust of rotors whose speed is measured, filtered for the noise of the readings.

Measurement noise enters both the residual and the regressors, which biases a regression (errors in variables). The
error of a Wiener estimate is independent of the estimate (Berkson), which leaves the regression unbiased. Where
nothing else is known, that error is as large as the noise of the readings.
"""

import itertools

import numpy as np

from np_drake import attitude
from np_drake.flight_log import FlightLog
from np_drake.training_data.segments import white_noise
from np_drake.vehicle import Vehicle

BAND = 1.0  # least bandwidth over which spectra are averaged [Hz]; own choice
THIRD = 2 ** (1 / 6) - 2 ** (-1 / 6)  # relative bandwidth of a one-third octave [1]; source: IEC 61260
ANSWERED = (
    0.5  # share of fast thrust to which the motion responds, above which it is no noise [1]; own choice
)
LEAST_ROWS = 5  # of a piece whose noise shows: a fourth difference
SURELY = 2.0  # standard deviations of a lower bound, and by which a band of signal exceeds the noise [1]


def read_thrust(log: FlightLog, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """Return rotor thrust (n, 4) at the rows [N] and the deviation (4,) of noise in thrust and torques [N, N·m].

    Thrust and torques are filtered, not the rotors: each has a spectrum of its own, and the rotors share theirs.
    Where the measured motion responds to the apparent noise, that is real thrust: the readings are returned unfiltered,
    with zero noise.
    """
    noise = white_noise(_measured_pieces(log))
    likely = most_likely(log.u, noise, log.step)
    if _answered(log, vehicle, log.u - likely) > ANSWERED:
        return log.u @ vehicle.unmixer.T, np.zeros(4)
    return likely @ vehicle.unmixer.T, noise


def _measured_pieces(log: FlightLog) -> list[np.ndarray]:
    """Return thrust and torques without the rows that a reader put into gaps, which are smooth, in pieces [N, N·m]."""
    if log.bridged is None:
        return [log.u]
    edges = np.concatenate([[-1], np.flatnonzero(log.bridged), [len(log)]])
    pieces = [log.u[a + 1 : b] for a, b in itertools.pairwise(edges) if b - a > LEAST_ROWS]
    return pieces or [log.u]


def most_likely(values: np.ndarray, noise: np.ndarray, step: float) -> np.ndarray:
    """Return values (n, k) without white noise, by the non-causal Wiener filter.

    A band whose mean power is not significantly above that of the noise holds no signal.

    Args:
        values: (n, k) samples.
        noise: (k,) standard deviation of the white noise, in the unit of the values.
        step: sample interval [s].
    """
    mean = values.mean(axis=0)
    mirrored = np.concatenate([values, values[::-1]]) - mean
    spectrum = np.fft.rfft(mirrored, axis=0)
    power, count = _band_means(np.abs(spectrum) ** 2 / len(mirrored), 1 / (len(mirrored) * step))
    # A bin of a mirrored record is one real variate: the mean of `count` has the variance 2 / count of chi-square.
    signal = power > noise**2 * (1 + SURELY * np.sqrt(2 / count))[:, None]
    gain = np.where(signal, 1 - noise**2 / np.where(signal, power, 1.0), 0.0)
    return mean + np.fft.irfft(gain * spectrum, len(mirrored), axis=0)[: len(values)]


def _band_means(power: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean power (m, k) in the band about each bin, and how many bins (m,) it holds.

    The bin of the mean belongs to no band but its own.   spacing: of the bins [Hz].
    """
    index = np.arange(len(power))
    half = 0.5 * np.maximum(BAND / spacing, THIRD * index)
    first = np.maximum(np.ceil(index - half).astype(int), 1)
    stop = np.minimum(np.floor(index + half).astype(int), len(power) - 1) + 1
    count = np.maximum(stop - first, 1)
    total = np.concatenate([0 * power[:1], np.cumsum(power, axis=0)])
    return (total[np.maximum(stop, first)] - total[first]) / count[:, None], count


def _answered(log: FlightLog, vehicle: Vehicle, fast: np.ndarray) -> float:
    """Return a lower bound on the share of fast thrust and torque (n, 4) to which the motion responds [1].

    Source: generalised least squares. The noise of differentiated readings follows from their own differences, whose
    variance is three times as large.
    """
    given = 0.5 * (fast[1:] + fast[:-1])
    answer = np.zeros_like(given)
    answer[:, 1:] = np.diff(log.w, axis=0) / np.diff(log.t)[:, None] @ vehicle.J.T
    if log.a is not None:
        force = vehicle.mass * attitude.rotate_back(log.q, log.a)[:, 2]
        answer[:, 0] = 0.5 * (force[1:] + force[:-1])
    rough = np.mean(np.diff(answer, axis=0) ** 2, axis=0) / 3
    weight = np.divide(1.0, rough, out=np.zeros(4), where=rough > 0)
    known = max(float(np.sum(weight * given**2)), 1e-300)
    return float(np.sum(weight * given * answer)) / known - SURELY / np.sqrt(known)
