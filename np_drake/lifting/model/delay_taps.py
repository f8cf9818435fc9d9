"""Which past samples a linear encoder sees: the newest one by one, older ones in averages that grow longer."""

import dataclasses as dc
import itertools

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view


@dc.dataclass(frozen=True)
class DelayTaps:
    """The last `dense` samples as they are, those before as `averages` box averages back to `delay` samples.

    What lies far back says little about any single instant, so that averages lose nothing and halve the noise.
    """

    delay: int
    dense: int
    averages: int

    def __post_init__(self):
        if not 1 <= self.dense <= self.delay or not 0 <= self.averages <= self.delay - self.dense:
            raise ValueError(
                "DelayTaps: must have 1 <= dense <= delay and 0 <= averages <= delay - dense; "
                f"got {self.dense}, {self.averages}, {self.delay}."
            )

    @property
    def matrix(self) -> np.ndarray:
        """(taps, delay) weights of the samples, oldest first; row 0 is the newest sample."""
        rows = [np.eye(1, self.delay, self.delay - 1 - d)[0] for d in range(self.dense)]
        edges = _edges(self.dense, self.delay, self.averages) if self.averages else np.zeros(0, int)
        for near, far in itertools.pairwise(edges):
            row = np.zeros(self.delay)
            row[self.delay - far : self.delay - near] = 1.0 / (far - near)
            rows.append(row)
        return np.array(rows)

    def features(self, samples: np.ndarray, origins: np.ndarray) -> np.ndarray:
        """(o, taps * c) features of samples (n, c) as seen at `origins` (at least delay - 1)."""
        windows = sliding_window_view(samples, self.delay, axis=0)[origins - self.delay + 1]  # (o, c, delay)
        return (windows @ self.matrix.T).transpose(0, 2, 1).reshape(len(origins), -1)

    def expand(self, W: np.ndarray, channels: int) -> np.ndarray:
        """(K, taps * c) weights of features -> (K, delay * c) weights of the window, oldest sample first."""
        return np.einsum("ktc,td->kdc", W.reshape(len(W), -1, channels), self.matrix).reshape(len(W), -1)


def _edges(near: int, far: int, count: int) -> np.ndarray:
    """(count + 1,) whole numbers from near to far, the steps between them growing, at least one each."""
    edges = np.round(np.geomspace(near, far, count + 1)).astype(int)
    for i in range(1, count):
        edges[i] = max(edges[i], edges[i - 1] + 1)
    for i in range(count - 1, 0, -1):
        edges[i] = min(edges[i], edges[i + 1] - 1)
    return edges
