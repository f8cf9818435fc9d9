"""Effect `quadratic_drag`: drag of the airframe, quadratic in the body's air speed."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import ALIKE, Motion, Parameter, WrenchEffect, drag_coefficients
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class QuadraticDrag(WrenchEffect):
    """Drag f_B,i = -c_i |v_i| v_i with v = R^T (v_WB - wind), axis by axis; it acts at Bo.

    Source: form drag of a bluff body; own choice: the axes do not mix.
    """

    c_x: float = 0.05  # [N·s²/m²]
    c_y: float = 0.05  # [N·s²/m²]
    c_z: float = 0.05  # [N·s²/m²]

    requires = ("velocity",)
    excited_by = "sprints at 1, 3 and 6 m/s: the square shows at speed"
    told_from = {"linear_drag": "sprints at 1, 3 and 6 m/s: the square shows at speed"}
    turns = False
    prior_correlation = ALIKE
    parameters = tuple(
        Parameter(name, "N·s²/m²", 0.0, 0.0, 2.0, 0.08) for name in ("c_x", "c_y", "c_z")
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case: a heavy vehicle has more drag."""
        return dict(
            zip(("c_x", "c_y", "c_z"), drag_coefficients(rng, vehicle, 0.003, 0.08), strict=True)
        )

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return the drag in B, (..., 6) [N, N·m]."""
        out = super().body_wrench(vehicle, motion)
        v_B = motion.air_B
        out[..., :3] = np.array([-self.c_x, -self.c_y, -self.c_z]) * np.abs(v_B) * v_B
        return out
