"""Effect `linear_drag`: rotor drag, linear in the body's air speed."""

import dataclasses as dc
import math

import numpy as np

from np_drake.compiled import compiled, turned
from np_drake.effects.base import ALIKE, Motion, Parameter, WrenchEffect, drag_coefficients
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class LinearDrag(WrenchEffect):
    """Drag f_B = -s diag(d) R^T (v - wind), with s = mean rotor speed / hover rotor speed.

    Source: blade-flapping and induced drag, lumped; the induced part grows with rotor speed (own
    choice: linearly).
    """

    d_x: float = 0.25  # [N·s/m], at hover rotor speed
    d_y: float = 0.25  # [N·s/m]
    d_z: float = 0.25  # [N·s/m]

    requires = ("velocity",)
    excited_by = "sprints at several speeds in both horizontal directions and vertically"
    turns = False
    prior_correlation = ALIKE
    parameters = tuple(
        Parameter(name, "N·s/m", 0.0, 0.0, 3.0, 0.3) for name in ("d_x", "d_y", "d_z")
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case: a heavy vehicle has more drag."""
        return dict(
            zip(("d_x", "d_y", "d_z"), drag_coefficients(rng, vehicle, 0.01, 0.3), strict=True)
        )

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return the drag in B, (..., 6) [N, N·m]; it acts at the centre of mass."""
        out = super().body_wrench(vehicle, motion)
        hover = math.sqrt(vehicle.mass * vehicle.gravity / 4)
        speed = np.sqrt(np.maximum(motion.rotor_thrust, 0.0)).sum(axis=-1) / (4 * hover)
        drag = -np.array((self.d_x, self.d_y, self.d_z))
        out[..., :3] = drag * motion.air_B * speed[..., None]
        return out


@compiled
def add_drag(x, rotor_thrust, d_x, d_y, d_z, hover, out):
    """Add the force of `LinearDrag` in still air at one instant to out[:3], in W [N].

    Args:
        x: (13,) state.
        rotor_thrust: (4,) [N].
        d_x: coefficient along body x [N·s/m].
        hover: root of a rotor's thrust in hover [N^0.5].
        out: at least three.
    """
    roots = 0.0
    for i in range(4):
        roots += math.sqrt(max(rotor_thrust[i], 0.0))
    speed = roots / (4 * hover)
    a, b, c = turned(x[3], -x[4], -x[5], -x[6], x[7], x[8], x[9])
    a = -d_x * a * speed
    b = -d_y * b * speed
    c = -d_z * c * speed
    a, b, c = turned(x[3], x[4], x[5], x[6], a, b, c)
    out[0], out[1], out[2] = out[0] + a, out[1] + b, out[2] + c
