"""Effect `ground_effect`: more thrust near the ground."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Motion, Parameter, WrenchEffect, log_uniform
from np_drake.vehicle import Vehicle

_LARGEST_RADIUS = 6.0  # of rotor radii: a disc twice as wide as the whole vehicle
_LARGEST_SHARE = 1 / 3  # of (R / 4h)²: thrust at most 1.5 times; the formula diverges at h = R / 4


@dc.dataclass(frozen=True)
class GroundEffect(WrenchEffect):
    """Thrust and reaction torque of every rotor times 1 / (1 - (R / 4h)²), R = effective_radius, h
    = p_z.

    Prior: about two rotor radii, and no wider, as the size of the vehicle is known (own choice).
    The ground is z = 0; all rotors are at the height of Bo (own choice: no levelling torque of a
    tilted vehicle).
    Source: method of images (Cheeseman and Bennett 1955); ratio held at 1.5 from h = 0.43 R
        downwards.
    """

    effective_radius: float = 0.25  # [m]

    requires = ("height",)
    excited_by = "a descent to below two rotor radii"
    linear = False
    widens = False
    parameters = (Parameter("effective_radius", "m", 0.0, 0.0, 2.0, 0.2),)

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        return {
            "effective_radius": float(vehicle.rotor_radius * log_uniform(rng, 1.0, _LARGEST_RADIUS))
        }

    @classmethod
    def grid(cls, vehicle: Vehicle) -> list[dict[str, float]]:
        """Return the radii at which a search linearises it."""
        return [{"effective_radius": v * vehicle.rotor_radius} for v in (1.0, 1.6, 2.4, 3.5, 5.0)]

    def possible(self, vehicle: Vehicle, height: float) -> bool:
        """Return whether a vehicle of this size can have the radius."""
        return self.effective_radius <= _LARGEST_RADIUS * vehicle.rotor_radius

    def gain(self, height: np.ndarray) -> np.ndarray:
        """Return the thrust that is gained at heights (...,) [m], over that far above [1]."""
        above = np.maximum(height, 1e-6)
        share = np.minimum((self.effective_radius / (4.0 * above)) ** 2, _LARGEST_SHARE)
        return share / (1.0 - share)

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return the additional thrust and torque in B, (..., 6) [N, N·m]."""
        gain = self.gain(motion.x[..., 2])
        u = (gain[..., None] * motion.rotor_thrust) @ vehicle.mixer.T
        out = super().body_wrench(vehicle, motion)
        out[..., 2:] = u
        return out
