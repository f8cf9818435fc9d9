"""Effect `thrust_drift`: thrust that changes over the flight."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import ActuatorEffect, Parameter, signed
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class ThrustDrift(ActuatorEffect):
    """Thrust f = (start + rate t) f_command on every rotor, t since the flight began.

    Source: own choice: battery sag.
    """

    start: float = 1.0  # [1]
    rate: float = -0.005  # [1/s]

    named = "a drift of thrust"
    phrase = "a drift of thrust of {rate}"
    bench_check = "log the battery's voltage, and look whether it sags"
    excited_by = "the same manoeuvre at the start and at the end of a longer flight"
    requires = ("thrust",)
    parameters = (
        Parameter("start", "1", 1.0, 0.4, 1.6, 0.1),
        Parameter("rate", "1/s", 0.0, -0.1, 0.1, 0.005),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        return {"start": 1 + rng.uniform(-0.03, 0.03), "rate": signed(rng, 0.01, 0.15) / seconds}

    def thrust_gain(self, t: np.ndarray | float) -> np.ndarray | float:
        """Return the actual over the commanded thrust."""
        return (self.start + self.rate * np.asarray(t, float))[..., None]
