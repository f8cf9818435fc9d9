"""Past samples that a linear encoder sees: the newest one by one, older ones in averages that grow
longer.
"""

import dataclasses as dc
import itertools

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view


@dc.dataclass(frozen=True)
class DelayTaps:
    """Selection of the newest samples one by one and of older ones as box averages.

    Averages lose little of what lies far back and reduce its noise.
    """

    delay: int  # samples of the window [1]
    dense: int  # of them one by one, the newest [1]
    averages: int  # box averages over the others [1]

    def __post_init__(self):
        if not 1 <= self.dense <= self.delay or not 0 <= self.averages <= self.delay - self.dense:
            raise ValueError(
                "DelayTaps: must have 1 <= dense <= delay and 0 <= averages <= delay - dense; "
                f"got {self.dense}, {self.averages}, {self.delay}."
            )

    @property
    def matrix(self) -> np.ndarray:
        """Weights of the samples, (taps, delay), oldest sample first; row 0 is the newest sample
        [1].
        """
        rows = [np.eye(1, self.delay, self.delay - 1 - d)[0] for d in range(self.dense)]
        edges = _edges(self.dense, self.delay, self.averages) if self.averages else np.zeros(0, int)
        for near, far in itertools.pairwise(edges):
            row = np.zeros(self.delay)
            row[self.delay - far : self.delay - near] = 1.0 / (far - near)
            rows.append(row)
        return np.array(rows)

    def features(self, samples: np.ndarray, origins: np.ndarray) -> np.ndarray:
        """Return the features of samples (n, c) at every origin, (o, taps * c).

        Args:
            samples: (n, c), oldest first.
            origins: (o,) sample indices, each at least delay - 1.
        """
        windows = sliding_window_view(samples, self.delay, axis=0)[
            origins - self.delay + 1
        ]  # (o, c, delay)
        return (windows @ self.matrix.T).transpose(0, 2, 1).reshape(len(origins), -1)

    def expand(self, W: np.ndarray, channels: int) -> np.ndarray:
        """Convert weights of features to weights of the window, oldest sample first, (K, delay *
        c).

        Args:
            W: (K, taps * c).
        """
        return np.einsum("ktc,td->kdc", W.reshape(len(W), -1, channels), self.matrix).reshape(
            len(W), -1
        )


def _edges(near: int, far: int, count: int) -> np.ndarray:
    """Return whole numbers from near to far with growing steps of at least one, (count + 1,)."""
    edges = np.round(np.geomspace(near, far, count + 1)).astype(int)
    for i in range(1, count):
        edges[i] = max(edges[i], edges[i - 1] + 1)
    for i in range(count - 1, 0, -1):
        edges[i] = min(edges[i], edges[i + 1] - 1)
    return edges
