"""Encoder of windows within which a motion began, averaged over the age of that onset.

A linear encoder fits windows of which the whole is one motion. Where a swing begins or a weight is attached within
the window, the samples before that say nothing about it. A jump of the modes r samples ago, Gaussian a priori, shows
as M_r w in a window w, and has the odds o_r e_r of being there. The mean of z over all onsets is

    z = E w + sum over r of p_r G_r M_r w,      p_r = o_r e_r / (1 + sum over s of o_s e_s)
    e_r = exp(|M_r w|² / 2 - c_r)

with the linear encoder E of ordinary windows. It depends on the window alone: there is no memory. An age beyond the
window stands for a free motion that resembles nothing in the training.
Source: the likelihood ratio of jumps in linear systems is Willsky and Jones 1976; a Gaussian jump and the mean over
its ages, in place of the most likely one: own choice, so that z has no steps.
"""

import dataclasses as dc

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

LARGEST = 700.0  # exponent that a float still holds [1]
CHUNK = 2000  # windows at a time [1]


@dc.dataclass(frozen=True)
class Onsets:
    """Correction of E w for V views of the samples, R ages and jumps of q modes.

    channels: (V, c, 12) what a view sees of a sample [chi, zeta], scaled; rows of zeros where it sees less than c.
    """

    channels: np.ndarray
    watch: np.ndarray  # (V, R, q, D c) M_r, oldest sample first
    cost: np.ndarray  # (V, R) c_r
    jump: np.ndarray  # (V, R, k, q) G_r, into the view's k states of z, which stand side by side in it
    odds: np.ndarray | float  # o_r of a jump at that age against none at all, (R,) or one for all ages [1]

    def __post_init__(self):
        V, R, q, n = self.watch.shape if self.watch.ndim == 4 else (0, 0, 0, 0)
        k, c = (self.jump.shape[-2], self.channels.shape[-2]) if self.jump.ndim == 4 else (0, 1)
        wanted = {"channels": (V, c, 12), "cost": (V, R), "jump": (V, R, k, q)}
        if V == 0 or n % c or any(getattr(self, name).shape != shape for name, shape in wanted.items()):
            raise ValueError("Onsets: watch (V, R, q, D c), channels, cost and jump must agree on V, R, q and c.")
        odds = np.asarray(self.odds)
        if odds.shape not in ((), (1,), (R,)) or not (np.all(odds > 0) and np.all(np.isfinite(odds))):
            raise ValueError(f"Onsets: odds must be positive and finite, one or one an age; got {odds.tolist()}.")

    @property
    def K(self) -> int:
        """Number of lifted states."""
        return self.jump.shape[0] * self.jump.shape[2]

    @property
    def delay(self) -> int:
        """Number of samples of the window."""
        return self.watch.shape[3] // self.channels.shape[1]

    def correction(self, window: np.ndarray) -> np.ndarray:
        """Return what is added to E w, (..., K).

        Args: window: (..., D, 12) samples [N, N·m, m/s, rad/s], oldest first.
        """
        seen, p = self._seen(window)
        z = np.einsum("vrkq,v...rq->...vk", self.jump, p[..., None] * seen)
        return z.reshape(*window.shape[:-2], self.K)

    def probability(self, window: np.ndarray) -> np.ndarray:
        """Return the probability of an onset for each view and age, (..., V, R), from a window (..., D, 12) [1]."""
        return np.moveaxis(self._seen(window)[1], 0, -2)

    def along(self, samples: np.ndarray) -> np.ndarray:
        """Return the correction (n - D + 1, K) for every full window of samples (n, 12), n >= D."""
        windows = sliding_window_view(samples, self.delay, axis=0).swapaxes(1, 2)
        return np.concatenate([self.correction(windows[i : i + CHUNK]) for i in range(0, len(windows), CHUNK)])

    def _seen(self, window: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return M_r w (V, ..., R, q) and p_r (V, ..., R)."""
        V, R, q, n = self.watch.shape
        outer = window.shape[:-2]
        scaled = window[None].reshape(1, -1, 12) @ self.channels.swapaxes(1, 2)  # (V, o D, c)
        seen = (scaled.reshape(V, -1, n) @ self.watch.reshape(V, R * q, n).swapaxes(1, 2)).reshape(V, *outer, R, q)
        cost = self.cost.reshape(V, *[1] * len(outer), R)
        e = np.log(self.odds) + np.minimum(0.5 * np.einsum("...q,...q->...", seen, seen) - cost, LARGEST)
        # p_r = exp(e_r) / (1 + sum exp(e_s)), less the largest exponent, so that nothing overflows
        top = np.maximum(e.max(axis=-1, keepdims=True), 0.0)
        likely = np.exp(e - top)
        return seen, likely / (np.exp(-top) + likely.sum(axis=-1, keepdims=True))
