"""Path of a vehicle that flies nearby, as a flight log or a simulation holds it."""

import dataclasses as dc

import numpy as np


@dc.dataclass(frozen=True, eq=False)
class Neighbour:
    """Path of a vehicle nearby, on the clock of the flight that it is beside, linear between its
    rows.

    t: (n,) increasing [s].   p: (n, 3) position in W [m].   name: of its log, for messages.
    Two are equal only if they are one object, so that one can be a key.
    """

    t: np.ndarray
    p: np.ndarray
    name: str = "neighbour"

    def __post_init__(self) -> None:
        """Raise ValueError where that is no path."""
        if np.ndim(self.t) != 1 or np.shape(self.p) != (len(self.t), 3) or len(self.t) < 2:
            raise ValueError(
                f"{self.name}: must have times (n,) and positions (n, 3), two rows at least."
            )
        if not (
            np.isfinite(self.t).all() and np.isfinite(self.p).all() and (np.diff(self.t) > 0).all()
        ):
            raise ValueError(
                f"{self.name}: must have finite positions at finite, increasing times."
            )

    def at(self, t: np.ndarray | float) -> np.ndarray:
        """Return the position in W at t (...,) [s], (..., 3) [m]; NaN before its first row and
        after its last.
        """
        columns = [np.interp(t, self.t, column, left=np.nan, right=np.nan) for column in self.p.T]
        return np.stack(columns, axis=-1)
