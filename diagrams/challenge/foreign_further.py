"""Further forces and torques that the library does not have.

Source of each law: own choice, of what vehicles are known to meet.
"""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from diagrams.challenge.out_of_library.aerodynamic import ForeignWrench, along_z, pushed, twisted
from np_drake.effects.air_speed import air_velocity_B
from np_drake.effects.base import Motion
from np_drake.rigid_body import P, V
from np_drake.vehicle import Vehicle


def _thrust(motion: Motion) -> np.ndarray:
    """(...,) of all rotors [N]."""
    return motion.rotor_thrust.sum(axis=-1)


@dc.dataclass(frozen=True)
class VortexRing(ForeignWrench):
    """The rotors lose `loss` of their thrust where the vehicle sinks into its own downwash, at about `speed`."""

    loss: float  # [1]
    speed: float  # of descent [m/s]
    width: float  # [m/s]

    identifier: ClassVar[str] = "vortex_ring"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        off = (motion.x[..., V][..., 2] + self.speed) / self.width
        return along_z(motion, -self.loss * _thrust(motion) * np.exp(-(off**2)))


@dc.dataclass(frozen=True)
class Weathervane(ForeignWrench):
    """tau_z = c |v| v_y in body axes: the tail turns into the wind."""

    c: float  # [N·s²/m]

    identifier: ClassVar[str] = "weathervane"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        v_B = air_velocity_B(motion)
        turn = self.c * np.linalg.norm(v_B, axis=-1) * v_B[..., 1]
        return twisted(turn[..., None] * np.array([0.0, 0.0, 1.0]))


@dc.dataclass(frozen=True)
class CeilingEffect(ForeignWrench):
    """The rotors give `strength` more just below a ceiling at `height`, fading over `reach`."""

    strength: float  # [1]
    reach: float  # [m]
    height: float  # [m]

    identifier: ClassVar[str] = "ceiling_effect"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        below = np.maximum(self.height - motion.x[..., P][..., 2], 0.0)
        return along_z(motion, self.strength * _thrust(motion) * np.exp(-below / self.reach))


@dc.dataclass(frozen=True)
class RotorSaturation(ForeignWrench):
    """No rotor gives more than `limit`."""

    limit: float  # [N]

    identifier: ClassVar[str] = "rotor_saturation"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        lost = -np.maximum(motion.rotor_thrust - self.limit, 0.0) @ vehicle.mixer.T
        return along_z(motion, lost[..., 0]) + twisted(lost[..., 1:])


@dc.dataclass(frozen=True)
class TwistedCable(ForeignWrench):
    """tau = -k sin(heading) about the vertical: a power cable that was laid out straight."""

    k: float  # [N·m]

    identifier: ClassVar[str] = "twisted_cable"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        R = motion.R_WB
        heading = np.arctan2(R[..., 1, 0], R[..., 0, 0])
        return twisted(-self.k * np.sin(heading)[..., None] * R[..., 2, :])


@dc.dataclass(frozen=True)
class SlidingLoad(ForeignWrench):
    """A load slides to the low side: tau = moment (n_y, -n_x) tanh(|n| / tilt) / |n| with n the lean of W's z in B."""

    moment: float  # weight times way [N·m]
    tilt: float  # [rad]

    identifier: ClassVar[str] = "sliding_load"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        n = motion.R_WB[..., 2, :]
        lean = np.maximum(np.hypot(n[..., 0], n[..., 1]), 1e-9)
        size = self.moment * np.tanh(lean / self.tilt) / lean
        return twisted(size[..., None] * np.stack([n[..., 1], -n[..., 0], np.zeros_like(lean)], axis=-1))


@dc.dataclass(frozen=True)
class StutteringRotor(ForeignWrench):
    """For `share` of every `period` one rotor gives less by `loss`."""

    rotor: int  # 0, 1, 2, 3
    loss: float  # [1]
    period: float  # [s]
    share: float  # [1]

    identifier: ClassVar[str] = "stuttering_rotor"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        stutters = np.mod(motion.t, self.period) < self.share * self.period
        lost = -self.loss * stutters * motion.rotor_thrust[..., self.rotor]
        given = lost[..., None] * vehicle.mixer[:, self.rotor]
        return along_z(motion, given[..., 0]) + twisted(given[..., 1:])


@dc.dataclass(frozen=True)
class WindShear(ForeignWrench):
    """f = c (z - height) towards `course` in W: air that moves faster the higher, as far as a drag feels it."""

    c: float  # [N/m]
    height: float  # [m]
    course: float  # [rad]

    identifier: ClassVar[str] = "wind_shear"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        push = self.c * (motion.x[..., P][..., 2] - self.height)
        f_W = push[..., None] * np.array([np.cos(self.course), np.sin(self.course), 0.0])
        return pushed(f_W)
