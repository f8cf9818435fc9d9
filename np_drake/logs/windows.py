"""Changes and integrals of sampled quantities over windows, by which a quantity is compared with
its rate.
"""

import numpy as np

from np_drake import attitude


def stretches(mask: np.ndarray) -> np.ndarray:
    """Return first row and row after the last of every stretch in which a mask (n,) holds, (k,
    2).
    """
    return np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int))).reshape(
        -1, 2
    )


class Windows:
    """Windows that begin at each row and hold as many intervals, `rows`.

    Args:
        t: (n,) times of the rows [s].
        seconds: duration of a window [s].
    """

    def __init__(self, t: np.ndarray, seconds: float) -> None:
        self._t = t
        self.rows = max(1, round(seconds / float(np.median(np.diff(t)))))

    @property
    def fit(self) -> bool:
        """Whether the log holds two of them."""
        return len(self._t) > 2 * self.rows

    @property
    def spans(self) -> np.ndarray:
        """Duration of each window, (n - rows,) [s]."""
        return self.change(self._t)

    def change(self, value: np.ndarray) -> np.ndarray:
        """Return the change of a quantity (n, k) over each window, (n - rows, k)."""
        return value[self.rows :] - value[: -self.rows]

    def integral(self, rate: np.ndarray) -> np.ndarray:
        """Return the integral of a rate (n, k) over each window, (n - rows, k), by the trapezoidal
        rule.
        """
        area = 0.5 * (rate[1:] + rate[:-1]) * np.diff(self._t)[:, None]
        return self.change(np.concatenate([np.zeros((1, rate.shape[1])), np.cumsum(area, axis=0)]))

    def turn(self, q: np.ndarray) -> np.ndarray:
        """Return the sum of the small rotations of q (n, 4) in body axes over each window, (n -
        rows, 3) [rad].
        """
        turn = attitude.multiply(q[:-1] * [1.0, -1.0, -1.0, -1.0], q[1:])
        # A small rotation vector is twice the vector part of its quaternion, of the sign with w >
        # 0.
        small = 2 * turn[:, 1:] * np.sign(turn[:, :1])
        return self.change(np.concatenate([np.zeros((1, 3)), np.cumsum(small, axis=0)]))
