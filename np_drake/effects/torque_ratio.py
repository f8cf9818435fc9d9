"""Effect `torque_ratio`: reaction torque of the rotors over their thrust, real over nominal."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Motion, Parameter, WrenchEffect
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class TorqueRatio(WrenchEffect):
    """Reaction torque of every rotor scaled at the same thrust, tau_z = (ratio - 1) times the yaw
    torque of the mixer.

    Propellers of another pitch or diameter have another ratio of torque to thrust.
    Source: own choice; the ratio is the power coefficient over the thrust coefficient.
    """

    ratio: float = 1.3  # [1]

    role = "change"
    named = "another torque over thrust"
    phrase = "torque over thrust at {ratio} of nominal"
    shares = True
    pushes = False
    begins = False
    widens = False
    bench_check = "compare propellers: diameter, pitch, blades"
    excited_by = "yaw doublets"
    parameters = (
        Parameter("ratio", "1", 1.0, 0.2, 5.0, 0.2, departure="torque over thrust {signed}"),
    )

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return the torque in B, (..., 6) [N, N·m]; no force."""
        out = super().body_wrench(vehicle, motion)
        out[..., 5] = (self.ratio - 1.0) * (motion.rotor_thrust @ vehicle.mixer[3])
        return out
