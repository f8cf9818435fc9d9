"""Interpolation of signals at other times: states are integrated, readings averaged, commands held."""

import numpy as np

from np_drake import attitude

FASTER = 1.5  # ratio of sampling rates from which a rate fills in a state, or readings are averaged [1]; own choice


class Antiderivative:
    """Integral of a signal, linear between samples and constant beyond them.

    Args:
        t: (n,) times of its samples [s].
        x: (n, k) samples.
    """

    def __init__(self, t: np.ndarray, x: np.ndarray):
        self._t, self._x = t, x
        area = 0.5 * (x[1:] + x[:-1]) * np.diff(t)[:, None]
        self._sum = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(area, axis=0)])

    def __call__(self, at: np.ndarray) -> np.ndarray:
        """Return the integral from the first sample to `at` (m,) [s], (m, k)."""
        i = np.clip(np.searchsorted(self._t, at, side="right") - 1, 0, len(self._t) - 2)
        inside = np.clip(at, self._t[0], self._t[-1])
        gone = (inside - self._t[i])[:, None]
        slope = (self._x[i + 1] - self._x[i]) / (self._t[i + 1] - self._t[i])[:, None]
        out = self._sum[i] + (self._x[i] + 0.5 * slope * gone) * gone
        before, after = np.minimum(at - self._t[0], 0.0), np.maximum(at - self._t[-1], 0.0)
        return out + before[:, None] * self._x[0] + after[:, None] * self._x[-1]


def linear(t: np.ndarray, x: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return a signal by linear interpolation, (m, k); the ends are held.

    Args:
        t: (n,) times of its samples [s].
        x: (n, k) samples.
        at: (m,) [s].
    """
    return np.stack([np.interp(at, t, column) for column in x.T], axis=1)


def integrated(t: np.ndarray, x: np.ndarray, rate: Antiderivative, at: np.ndarray) -> np.ndarray:
    """Return a state (m, k) that follows its rate between samples, and meets the next sample.

    What the integral misses of the next sample is spread evenly over the interval.

    Args:
        t: (n,) times of its samples [s].
        x: (n, k) samples.
        rate: integral of its rate.
        at: (m,) [s].
    """
    i, share = _place(t, at)
    own, known = rate(t), rate(at)
    missed = (x[i + 1] - x[i]) - (own[i + 1] - own[i])
    return x[i] + (known - own[i]) + share[:, None] * missed


def turned(t: np.ndarray, q: np.ndarray, rate: Antiderivative | None, at: np.ndarray) -> np.ndarray:
    """Return attitudes (m, 4) that follow the body rates between samples, and meet the next sample.

    Without body rates they turn evenly. Turns within one interval of samples are taken as small: their order is
    neglected.

    Args:
        t: (n,) times of the samples [s].
        q: (n, 4) samples.
        rate: integral of the body rates; None: not known.
        at: (m,) [s].
    """
    i, share = _place(t, at)
    step = attitude.rotation_vector(attitude.multiply(attitude.conjugate(q[:-1]), q[1:]))
    if rate is None:
        turn = share[:, None] * step[i]
    else:
        own, known = rate(t), rate(at)
        turn = (known - own[i]) + share[:, None] * (step[i] - (own[i + 1] - own[i]))
    out = attitude.multiply(q[i], attitude.from_rotation_vector(turn))
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def averaged(t: np.ndarray, x: np.ndarray, at: np.ndarray, width: float) -> np.ndarray:
    """Return the mean of a signal about times, (m, k); linear where the samples are no denser.

    Args:
        t: (n,) times of its samples [s].
        x: (n, k) samples.
        at: (m,) [s].
        width: of the mean [s].
    """
    if len(t) < 2 or width < FASTER * float(np.median(np.diff(t))):
        return linear(t, x, at)
    total = Antiderivative(t, x)
    return (total(at + 0.5 * width) - total(at - 0.5 * width)) / width


def held(t: np.ndarray, x: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the mean of a held command over each interval between times, (m, k).

    Each row is held from its time until the next; the first also before, the last also after. The last row of the
    result is the command held at the last time.

    Args:
        t: (n,) times of the rows [s].
        x: (n, k) rows.
        at: (m,) edges of the intervals [s].
    """
    edges = np.concatenate([[0.0], np.cumsum(np.diff(t))])
    total = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(x[:-1] * np.diff(t)[:, None], axis=0)])
    i = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 1)
    at_edge = total[i] + x[i] * ((at - t[0]) - edges[i])[:, None]
    mean = np.diff(at_edge, axis=0) / np.diff(at)[:, None]
    exact = np.isin(at[:-1], t) & (np.searchsorted(t, at[1:]) - np.searchsorted(t, at[:-1]) <= 1)
    mean[exact] = x[i[:-1]][exact]  # no rounding where one command fills the interval
    return np.concatenate([mean, x[i[-1:]]])


def _place(t: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the interval of samples that holds each time, (m,), and the share of it that has passed, (m,) [1]."""
    i = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    return i, np.clip((at - t[i]) / (t[i + 1] - t[i]), 0.0, 1.0)
