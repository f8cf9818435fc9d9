"""Grid of the instants at which an effect may begin in one flight."""

import math

import numpy as np

from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.regressors import Sums, SwitchedSums

COARSE = 5  # rows between instants that are tried at first
EDGE = 0.7  # from either end of a flight, without onsets [s]
SPAN = 0.4  # that holds an onset as likely as possible [s]


class TriedOnsets:
    """Sums of a candidate at the tried instants of one flight, in order."""

    def __init__(self, late: SwitchedSums, *, goes_on: bool):
        self._late = late
        self.ends = at_rows(late.whole, [0, -1])  # from the start, and never
        self.start, self.never = at_rows(self.ends, [0]), at_rows(self.ends, [1])
        self.now = self.start
        self.onset: float | None = None
        self._inside, self.goes_on = possible_onsets(late.t), goes_on
        self.rows = self._inside[::COARSE]
        self.sums = late.begun(self.rows)

    def finer(self, profile: np.ndarray) -> np.ndarray:
        """Return untried rows about the best of the profile (n,)."""
        if not len(profile):
            return self.rows
        about = self._inside[np.abs(self._inside - self.rows[np.argmax(profile)]) < 2 * COARSE]
        return np.setdiff1d(about, self.rows)

    def add(self, rows: np.ndarray) -> None:
        """Add the sums at these rows."""
        order = np.argsort(np.concatenate([self.rows, rows]))
        new = self._late.begun(rows)
        self.rows = np.concatenate([self.rows, rows])[order]
        XX, XB, Xy = (np.concatenate(pair)[order] for pair in zip(self.sums, new, strict=True))
        self.sums = (XX, XB, Xy)

    def log_width(self, profile: np.ndarray) -> float:
        """Return the log width of the profile's peak, in shares of the flight."""
        if not len(profile):
            return -np.inf
        width = np.gradient(self.rows.astype(float)) if len(self.rows) > 1 else np.ones(1)
        return math.log(float(np.exp(profile - profile.max()) @ width) / len(self._inside))

    def most_likely(self, profile: np.ndarray) -> int:
        """Return the row in the middle of the span of `SPAN` that most likely holds the onset.

        Source: own choice.
        """
        dense = np.interp(self._inside, self.rows, profile)
        weight = np.exp(dense - dense.max())
        step = self._late.t[1] - self._late.t[0]
        width = max(1, round(SPAN / step))
        mass = (
            np.convolve(weight, np.ones(width), "valid") if width < len(weight) else np.array([weight.sum()])
        )
        first = int(np.argmax(mass))
        span = np.cumsum(weight[first : first + width])
        return int(self._inside[first + np.searchsorted(span, 0.5 * span[-1])])

    @property
    def begins(self) -> bool:
        """Whether it is settled on an instant of the flight."""
        return self.onset is not None and self.onset != NEVER

    def leave_out(self) -> None:
        """Settle on absence."""
        self.now, self.onset = self.never, NEVER

    def settle(self, row: int | None) -> None:
        """Settle on this row; None: from the start."""
        if row is None:
            self.now, self.onset = self.start, None
        else:
            tried = np.flatnonzero(self.rows == row)
            found = at_rows(self.sums, tried) if len(tried) else None
            self.now = found or self._late.begun(np.array([row]))
            self.onset = float(self._late.t[row])


def at_rows(sums: Sums, rows) -> Sums:
    """Return the sums of these rows alone."""
    XX, XB, Xy = sums
    return XX[rows], XB[rows], Xy[rows]


def possible_onsets(t: np.ndarray) -> np.ndarray:
    """Return rows, of whitened ones at t (m,) [s], that may be onsets."""
    return np.flatnonzero((t > t[0] + EDGE) & (t < t[-1] - EDGE))
