"""Thrust of rotors whose speed is measured, filtered for the noise of the readings.

Measurement noise enters both the residual and the regressors, which biases a regression (errors in variables). The
error of a Wiener estimate is independent of the estimate (Berkson), which leaves the regression unbiased. Where
nothing else is known, that error is as large as the noise of the readings.
"""

import numpy as np
from scipy import ndimage

from np_drake import attitude
from np_drake.lifting.training.segments import white_noise
from np_drake.logs.flight_log import FlightLog
from np_drake.vehicle import Vehicle

BAND = 1.0  # bandwidth over which spectra are averaged [Hz]; own choice
ANSWERED = (
    0.5  # share of fast thrust to which the motion responds, above which it is no noise [1]; own choice
)
SURELY = 2.0  # standard deviations of the lower bound [1]


def read_thrust(log: FlightLog, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """Return thrust (n, 4) at the rows and the standard deviation (4,) of its measurement noise [N].

    Where the measured motion responds to the apparent noise, that is real thrust: the readings are returned unfiltered,
    with zero noise.
    """
    read = log.u @ vehicle.unmixer.T
    noise = white_noise([read])
    likely = most_likely(read, noise, log.step)
    if _answered(log, vehicle, (read - likely) @ vehicle.mixer.T) > ANSWERED:
        return read, np.zeros(4)
    return likely, noise


def most_likely(values: np.ndarray, noise: np.ndarray, step: float) -> np.ndarray:
    """Return values (n, k) without white noise, by the non-causal Wiener filter.

    Args:
        values: (n, k) samples.
        noise: (k,) standard deviation of the white noise, in the unit of the values.
        step: sample interval [s].
    """
    mean = values.mean(axis=0)
    mirrored = np.concatenate([values, values[::-1]]) - mean
    spectrum = np.fft.rfft(mirrored, axis=0)
    bins = max(1, round(BAND * len(mirrored) * step))
    power = ndimage.uniform_filter1d(np.abs(spectrum) ** 2, bins, axis=0, mode="nearest") / len(mirrored)
    gain = np.clip(1 - noise**2 / np.maximum(power, 1e-300), 0.0, 1.0)
    return mean + np.fft.irfft(gain * spectrum, len(mirrored), axis=0)[: len(values)]


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
