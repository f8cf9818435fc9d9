"""Effect `throttle_curve`: an error in the exponent of the map from throttle to thrust."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import ActuatorEffect, Parameter
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class ThrottleCurve(ActuatorEffect):
    """Thrust f = f_h (f_command / f_h)^(1 + curve) on every rotor, with f_h the thrust that hovers.

    A nuisance of logs whose input is a throttle: never a cause.
    Source: own choice; motors lie between a linear and a quadratic map.
    """

    curve: float = 0.2  # [1]

    role = "nuisance"
    turns_rotor = True
    named = "the throttle curve"
    linear = False
    parameters = (
        Parameter(
            "curve", "1", 0.0, -0.9, 2.0, 0.1, departure="exponent of thrust over throttle {signed}"
        ),
    )

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return the actual thrusts (..., 4) [N]."""
        hover = 0.25 * vehicle.mass * vehicle.gravity
        return hover * np.maximum(command / hover, 0.0) ** (1.0 + self.curve)
