"""Real flights of the paper's estimation table: arrays of wrench and motion."""

import dataclasses as dc
from pathlib import Path

import numpy as np

from np_drake.logs.formats.neurobem import TESTS, TRAINING, read_wrenches
from np_drake.skill.response import jerk
from np_drake.training_data.segments import Segment

MASS, GRAVITY = 0.752, np.array([0.0, 0.0, 9.8])  # with which the arrays were made, in body axes [kg, m/s²]


@dc.dataclass(frozen=True)
class Flight:
    """One flight of the estimation table; the first of `flights` is the training segment."""

    name: str  # in the paper's table
    segment: Segment

    @property
    def jerk(self) -> np.ndarray:
        """Magnitude of the third derivative of position, (n,) [m/s³].

        The arrays hold f = m (specific force - g e_z).
        """
        s = self.segment
        return jerk(s.chi[:, :3] / MASS + GRAVITY, s.zeta[:, 3:], s.step)


def flights(folder: Path) -> list[Flight]:
    """Return the training segment and the test flights.

    Raises: OSError, LogError: where one is missing or cannot be read.
    """
    names = {TRAINING: "training segment", **TESTS}
    found = [(name, read_wrenches(folder / "npy" / f"{stem}.npy")) for stem, name in names.items()]
    return [Flight(name, Segment(s.chi, s.zeta, s.step)) for name, s in found]
