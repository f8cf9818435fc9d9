"""Thrust of rotors whose speed is read: noise of the readings stands in the residual and in what drives the model.

What is regressed on itself that way seems to answer to itself (errors in variables). The most likely thrust errs
independently of what it is (Berkson), which leaves regression unbiased; where nothing else is known it errs as much as
the readings do.
"""

import numpy as np
from scipy import ndimage

from np_drake import attitude
from np_drake.lifting.training.segments import white_noise
from np_drake.logs.flight_log import FlightLog
from np_drake.vehicle import Vehicle

BAND = 1.0  # over which powers are averaged [Hz]; own choice
ANSWERED = (
    0.5  # share of what is fast that the motion must surely answer to, for it to be no noise; own choice
)
SURELY = 2.0  # deviations [1]


def read_thrust(log: FlightLog, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """(n, 4) thrust at the rows [N], the most likely for what was read, and (4,) deviation of the readings' noise [N].

    Where the motion answers to what looks like noise, it is none: then as it was read.
    """
    read = log.u @ vehicle.unmixer.T
    noise = white_noise([read])
    likely = most_likely(read, noise, log.step)
    if _answered(log, vehicle, (read - likely) @ vehicle.mixer.T) > ANSWERED:
        return read, np.zeros(4)
    return likely, noise


def most_likely(values: np.ndarray, noise: np.ndarray, step: float) -> np.ndarray:
    """(n, k) values (n, k) every `step` [s] without white noise of deviation (k,): the non-causal Wiener filter."""
    mean = values.mean(axis=0)
    mirrored = np.concatenate([values, values[::-1]]) - mean
    spectrum = np.fft.rfft(mirrored, axis=0)
    bins = max(1, round(BAND * len(mirrored) * step))
    power = ndimage.uniform_filter1d(np.abs(spectrum) ** 2, bins, axis=0, mode="nearest") / len(mirrored)
    gain = np.clip(1 - noise**2 / np.maximum(power, 1e-300), 0.0, 1.0)
    return mean + np.fft.irfft(gain * spectrum, len(mirrored), axis=0)[: len(values)]


def _answered(log: FlightLog, vehicle: Vehicle, fast: np.ndarray) -> float:
    """Least share of fast thrust and torque (n, 4) that the motion surely shows [1]: generalised least squares.

    What differences of noisy readings are, their own differences tell: these are three times as strong.
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
