"""Effect `thrust_scale`: ratio of real to nominal thrust and rotor torque."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import ActuatorEffect, Parameter


@dc.dataclass(frozen=True)
class ThrustScale(ActuatorEffect):
    """Thrust f = scale * f_command on every rotor (worn propellers, thin air, battery sag).

    Source: own choice.
    """

    scale: float = 0.96  # [1]

    named = "a thrust scale"
    drawn = (0.005, 0.15)
    either_sign = True
    phrase = "thrust at {scale} of nominal"
    shares = True
    bench_check = "measure thrust on a stand"
    excited_by = "fast roll and pitch doublets: torque scales with thrust, weight does not"
    requires = ("thrust",)
    tolerance = "thrust"
    parameters = (
        Parameter("scale", "1", 1.0, 0.4, 3.0, 0.1, departure="thrust of all rotors {signed}"),
    )

    def thrust_gain(self, t: np.ndarray | float) -> np.ndarray | float:
        """Return the actual over the commanded thrust."""
        return self.scale
