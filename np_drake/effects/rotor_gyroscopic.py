"""Effect `rotor_gyroscopic`: angular momentum of the turning rotors."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Motion, Parameter, WrenchEffect, log_uniform
from np_drake.rigid_body import W
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class RotorGyroscopic(WrenchEffect):
    """Torque tau_B = -w x h - dh/dt with h = -I_r sum_i(direction_i omega_i) z_B, omega_i =
    sqrt(f_i / k).

    A rotor turns against its reaction torque, whose sign the vehicle file gives; hence the minus.
    Source: rate of change of the rotors' angular momentum, seen from the turning body.
    """

    rotor_inertia: float = 6.0e-5  # of one rotor about its axis [kg·m²]

    constant = True
    named = "the rotors' gyroscopic moment"
    excited_by = "roll and pitch doublets while yawing hard"
    pushes = False
    parameters = (
        Parameter(
            "rotor_inertia", "kg·m²", 0.0, 0.0, 3e-3, 1e-4, departure="inertia of a rotor {signed}"
        ),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        return {"rotor_inertia": float(vehicle.J[2, 2] * log_uniform(rng, 2e-4, 2e-2))}

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return the torque in B, (..., 6) [N, N·m]; no force."""
        out = super().body_wrench(vehicle, motion)
        w = motion.x[..., W]
        # Momentum is that of the turning rotors, whatever their blades give.
        turning = motion.rotor_thrust if motion.nominal_thrust is None else motion.nominal_thrust
        spin = -self.rotor_inertia * np.array(vehicle.rotor_directions)
        h = np.sqrt(np.maximum(turning, 0.0) / vehicle.thrust_coefficient) @ spin
        # -w x (h z)
        out[..., 3] = -w[..., 1] * h
        out[..., 4] = w[..., 0] * h
        out[..., 5] = -(motion.rotor_rate @ spin)
        return out
