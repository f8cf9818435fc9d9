"""Accelerations for a log without them, differentiated with zero phase, and decimation of a log to
a model's step.
"""

import dataclasses as dc

import numpy as np
import scipy

from np_drake import attitude
from np_drake.checks import require
from np_drake.finding import Finding, Kind
from np_drake.flight_log import FlightLog

LIFT_BAND = 4.0  # of a measured lift [Hz]; own choice: below motor lag
BANDWIDTH = 15.0  # [Hz], -6 dB; own choice: 0.3 m/s² of noise from 0.01 m/s at 100 Hz


def with_accelerations(log: FlightLog) -> FlightLog:
    """Return the log with a = dv/dt and al = dw/dt where it has none, and a note that says so.

    a_k = zero-phase low-pass of (v_(k+1) - v_k) / (t_(k+1) - t_k): over this interval row k's
    command acts, so the pairing of rows stays (a central difference would mix two commands). It
    uses the future: results one step ahead from such a log are not causal.
    Source: own choice.
    """
    new = [name for name in ("a", "al") if getattr(log, name) is None]
    if not new:
        return log
    a = smooth_derivative(log.v, log.t, BANDWIDTH) if log.a is None else log.a
    al = smooth_derivative(log.w, log.t, BANDWIDTH) if log.al is None else log.al
    text = (
        f"{', '.join(new)} differentiated smoothly (zero phase, {BANDWIDTH:g} Hz): they "
        "use the future, figures one step ahead are not causal"
    )
    return dc.replace(log, a=a, al=al, findings=[*log.findings, Finding(Kind.DERIVED, "", text)])


def smooth_derivative(value: np.ndarray, t: np.ndarray, bandwidth: float) -> np.ndarray:
    """Return the zero-phase derivative of `value` (n, m) over the interval after each row, (n, m).

    Args:
        value: (n, m) samples.
        t: (n,) times [s].
        bandwidth: of the low-pass [Hz].
    """
    rate = np.diff(value, axis=0) / np.diff(t)[:, None]
    return smoothed(np.concatenate([rate, rate[-1:]]), t, bandwidth)


def smoothed(value: np.ndarray, t: np.ndarray, bandwidth: float) -> np.ndarray:
    """Return `value` (n, m) after a zero-phase low-pass of second order; itself where the rows have
    no more.

    Args:
        value: (n, m) samples.
        t: (n,) times [s].
        bandwidth: of the low-pass [Hz].
    """
    nyquist = 0.5 / float(np.median(np.diff(t)))
    if bandwidth >= nyquist:
        return value
    sos = scipy.signal.butter(2, bandwidth / nyquist, output="sos")
    return scipy.signal.sosfiltfilt(sos, value, axis=0, padlen=min(len(value) - 1, 15))


def lift_over_weight(t: np.ndarray, v: np.ndarray, q: np.ndarray, gravity: float) -> np.ndarray:
    """Return the specific force along body z over gravity (n,) [1], in a band below motor lag.

    Args:
        t: (n,) [s].
        v: (n, 3) velocity in W [m/s].
        q: (n, 4) attitude, body to W.
        gravity: [m/s²].
    """
    a = smooth_derivative(v, t, LIFT_BAND) + [0.0, 0.0, gravity]
    return np.sum(a * attitude.body_z(q), axis=1) / gravity


def rows_at(log: FlightLog, step: float) -> np.ndarray:
    """Return the indices of the rows nearest to t_0, t_0 + step, …, (m,).

    Rows are picked, not averaged; quantities with content above the new rate must be filtered
    before (`labels` are).

    Args:
        step: between rows [s].
    Raises: ValueError: if the step is shorter than the log's, or leaves fewer than two rows.
    """
    require(
        step > 0.999 * log.step,
        f"decimate: step must be at least that of {log.name}, {log.step:.4g} s; got {step:.4g} s.",
    )
    wanted = np.arange(log.t[0], log.t[-1] + 0.5 * log.step, step)
    require(
        len(wanted) >= 2,
        f"decimate: {log.name} lasts {log.t[-1] - log.t[0]:.3g} s, less than {step:.3g} s.",
    )
    after = np.clip(np.searchsorted(log.t, wanted), 1, len(log) - 1)
    return np.where(wanted - log.t[after - 1] < log.t[after] - wanted, after - 1, after)


BAND = 1.0  # least bandwidth over which spectra are averaged [Hz]; own choice
# relative bandwidth of a one-third octave [1]; source: IEC 61260
THIRD = 2 ** (1 / 6) - 2 ** (-1 / 6)
SURE_DEVIATIONS = 2.0  # standard deviations by which a band of signal exceeds the noise [1]


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
    # A bin of a mirrored record is one real variate: the mean of `count` has the variance 2 / count
    # of chi-square.
    signal = power > noise**2 * (1 + SURE_DEVIATIONS * np.sqrt(2 / count))[:, None]
    # Wiener gain S / (S + N), with S + N the measured power.
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
