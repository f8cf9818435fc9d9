"""Effect `translational_lift`: additional thrust of rotors in lateral flow."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Motion, Parameter, WrenchEffect, log_uniform
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class TranslationalLift(WrenchEffect):
    """Additional thrust f_B = lift (v_x² + v_y²) z_B with v = R^T (v_WB - wind).

    Source: lateral flow lowers the induced velocity of a rotor; own choice: the leading, quadratic
    term.
    """

    lift: float = 0.05  # [N·s²/m²]

    requires = ("velocity",)
    excited_by = "sprints at constant height, then hover"
    turns = False
    parameters = (
        Parameter(
            "lift",
            "N·s²/m²",
            0.0,
            0.0,
            1.0,
            0.05,
            departure=(
                "thrust rises with speed squared by {size}|thrust falls with speed "
                "squared by {size}"
            ),
        ),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        return {"lift": float(log_uniform(rng, 3e-4, 2e-2) * vehicle.mass * 9.81)}

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return the thrust in B, (..., 6) [N, N·m]; no torque."""
        out = super().body_wrench(vehicle, motion)
        v_B = motion.air_B
        out[..., 2] = self.lift * np.sum(v_B[..., :2] ** 2, axis=-1)
        return out
