"""Real thrust and rotor torque over nominal."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class ThrustScale:
    """f = scale * f_command on every rotor (worn propellers, thin air, battery sag)."""

    scale: float = 0.96  # [1]

    identifier: ClassVar[str] = "thrust_scale"
    state_size: ClassVar[int] = 0
    turns_rotor: ClassVar[bool] = False

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(0,): no memory."""
        return np.zeros(0)

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., 0): no memory."""
        return np.zeros((*np.shape(command)[:-1], 0))

    def thrust(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., 4) [N]."""
        return self.scale * command
