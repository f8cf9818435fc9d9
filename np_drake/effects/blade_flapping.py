"""Effect `blade_flapping`: pitch and roll moment of rotors in lateral flow."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import (
    Motion,
    Parameter,
    WrenchEffect,
    air_velocity_B,
    arm,
    chi_from_body,
    log_uniform,
)
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
    feels_rotor_rate = False
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

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi of the moment, (..., 6) [N, N·m]."""
        v_B = air_velocity_B(motion)
        tau_B = self.moment * np.stack(
            [v_B[..., 1], -v_B[..., 0], np.zeros_like(v_B[..., 0])], axis=-1
        )
        return chi_from_body(motion, np.zeros_like(v_B), tau_B)
