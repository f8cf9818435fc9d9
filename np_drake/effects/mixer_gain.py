"""How much of the rotors' torque arrives as torque of the vehicle."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.effects.air_speed import chi_from_body
from np_drake.effects.base import Motion, Parameter, WrenchEffect
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class MixerGain(WrenchEffect):
    """tau_B = (gain - 1) times the torque that the rotors' thrusts give through the mixer, axis by axis.

    Arms, torque over thrust and inertia that are off by a factor all look like it: flight shows only their ratio.
    Fitted to flights it is no ratio of these alone: rotor thrust that trims moments of the air which no effect has is
    an error in the regressor and pulls it towards zero (regression dilution).      Source: own choice.
    """

    roll: float = 0.7  # [1]
    pitch: float = 0.7
    yaw: float = 0.7

    identifier: ClassVar[str] = "mixer_gain"
    begins: ClassVar[bool] = False
    feels_rotor_rate: ClassVar[bool] = False
    pushes: ClassVar[bool] = False
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(name, "1", 1.0, 0.0, 2.0, 0.5) for name in ("roll", "pitch", "yaw")
    )

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]; no force."""
        tau_m = (motion.rotor_thrust @ vehicle.mixer.T)[..., 1:]
        tau_B = (np.array([self.roll, self.pitch, self.yaw]) - 1.0) * tau_m
        return chi_from_body(motion, np.zeros_like(tau_B), tau_B)
