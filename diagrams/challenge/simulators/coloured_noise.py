"""Coloured noise: Gauss-Markov processes and their sums."""

import numpy as np
from scipy import signal


def gauss_markov(
    rng: np.random.Generator, t: np.ndarray, channels: int, *, rms: float, tau: float
) -> np.ndarray:
    """Draw a first-order process (n, channels), which starts in its stationary distribution.

    Args:
        t: (n,) times [s]; exact for equal steps, the median step stands for all.
        tau: correlation time [s].
    """
    # Exact discretisation of dx = -x / tau dt + noise: an AR(1) process with decay exp(-step /
    # tau).
    decay = np.exp(-float(np.median(np.diff(t))) / tau)
    white = rng.normal(size=(len(t), channels))
    white[1:] *= np.sqrt(1 - decay**2)
    return rms * signal.lfilter([1.0], [1.0, -decay], white, axis=0)


def flicker(rng: np.random.Generator, t: np.ndarray, channels: int, *, rms: float) -> np.ndarray:
    """Draw noise (n, channels) of about 1/f from 0.02 to 10 Hz: Gauss-Markov processes of equal
    power a decade.

    Args:
        t: (n,) times [s], as of `gauss_markov`.
    """
    taus = (0.016, 0.16, 1.6, 8.0)  # [s]
    parts = [gauss_markov(rng, t, channels, rms=rms / np.sqrt(len(taus)), tau=tau) for tau in taus]
    return np.sum(parts, axis=0)
