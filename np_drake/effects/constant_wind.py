"""Effect `constant_wind`: a steady wind, which acts through a drag."""

import dataclasses as dc

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

    requires = ("velocity",)
    sudden = True
    widens = False
    named = "a constant wind"
    drawn = (0.5, 7.0)
    rise = 0.1
    bench_check = "measure the wind, or fly indoors"
    excited_by = "the same sprint in opposite directions, and with two headings"
    needs = ("linear_drag", "quadratic_drag")
    linear = False
    parameters = tuple(
        Parameter(axis, "m/s", 0.0, -15.0, 15.0, 0.5 if axis == "z" else 2.0) for axis in "xyz"
    )

    def air_velocity(self, t: np.ndarray | float) -> np.ndarray:
        """Return the wind in W, (..., 3) [m/s]."""
        return np.broadcast_to([self.x, self.y, self.z], (*np.shape(t), 3))
