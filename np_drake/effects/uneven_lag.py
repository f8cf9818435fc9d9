"""Effect `uneven_lag`: first-order lag of rotors that slow down at another pace than they speed
up.
"""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Parameter
from np_drake.effects.motor_lag import MotorLag
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class UnevenLag(MotorLag):
    """First-order lag of rotor speed as `motor_lag`, with the time constant `down` while the
    command is below it.

    It is of a vehicle's calibration, and no cause.
    Source: an ESC drives a rotor up, and drag slows it.
    """

    time_constant: float = 0.03  # of a rotor that speeds up [s]
    down: float = 0.05  # of one that slows down [s]

    role = "calibration"
    named = "a lag of its own when slowing down"
    parameters = (  # type: ignore[assignment]  # one more than of the lag
        *MotorLag.parameters,
        Parameter("down", "s", 0.0, 0.0, 0.3, 0.03),
    )

    @property
    def slowing(self) -> float:
        """Time constant of a rotor that slows down [s]."""
        return self.down

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the rate of rotor speed, (..., 4) [rad/s²]."""
        missing = self.state_at(vehicle, command) - state
        return missing / np.where(missing < 0, self.down, self.time_constant)
