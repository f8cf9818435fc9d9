"""Effect `mixer_gain`: the share of the rotors' torque that acts on the vehicle."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Motion, Parameter, WrenchEffect
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class MixerGain(WrenchEffect):
    """Gain on the rotors' torque, tau_B = (gain - 1) times the torque of the mixer, axis by axis.

    Errors of the arms, of torque over thrust and of the inertia by a factor are not distinguishable
    from it: flight shows only their ratio. A fitted gain is not that ratio alone: rotor thrust that
    trims aerodynamic moments outside the library is an error in the regressor and pulls the gain
    towards zero (regression dilution).
    Source: own choice.
    """

    roll: float = 0.7  # [1]
    pitch: float = 0.7  # [1]
    yaw: float = 0.7  # [1]

    role = "mixer"
    named = "a gain of the mixer"
    shares = True
    begins = False
    pushes = False
    parameters = tuple(
        Parameter(
            name, "1", 1.0, 0.0, 2.0, 0.5, departure=f"{name} torque of the rotors {{signed}}"
        )
        for name in ("roll", "pitch", "yaw")
    )

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return the torque in B, (..., 6) [N, N·m]; no force."""
        tau_m = (motion.rotor_thrust @ vehicle.mixer.T)[..., 1:]
        out = super().body_wrench(vehicle, motion)
        out[..., 3:] = (np.array([self.roll, self.pitch, self.yaw]) - 1.0) * tau_m
        return out
