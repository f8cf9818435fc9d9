"""Effect `battery_sag`: thrust over throttle that falls with the battery."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import ActuatorEffect, Parameter


@dc.dataclass(frozen=True)
class BatterySag(ActuatorEffect):
    """Thrust f = (1 + rate t) f_command on every rotor, t since the flight began.

    A nuisance of logs whose input is a throttle: never a cause.   Source: own choice.
    """

    rate: float = -0.002  # [1/s]

    role = "nuisance"
    bench_check = "log the battery's voltage"
    parameters = (
        Parameter(
            "rate",
            "1/s",
            0.0,
            -0.1,
            0.1,
            0.002,
            departure="thrust grows by {size} a minute|thrust falls by {size} a minute",
        ),
    )

    def thrust_gain(self, t: np.ndarray | float) -> np.ndarray | float:
        """Return the actual over the commanded thrust."""
        return (1.0 + self.rate * np.asarray(t, float))[..., None]
