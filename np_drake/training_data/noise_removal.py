"""Removal of white noise from recorded signals, where the whole record is known."""

import numpy as np

BAND = 1.0  # least bandwidth over which spectra are averaged [Hz]; own choice
THIRD = 2 ** (1 / 6) - 2 ** (
    -1 / 6
)  # relative bandwidth of a one-third octave [1]; source: IEC 61260
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
