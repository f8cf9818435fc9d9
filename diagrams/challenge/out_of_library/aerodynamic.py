"""Forces and torques that the library does not have. Source of each law: own choice, named after what it resembles."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.effects.air_speed import air_velocity_B, chi_from_body
from np_drake.effects.base import Motion, Parameter, WrenchEffect
from np_drake.rigid_body import P, V, W
from np_drake.vehicle import Vehicle


class ForeignWrench(WrenchEffect):
    """Without parameters that could be fitted."""

    parameters: ClassVar[tuple[Parameter, ...]] = ()


def pushed(f_W: np.ndarray) -> np.ndarray:
    """(..., 6) chi of a force at Bo (..., 3) in W [N]."""
    return np.concatenate([f_W, np.zeros_like(f_W)], axis=-1)


def along_z(motion: Motion, force: np.ndarray) -> np.ndarray:
    """(..., 6) chi of a force (...,) along body z [N]."""
    return chi_from_body(motion, force[..., None] * np.array([0.0, 0.0, 1.0]))


def twisted(tau_B: np.ndarray) -> np.ndarray:
    """(..., 6) chi of a torque (..., 3) in B [N·m]."""
    return np.concatenate([np.zeros_like(tau_B), tau_B], axis=-1)


@dc.dataclass(frozen=True)
class FanJet(ForeignWrench):
    """f = force exp(-|p - center|² / 2 size²) in W: a jet at one place of the room."""

    force: tuple[float, float, float]  # [N]
    center: tuple[float, float, float]  # [m]
    size: float  # [m]

    identifier: ClassVar[str] = "fan_jet"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        away = np.sum((motion.x[..., P] - self.center) ** 2, axis=-1)
        return pushed(np.exp(-0.5 * away / self.size**2)[..., None] * self.force)


@dc.dataclass(frozen=True)
class PeriodicForce(ForeignWrench):
    """f = force sin(2 pi frequency t + phase) in W."""

    force: tuple[float, float, float]  # [N]
    frequency: float  # [Hz]
    phase: float  # [rad]

    identifier: ClassVar[str] = "periodic_force"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        wave = np.sin(2 * np.pi * self.frequency * np.asarray(motion.t) + self.phase)
        return pushed(np.broadcast_to(wave[..., None] * self.force, (*motion.x.shape[:-1], 3)))


@dc.dataclass(frozen=True)
class RotationalDamping(ForeignWrench):
    """tau = -c |w| w, axis by axis."""

    c: float  # [N·m·s²/rad²]

    identifier: ClassVar[str] = "rotational_damping"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        w = motion.x[..., W]
        return twisted(-self.c * np.abs(w) * w)


@dc.dataclass(frozen=True)
class MagnusForce(ForeignWrench):
    """f_B = c w x v with v in body axes: a side force on a body that turns."""

    c: float  # [N·s²/(m·rad)]

    identifier: ClassVar[str] = "magnus_force"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        return chi_from_body(motion, self.c * np.cross(motion.x[..., W], air_velocity_B(motion)))


@dc.dataclass(frozen=True)
class GroundTether(ForeignWrench):
    """A rubber band from `anchor` to Bo: stiffness times what is beyond `slack`, and it only pulls."""

    stiffness: float  # [N/m]
    slack: float  # [m]
    anchor: tuple[float, float, float]  # [m]

    identifier: ClassVar[str] = "ground_tether"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        r = motion.x[..., P] - self.anchor
        span = np.maximum(np.linalg.norm(r, axis=-1, keepdims=True), 1e-6)
        return pushed(-self.stiffness * np.maximum(span - self.slack, 0.0) * r / span)


@dc.dataclass(frozen=True)
class StickingAxis(ForeignWrench):
    """For `share` of every `period` a torque -drag w brakes one body axis, and one `torque` twists it."""

    axis: int  # 0, 1, 2
    drag: float  # [N·m·s/rad]
    torque: float  # [N·m]
    period: float  # [s]
    share: float  # [1]

    identifier: ClassVar[str] = "sticking_axis"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        stuck = np.mod(motion.t, self.period) < self.share * self.period
        chi = np.zeros((*motion.x.shape[:-1], 6))
        chi[..., 3 + self.axis] = stuck * (self.torque - self.drag * motion.x[..., W][..., self.axis])
        return chi


@dc.dataclass(frozen=True)
class WallSuction(ForeignWrench):
    """f = strength * thrust * exp(-d / reach) towards a wall at distance d: normal · p = from_origin on the wall."""

    strength: float  # [1]
    reach: float  # [m]
    normal: tuple[float, float, float]  # towards the wall
    from_origin: float  # distance of the wall [m]

    identifier: ClassVar[str] = "wall_suction"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        d = np.maximum(self.from_origin - motion.x[..., P] @ np.array(self.normal), 0.0)
        pull = self.strength * motion.rotor_thrust.sum(axis=-1) * np.exp(-d / self.reach)
        return pushed(pull[..., None] * np.array(self.normal))


@dc.dataclass(frozen=True)
class SideLift(ForeignWrench):
    """f_B,y = c |v_x| v_z: a slanted plate that deflects the flow."""

    c: float  # [N·s²/m²]

    identifier: ClassVar[str] = "side_lift"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        v_B = air_velocity_B(motion)
        f_B = np.zeros_like(v_B)
        f_B[..., 1] = self.c * np.abs(v_B[..., 0]) * motion.x[..., V][..., 2]
        return chi_from_body(motion, f_B)
