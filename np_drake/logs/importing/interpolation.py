"""Signal of a log, and its values at other times: states are integrated, readings averaged,
commands held.
"""

import dataclasses as dc
from collections.abc import Mapping
from functools import cached_property

import numpy as np

from np_drake import attitude
from np_drake.logs.checks import LEAST_ROWS

# Rate of rotor speed, of the throttle of each motor, and of torque, below which they are no input:
# what turns the vehicle is faster. Source: own choice.
SLOWEST_ROTORS = 20.0  # [Hz]
# share of rows equal to the row before, from which a signal's rate is slower [1]; own choice
REPEATED = 0.3
# ratio of sampling rates from which a rate fills in a state, or readings are averaged [1]; own
# choice
FASTER = 1.5


@dc.dataclass(frozen=True)
class Signal:
    """One quantity as logged: t (n,) [s], strictly increasing, and values (n, k) in the units of
    the file.

    tick: to which its times are rounded, where that is coarse [s].
    Its methods take times `at` (m,) [s].
    """

    t: np.ndarray
    values: np.ndarray
    tick: float = 0.0

    @property
    def step(self) -> float:
        """Median sampling interval [s]."""
        return float(np.median(np.diff(self.t)))

    @cached_property
    def _new(self) -> np.ndarray:
        """Whether a sample differs from the one before, (n,); all, unless many repeat."""
        new = np.concatenate([[True], np.any(np.diff(self.values, axis=0) != 0, axis=1)])[
            : len(self.t)
        ]
        return (
            new if LEAST_ROWS <= new.sum() <= (1 - REPEATED) * len(new) else np.ones(len(new), bool)
        )

    @property
    def renewal(self) -> float:
        """Median interval at which the values change [s]: that of the samples, unless many
        repeat.
        """
        return float(np.median(np.diff(self.t[self._new])))

    @property
    def renewed(self) -> "Signal":
        """The samples at which the values change, where many repeat.

        A signal that rests keeps one wherever it has not changed for two usual intervals of change:
        its rest is no gap.
        """
        rows, new = np.arange(len(self.t)), self._new
        usual = max(1, round(float(np.median(np.diff(rows[new])))))
        since = rows - np.maximum.accumulate(np.where(new, rows, 0))
        keep = new | ((since > 0) & (since % (2 * usual) == 0))
        return self if keep.all() else dc.replace(self, t=self.t[keep], values=self.values[keep])

    @property
    def rate(self) -> "Signal":
        """Mean rate of change between samples, in their middle (n - 1, 3); of an attitude its body
        rates.
        """
        x = self.values
        if x.shape[1] == 4:
            change = attitude.rotation_vector(attitude.multiply(attitude.conjugate(x[:-1]), x[1:]))
        else:
            change = np.diff(x, axis=0)
        return Signal(0.5 * (self.t[1:] + self.t[:-1]), change / np.diff(self.t)[:, None])

    def between(self, start: float, stop: float) -> "Signal":
        """Return the samples from `start` to `stop` [s]."""
        inside = (self.t >= start) & (self.t <= stop)
        return dc.replace(self, t=self.t[inside], values=self.values[inside])

    def linear(self, at: np.ndarray) -> np.ndarray:
        """Return the values by linear interpolation, (m, k); the ends are held."""
        return np.stack([np.interp(at, self.t, column) for column in self.values.T], axis=1)

    @cached_property
    def _sum(self) -> np.ndarray:
        area = 0.5 * (self.values[1:] + self.values[:-1]) * np.diff(self.t)[:, None]
        return np.concatenate([np.zeros((1, self.values.shape[1])), np.cumsum(area, axis=0)])

    def integral(self, at: np.ndarray) -> np.ndarray:
        """Return the integral from the first sample, (m, k): linear between samples and constant
        beyond them.
        """
        t, x = self.t, self.values
        i, inside = self._before(at), np.clip(at, t[0], t[-1])
        gone = (inside - t[i])[:, None]
        slope = (x[i + 1] - x[i]) / (t[i + 1] - t[i])[:, None]
        out = self._sum[i] + (x[i] + 0.5 * slope * gone) * gone
        before, after = np.minimum(at - t[0], 0.0), np.maximum(at - t[-1], 0.0)
        return out + before[:, None] * x[0] + after[:, None] * x[-1]

    def integrated(self, rate: "Signal", at: np.ndarray) -> np.ndarray:
        """Return a state (m, k) that follows its rate between samples, and meets the next sample.

        What the integral misses of the next sample is spread evenly over the interval.

        Args:
            at: (m,) [s].
        """
        i, own, x = self._before(at), rate.integral(self.t), self.values
        missed = (x[i + 1] - x[i]) - (own[i + 1] - own[i])
        return x[i] + (rate.integral(at) - own[i]) + self._share(i, at) * missed

    def turned(self, rate: "Signal | None", at: np.ndarray) -> np.ndarray:
        """Return attitudes (m, 4) that follow the body rates between samples, and meet the next
        sample.

        Without body rates that are denser they turn evenly. Turns within one interval of samples
        are taken as small: their order is neglected.

        Args:
            rate: body rates; None: not known.
            at: (m,) [s].
        """
        i, q = self._before(at), self.values
        step = attitude.rotation_vector(attitude.multiply(attitude.conjugate(q[:-1]), q[1:]))
        if rate is None or rate.step * FASTER >= self.step:
            turn = self._share(i, at) * step[i]
        else:
            own = rate.integral(self.t)
            turn = (rate.integral(at) - own[i]) + self._share(i, at) * (
                step[i] - (own[i + 1] - own[i])
            )
        out = attitude.multiply(q[i], attitude.from_rotation_vector(turn))
        return out / np.linalg.norm(out, axis=1, keepdims=True)

    def averaged(self, at: np.ndarray, width: float) -> np.ndarray:
        """Return the mean about each time, (m, k); linear where the samples are no denser.

        Args:
            at: (m,) [s].
            width: of the mean [s].
        """
        if len(self.t) < 2 or width < FASTER * self.step:
            return self.linear(at)
        return (self.integral(at + 0.5 * width) - self.integral(at - 0.5 * width)) / width

    def held(self, at: np.ndarray) -> np.ndarray:
        """Return the mean of a held command over each interval between the times, (m, k).

        Each row is held from its time until the next; the first also before, the last also after.
        The last row of the result is the command held at the last time.
        """
        t, x = self.t, self.values
        edges = np.concatenate([[0.0], np.cumsum(np.diff(t))])
        total = np.concatenate(
            [np.zeros((1, x.shape[1])), np.cumsum(x[:-1] * np.diff(t)[:, None], axis=0)]
        )
        i = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 1)
        at_edge = total[i] + x[i] * ((at - t[0]) - edges[i])[:, None]
        mean = np.diff(at_edge, axis=0) / np.diff(at)[:, None]
        exact = np.isin(at[:-1], t) & (
            np.searchsorted(t, at[1:]) - np.searchsorted(t, at[:-1]) <= 1
        )
        mean[exact] = x[i[:-1]][exact]  # no rounding where one command fills the interval
        return np.concatenate([mean, x[i[-1:]]])

    def _before(self, at: np.ndarray) -> np.ndarray:
        """Return the interval of samples that holds each time, (m,)."""
        return np.clip(np.searchsorted(self.t, at, side="right") - 1, 0, len(self.t) - 2)

    def _share(self, i: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Return the share of intervals i (m,) that has passed, (m, 1) [1]."""
        return np.clip((at - self.t[i]) / (self.t[i + 1] - self.t[i]), 0.0, 1.0)[:, None]


Signals = Mapping[str, Signal]  # by quantity


def clock_of(signals: Signals) -> Signal:
    """Return the signal whose times are those of a log: its attitude, or else its body rates."""
    return signals["attitude" if "attitude" in signals else "rates"]
