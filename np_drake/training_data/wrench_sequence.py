"""Wrench and motion at one fixed step, as training data of a predictor."""

import dataclasses as dc

import numpy as np


@dc.dataclass
class WrenchSequence:
    """Wrench chi and motion zeta of one flight at a fixed step.

    step: time between rows [s].   chi: (n, 6) [force, torque] [N, N·m]; the torque is in body axes.
    zeta: (n, 6) [velocity, body rates] [m/s, rad/s].   frame: of force and velocity, "world" | "body".
    total: True where chi is the whole wrench (NeuroBEM arrays), False where it is the residual one.
    A row with NaN has no label.
    """

    step: float
    chi: np.ndarray
    zeta: np.ndarray
    frame: str = "world"
    name: str = "flight"  # for messages and tables
    total: bool = False
    notes: list[str] = dc.field(default_factory=list)  # what a reader derived or repaired

    def __len__(self) -> int:
        return len(self.chi)

    @property
    def t(self) -> np.ndarray:
        """Time from the first row, (n,) [s]."""
        return self.step * np.arange(len(self))

    def check(self) -> "WrenchSequence":
        """Return self after checking shapes and names.

        Raises: ValueError: where they do not fit.
        """
        if self.frame not in ("world", "body"):
            raise ValueError(f"WrenchSequence: frame must be world or body; got {self.frame!r}.")
        if not 0 < self.step < np.inf:
            raise ValueError(f"WrenchSequence: step must be positive [s]; got {self.step}.")
        if np.ndim(self.chi) != 2 or np.shape(self.chi)[1] != 6 or np.shape(self.zeta) != np.shape(self.chi):
            raise ValueError(
                "WrenchSequence: chi and zeta must be (n, 6); "
                f"got {np.shape(self.chi)}, {np.shape(self.zeta)}."
            )
        return self
