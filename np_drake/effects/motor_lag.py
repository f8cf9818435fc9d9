"""First-order lag of the rotors."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class MotorLag:
    """T d omega/dt = omega_command - omega, on rotor speed; f = k omega².   Source: first-order ESC and motor."""

    time_constant: float = 0.03  # [s]

    identifier: ClassVar[str] = "motor_lag"
    state_size: ClassVar[int] = 4
    turns_rotor: ClassVar[bool] = True

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(4,) rotor speed [rad/s] that holds `thrust` (4,) [N]."""
        return np.sqrt(np.maximum(thrust, 0.0) / vehicle.thrust_coefficient)

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., 4) [rad/s²]."""
        return (self.state_at(vehicle, command) - state) / self.time_constant

    def thrust(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., 4) [N]."""
        return vehicle.thrust_coefficient * state**2
