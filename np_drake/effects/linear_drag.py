"""Effect `linear_drag`: rotor drag, linear in the body's air speed."""

import dataclasses as dc
import math
from typing import ClassVar

import numpy as np

from np_drake.effects.air_speed import ALIKE, air_velocity_B, chi_from_body
from np_drake.effects.base import Motion, Parameter, WrenchEffect
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class LinearDrag(WrenchEffect):
    """Drag f_B = -s diag(d) R^T (v - wind), with s = mean rotor speed / hover rotor speed.

    Source: blade-flapping and induced drag, lumped; the induced part grows with rotor speed (own choice: linearly).
    """

    d_x: float = 0.25  # [N·s/m], at hover rotor speed
    d_y: float = 0.25  # [N·s/m]
    d_z: float = 0.25  # [N·s/m]

    identifier: ClassVar[str] = "linear_drag"
    feels_rotor_rate: ClassVar[bool] = False
    turns: ClassVar[bool] = False
    prior_correlation: ClassVar[tuple[tuple[float, ...], ...]] = ALIKE
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(name, "N·s/m", 0.0, 0.0, 3.0, 0.3) for name in ("d_x", "d_y", "d_z")
    )

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi of the drag, (..., 6) [N, N·m]; it acts at the centre of mass."""
        hover, drag = math.sqrt(vehicle.mass * vehicle.gravity / 4), (-self.d_x, -self.d_y, -self.d_z)
        if motion.x.ndim == 1:  # one instant of the simulator: plain floats are several times as fast
            f_1, f_2, f_3, f_4 = (max(f, 0.0) for f in motion.rotor_thrust.tolist())
            roots = math.sqrt(f_1) + math.sqrt(f_2) + math.sqrt(f_3) + math.sqrt(f_4)
            speed = roots / (4 * hover)
            x, y, z = air_velocity_B(motion).tolist()
            return chi_from_body(
                motion, np.array((drag[0] * x * speed, drag[1] * y * speed, drag[2] * z * speed))
            )
        speed = np.sqrt(np.maximum(motion.rotor_thrust, 0.0)).sum(axis=-1) / (4 * hover)
        return chi_from_body(motion, np.array(drag) * air_velocity_B(motion) * speed[..., None])
