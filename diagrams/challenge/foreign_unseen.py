"""Foreign effects of sets of their own, on which it was not set what is unknown: forces, torques and thrusts.

Source of each law: own choice, of what vehicles are known to meet.
"""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from diagrams.challenge.out_of_library.actuators import LaggingActuator
from diagrams.challenge.out_of_library.aerodynamic import ForeignWrench, along_z, pushed, twisted
from np_drake.effects.air_speed import air_velocity_B, chi_from_body
from np_drake.effects.base import Motion
from np_drake.rigid_body import P, W
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class LiftedCable(ForeignWrench):
    """f_z = -density g z in W: the weight of what a vehicle has lifted of a cable on the ground."""

    density: float  # of the cable [kg/m]

    identifier: ClassVar[str] = "lifted_cable"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        lifted = np.maximum(motion.x[..., P][..., 2], 0.0)
        return pushed(-self.density * vehicle.gravity * lifted[..., None] * np.array([0.0, 0.0, 1.0]))


@dc.dataclass(frozen=True)
class DoorwayDraft(ForeignWrench):
    """f = force (1 + tanh((normal · p - from_origin) / edge)) / 2 in W: air moves on one side."""

    force: tuple[float, float, float]  # well inside [N]
    normal: tuple[float, float, float]  # into the draft
    from_origin: float  # distance of the plane [m]
    edge: float  # [m]

    identifier: ClassVar[str] = "doorway_draft"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        inside = motion.x[..., P] @ np.array(self.normal) - self.from_origin
        share = 0.5 * (1.0 + np.tanh(inside / self.edge))
        return pushed(share[..., None] * self.force)


@dc.dataclass(frozen=True)
class PassingVehicle(ForeignWrench):
    """Downwash of a vehicle that passes above once in every `period`; s = time from the passage / duration.

    f_z = -force exp(-s²/2) in W, tau = force lever s exp(-s²/2) about the level `course` in W: it hits one
    side first, then the other.
    """

    force: float  # right below it [N]
    lever: float  # [m]
    course: float  # [rad]
    period: float  # [s]
    passage: float  # of the first one [s]
    duration: float  # [s]

    identifier: ClassVar[str] = "passing_vehicle"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        since = np.mod(np.asarray(motion.t) - self.passage + self.period / 2, self.period) - self.period / 2
        s = since / self.duration
        push = self.force * np.exp(-0.5 * s**2)
        axis_B = np.array([np.cos(self.course), np.sin(self.course), 0.0]) @ motion.R_WB
        f_W = -push[..., None] * np.array([0.0, 0.0, 1.0])
        return np.concatenate(np.broadcast_arrays(f_W, (self.lever * s * push)[..., None] * axis_B), axis=-1)


@dc.dataclass(frozen=True)
class WakeInterference(ForeignWrench):
    """Rotors behind others fly in their wake: each loses loss b g of its thrust, most at one air `speed`.

    g = u exp((1 - u²) / 2), u = level speed / speed; b = cosine of the angle between rotor and dead astern, 0
    for those ahead.
    """

    loss: float  # [1]
    speed: float  # [m/s]

    identifier: ClassVar[str] = "wake_interference"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        v = air_velocity_B(motion)[..., :2]
        u = np.linalg.norm(v, axis=-1, keepdims=True) / self.speed
        place = np.array(vehicle.rotor_positions)[:, :2]
        outwards = place / np.linalg.norm(place, axis=1, keepdims=True)
        astern = np.maximum(-v @ outwards.T, 0.0) / self.speed  # b u
        lost = self.loss * np.exp(0.5 * (1.0 - u**2)) * astern * motion.rotor_thrust
        given = -lost @ vehicle.mixer.T
        return along_z(motion, given[..., 0]) + twisted(given[..., 1:])


@dc.dataclass(frozen=True)
class SpinningLidar(ForeignWrench):
    """tau = -w x h with h along body z: a part that turns steadily, whatever the rotors do."""

    h: float  # angular momentum [N·m·s]

    identifier: ClassVar[str] = "spinning_lidar"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        return twisted(-np.cross(motion.x[..., W], [0.0, 0.0, self.h]))


@dc.dataclass(frozen=True)
class TwistingMount(ForeignWrench):
    """A rotor's mount gives way: thrust f tilts by twist f / h [rad] about its arm, h the thrust in hover.

    A force twist f² / h at the rotor, level and across the arm; what tilt takes from f is of second order.
    """

    rotor: int  # 0, 1, 2, 3
    twist: float  # in hover [rad]

    identifier: ClassVar[str] = "twisting_mount"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        hover = vehicle.mass * vehicle.gravity / 4
        place = np.array(vehicle.rotor_positions[self.rotor])
        across = np.array([-place[1], place[0], 0.0]) / np.hypot(place[0], place[1])
        f_B = (self.twist * motion.rotor_thrust[..., self.rotor] ** 2 / hover)[..., None] * across
        return chi_from_body(motion, f_B, np.cross(place, f_B))


@dc.dataclass(frozen=True)
class CreepingBlades(LaggingActuator):
    """Soft blades give way slowly: f = c (1 - creep (s - 1)), time s' = c / h - s, h that in hover."""

    creep: float  # [1]
    time: float  # [s]

    identifier: ClassVar[str] = "creeping_blades"
    state_size: ClassVar[int] = 4

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(..., 4) load, filtered, over that in hover [1]."""
        return 4 * np.asarray(thrust, float) / (vehicle.mass * vehicle.gravity)

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(..., 4) [N]."""
        return command * (1.0 - self.creep * (state - 1.0))


@dc.dataclass(frozen=True)
class DynamicInflow(LaggingActuator):
    """The air through a rotor follows late, so thrust overshoots: f = c + gain (c - s), time s' = c - s."""

    gain: float  # [1]
    time: float  # [s]

    identifier: ClassVar[str] = "dynamic_inflow"
    state_size: ClassVar[int] = 4

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(..., 4) filtered thrust [N]."""
        return np.array(thrust, float)

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(..., 4) [N]."""
        return np.maximum(command + self.gain * (command - state), 0.0)
