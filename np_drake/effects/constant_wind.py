"""Effect `constant_wind`: a steady wind, which acts through a drag."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.effects.base import Parameter, WrenchEffect


@dc.dataclass(frozen=True)
class ConstantWind(WrenchEffect):
    """Uniform and steady wind [x, y, z] in W; drags act on v - wind.

    Source: own choice.
    """

    x: float = 2.0  # [m/s]
    y: float = 0.0  # [m/s]
    z: float = 0.0  # [m/s]

    identifier: ClassVar[str] = "constant_wind"
    feels_rotor_rate: ClassVar[bool] = False
    pushes: ClassVar[bool] = False
    turns: ClassVar[bool] = False
    needs: ClassVar[tuple[str, ...]] = ("linear_drag", "quadratic_drag")
    linear: ClassVar[bool] = False
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(axis, "m/s", 0.0, -15.0, 15.0, 0.5 if axis == "z" else 2.0) for axis in "xyz"
    )

    def air_velocity(self, t: np.ndarray | float) -> np.ndarray:
        """Return the wind in W, (..., 3) [m/s]."""
        return np.broadcast_to([self.x, self.y, self.z], (*np.shape(t), 3))
