"""Whitening of residual channels by an autoregressive model of each, and weights against
outliers.
"""

import dataclasses as dc

import numpy as np
from scipy import linalg, signal

ORDER = 16  # of the autoregressive model; own choice: 0.16 s at 100 Hz
OUTLYING = 3.0  # standard deviations from which a whitened residual counts less; Huber's bend
# noise below which no channel is [m/s², rad/s², 1]; source: sensors have ten times as much
LEAST = 1e-4
# from which it does not count; own choice: a Gaussian has none in a thousand years of flight
IMPOSSIBLE = 8.0


@dc.dataclass(frozen=True)
class Whitening:
    """Filters of the channels of one flight.

    taps: (c, p + 1) filter of each channel that maps it to unit white noise.
    good: (m,) rows that count. weight: (m, c) square root of Huber's weights [1].
    """

    taps: np.ndarray
    good: np.ndarray
    weight: np.ndarray

    @classmethod
    def of(cls, e: np.ndarray, good: np.ndarray, order: int = ORDER) -> "Whitening":
        """Return the filters that whiten residuals.

        Args:
            e: (m, c) residuals.
            good: (m,) rows that count.
        """
        # A constant is what parameters are to explain, not noise.
        deviation = np.where(good[:, None], e - (e[good].mean(axis=0) if good.any() else 0.0), 0.0)
        usual = (
            np.median(np.abs(deviation[good]), axis=0) / 0.6745
            if good.any()
            else np.ones(e.shape[1])
        )
        bounded = np.clip(deviation, -IMPOSSIBLE * usual, IMPOSSIBLE * usual)
        taps = np.stack([_filter(column, good, order) for column in bounded.T])
        reach = np.convolve(~good, np.ones(order + 1))[: len(good)]
        kept = (reach < 0.5) & (np.arange(len(good)) >= order)
        plain = cls(taps, kept, np.ones(e.shape))
        size = np.abs(plain.apply(deviation))
        spread = np.median(size[kept], axis=0) / 0.6745 if kept.any() else np.ones(e.shape[1])
        spread = np.maximum(spread, LEAST * taps[:, 0])
        ratio = size / spread
        weight = np.sqrt(np.minimum(1.0, OUTLYING / np.maximum(ratio, 1e-12))) / spread
        weight[ratio > IMPOSSIBLE] = 0.0
        return cls(taps, kept, weight)

    def apply(self, values: np.ndarray) -> np.ndarray:
        """Return whitened channels, zero where rows do not count.

        Args:
            values: (m, c) channels, or how they change with a parameter.
        """
        out = np.empty_like(values)
        for i, taps in enumerate(self.taps):
            out[:, i] = signal.lfilter(taps, 1.0, values[:, i])
        return out * np.where(self.good[:, None], self.weight, 0.0)


def _filter(x: np.ndarray, good: np.ndarray, order: int) -> np.ndarray:
    """Return the prediction error filter (order + 1,) of a channel, over its deviation.

    Args:
        x: (m,) the channel, zero where rows do not count.
        good: (m,) rows that count.
    """
    n = max(int(good.sum()), 1)
    r = np.array([x[: len(x) - k] @ x[k:] for k in range(order + 1)]) / n
    if r[0] <= 0.0:
        return np.append(1.0, np.zeros(order))
    r[0] *= 1.0 + 1e-9
    phi = linalg.solve_toeplitz(r[:-1], r[1:])
    return np.append(1.0, -phi) / np.sqrt(max(r[0] - phi @ r[1:], 1e-12 * r[0]))
