"""Effect `blade_flapping`: pitch and roll moment of rotors in lateral flow."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Motion, Parameter, WrenchEffect, arm, log_uniform
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class BladeFlapping(WrenchEffect):
    """Moment tau_B = moment [v_y, -v_x, 0] with v = R^T (v_WB - wind): nose up in forward flight.

    Source: hub moment of a rotor that leans back in lateral flow, to first order in speed.
    """

    moment: float = 0.02  # [N·m·s/m]

    requires = ("velocity",)
    constant = True
    excited_by = "level sprints with sudden reversals"
    pushes = False
    parameters = (
        Parameter(
            "moment",
            "N·m·s/m",
            0.0,
            -0.2,
            0.2,
            0.02,
            departure=(
                "nose-up moment in forward flight, {size}|nose-down moment in forward "
                "flight, {size}"
            ),
        ),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        return {"moment": float(log_uniform(rng, 3e-4, 2e-2) * vehicle.mass * 9.81 * arm(vehicle))}

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return the moment in B, (..., 6) [N, N·m]; no force."""
        out = super().body_wrench(vehicle, motion)
        v_B = motion.air_B
        out[..., 3] = self.moment * v_B[..., 1]
        out[..., 4] = -self.moment * v_B[..., 0]
        return out
