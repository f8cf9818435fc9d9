"""Effect `thrust_scale`: ratio of real to nominal thrust and rotor torque."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.effects.base import ActuatorEffect, Parameter
from np_drake.effects.random_sizes import signed
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class ThrustScale(ActuatorEffect):
    """Thrust f = scale * f_command on every rotor (worn propellers, thin air, battery sag).

    Source: own choice.
    """

    scale: float = 0.96  # [1]

    identifier: ClassVar[str] = "thrust_scale"
    named: ClassVar[str] = "a thrust scale"
    phrase: ClassVar[str] = "thrust at {scale} of nominal"
    shares: ClassVar[bool] = True
    bench_check: ClassVar[str] = "measure thrust on a stand"
    excited_by: ClassVar[str] = "fast roll and pitch doublets: torque scales with thrust, weight does not"
    requires: ClassVar[tuple[str, ...]] = ("thrust",)
    tolerance: ClassVar[str] = "thrust"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("scale", "1", 1.0, 0.4, 1.6, 0.1),)

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        return {"scale": float(1 + signed(rng, 0.005, 0.15))}

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return the actual thrusts (..., 4) [N]."""
        return self.scale * command
