"""Effect `battery_sag`: thrust over throttle that falls with the battery."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.effects.base import ActuatorEffect, Parameter
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class BatterySag(ActuatorEffect):
    """Thrust f = (1 + rate t) f_command on every rotor, t since the flight began.

    A nuisance of logs whose input is a throttle: never a cause.   Source: own choice.
    """

    rate: float = -0.002  # [1/s]

    identifier: ClassVar[str] = "battery_sag"
    named: ClassVar[str] = "battery sag"
    bench_check: ClassVar[str] = "log the battery's voltage"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("rate", "1/s", 0.0, -0.1, 0.1, 0.002),)

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return the actual thrusts (..., 4) [N]."""
        return (1.0 + self.rate * np.asarray(t, float))[..., None] * command
