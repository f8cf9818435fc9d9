"""Effect `constant_wind`: a steady wind, which acts through a drag."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.effects.base import Parameter, WrenchEffect
from np_drake.effects.random_sizes import direction, log_uniform
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class ConstantWind(WrenchEffect):
    """Uniform and steady wind [x, y, z] in W; drags act on v - wind.

    Source: own choice.
    """

    x: float = 2.0  # [m/s]
    y: float = 0.0  # [m/s]
    z: float = 0.0  # [m/s]

    identifier: ClassVar[str] = "constant_wind"
    named: ClassVar[str] = "a constant wind"
    bench_check: ClassVar[str] = "measure the wind, or fly indoors"
    excited_by: ClassVar[str] = "the same sprint in opposite directions, and with two headings"
    grows_with: ClassVar[str] = "speed"
    feels_rotor_rate: ClassVar[bool] = False
    pushes: ClassVar[bool] = False
    turns: ClassVar[bool] = False
    needs: ClassVar[tuple[str, ...]] = ("linear_drag", "quadratic_drag")
    linear: ClassVar[bool] = False
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(axis, "m/s", 0.0, -15.0, 15.0, 0.5 if axis == "z" else 2.0) for axis in "xyz"
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case, about level."""
        size = log_uniform(rng, 0.5, 7.0)
        return dict(zip("xyz", size * direction(rng, 0.1), strict=True))

    def air_velocity(self, t: np.ndarray | float) -> np.ndarray:
        """Return the wind in W, (..., 3) [m/s]."""
        return np.broadcast_to([self.x, self.y, self.z], (*np.shape(t), 3))
