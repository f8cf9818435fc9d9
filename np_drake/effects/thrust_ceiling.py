"""Effect `thrust_ceiling`: rotors that reach less than their full thrust."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import ActuatorEffect, Parameter
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class ThrustCeiling(ActuatorEffect):
    """Thrust f = min(f_command, share * max_rotor_thrust) on every rotor.

    For simulators: the diagnosis does not look for it.
    Source: own choice: a current limit or a hot speed controller.
    """

    share: float = 0.7  # of the vehicle's largest rotor thrust [1]

    role = "simulated"
    turns_rotor = True
    linear = False
    parameters = (Parameter("share", "1", 1.0, 0.0, 1.0, 0.2),)

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return the actual thrusts (..., 4) [N]."""
        return np.minimum(command, self.share * vehicle.max_rotor_thrust)
