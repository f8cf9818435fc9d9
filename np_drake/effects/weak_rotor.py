"""Effect `weak_rotor`: one rotor that gives less than the others."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import ActuatorEffect, Parameter, log_uniform
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class WeakRotor(ActuatorEffect):
    """Thrust f_rotor = efficiency f_command on one rotor, thrust and reaction torque alike.

    It is linear once the rotor is chosen.   Source: own choice: a chipped or loose propeller.
    """

    rotor: float = 1  # 1..4, as in the vehicle file
    efficiency: float = 0.85  # [1]

    sudden = True
    named = "a weak rotor"
    phrase = "{rotor} at {efficiency} of nominal"
    shares = True
    bench_check = "look at this rotor's propeller and motor"
    excited_by = "thrust steps and yaw doublets"
    requires = ("torque",)
    parameters = (
        Parameter("rotor", "", 1.0, 1.0, 4.0, 1.0, choices=(1.0, 2.0, 3.0, 4.0)),
        Parameter("efficiency", "1", 1.0, 0.0, 1.5, 0.1, departure="{rotor}: thrust {signed}"),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        return {"rotor": float(rng.integers(1, 5)), "efficiency": 1 - log_uniform(rng, 0.01, 0.25)}

    def possible(self, vehicle: Vehicle, height: float) -> bool:
        """Return whether the rotor is weaker than the others, and not stronger.

        Args:
            vehicle: not used.
            height: not used.
        """
        return self.efficiency <= 1.0

    def thrust_gain(self, t: np.ndarray | float) -> np.ndarray | float:
        """Return the actual over the commanded thrust."""
        gain = np.ones(4)
        gain[round(self.rotor) - 1] = self.efficiency
        return gain
