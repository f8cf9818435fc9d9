"""Effect `thrust_drift`: thrust that changes over the flight."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.effects.base import ActuatorEffect, Parameter
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class ThrustDrift(ActuatorEffect):
    """Thrust f = (start + rate t) f_command on every rotor, t since the flight began.

    Source: own choice: battery sag.
    """

    start: float = 1.0  # [1]
    rate: float = -0.005  # [1/s]

    identifier: ClassVar[str] = "thrust_drift"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("start", "1", 1.0, 0.4, 1.6, 0.1),
        Parameter("rate", "1/s", 0.0, -0.1, 0.1, 0.005),
    )

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return the actual thrusts (..., 4) [N]."""
        return (self.start + self.rate * np.asarray(t, float))[..., None] * command
