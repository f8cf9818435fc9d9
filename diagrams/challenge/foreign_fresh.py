"""Further foreign effects of the sets on which it was not set what is unknown.

Source of each law: own choice, of what vehicles are known to meet.
"""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from diagrams.challenge.out_of_library.actuators import LaggingActuator
from diagrams.challenge.out_of_library.aerodynamic import ForeignWrench, pushed, twisted
from np_drake.effects.air_speed import air_velocity_B, chi_from_body
from np_drake.effects.base import Motion
from np_drake.rigid_body import P, V
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class StandingEddy(ForeignWrench):
    """f = force (z x r) / core exp((1 - |r|² / core²) / 2) in W, r level from the `center`: air circles in the room.

    Strongest at the distance `core` from the upright axis.
    """

    force: float  # at `core`; counter-clockwise from above [N]
    center: tuple[float, float]  # [m]
    core: float  # [m]

    identifier: ClassVar[str] = "standing_eddy"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        r = (motion.x[..., P][..., :2] - self.center) / self.core
        size = self.force * np.exp(0.5 * (1.0 - np.sum(r**2, axis=-1)))
        return pushed(size[..., None] * np.stack([-r[..., 1], r[..., 0], np.zeros_like(size)], axis=-1))


@dc.dataclass(frozen=True)
class RubbingLine(ForeignWrench):
    """f = -force tanh(|v| / creep) v / |v| in W: a safety line that rubs where it is led round."""

    force: float  # of dry friction [N]
    creep: float  # speed at which it begins to slip [m/s]

    identifier: ClassVar[str] = "rubbing_line"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        v = motion.x[..., V]
        speed = np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)
        return pushed(-self.force * np.tanh(speed / self.creep) * v / speed)


@dc.dataclass(frozen=True)
class TiltedCushion(ForeignWrench):
    """tau = lever F exp(-z / reach) (z_B x n), F of all rotors, n the world's z in B: the air below rights it.

    The low side has more of a cushion under it than the high one; nothing of it shows in the force.
    """

    lever: float  # over a lean of one, on the ground [m]
    reach: float  # [m]

    identifier: ClassVar[str] = "tilted_cushion"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        near = np.exp(-np.maximum(motion.x[..., P][..., 2], 0.0) / self.reach)
        size = self.lever * motion.rotor_thrust.sum(axis=-1) * near
        return twisted(size[..., None] * np.cross([0.0, 0.0, 1.0], motion.R_WB[..., 2, :]))


@dc.dataclass(frozen=True)
class PanelFlutter(ForeignWrench):
    """A loose panel at (x, y) flutters in air faster than `onset`: f_z = force a sin(2 pi frequency t + phase) in B.

    a = max(1 - onset² / |v|², 0); tau = place x f.
    """

    force: float  # in very fast air [N]
    x: float  # place [m]
    y: float
    onset: float  # [m/s]
    frequency: float  # [Hz]
    phase: float  # [rad]

    identifier: ClassVar[str] = "panel_flutter"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        speed = np.linalg.norm(air_velocity_B(motion), axis=-1)
        share = 1.0 - (self.onset / np.maximum(speed, self.onset)) ** 2
        wave = np.sin(2 * np.pi * self.frequency * np.asarray(motion.t) + self.phase)
        f_B = (self.force * share * wave)[..., None] * np.array([0.0, 0.0, 1.0])
        return chi_from_body(motion, f_B, np.cross([self.x, self.y, 0.0], f_B))


@dc.dataclass(frozen=True)
class ShakingRotors(LaggingActuator):
    """A rotor shakes at one load, and what shakes gives less: f = c (1 - loss s).

    time s' = exp(-((c / h - load) / width)²) - s, h the thrust in hover.
    """

    loss: float  # while it shakes [1]
    load: float  # over that in hover [1]
    width: float  # [1]
    time: float  # in which it builds up [s]

    identifier: ClassVar[str] = "shaking_rotors"
    state_size: ClassVar[int] = 4

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(..., 4) how much each shakes [1]."""
        over_hover = 4 * np.asarray(thrust, float) / (vehicle.mass * vehicle.gravity)
        return np.exp(-(((over_hover - self.load) / self.width) ** 2))

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(..., 4) [N]."""
        return command * (1.0 - self.loss * state)


@dc.dataclass(frozen=True)
class SoftArms(LaggingActuator):
    """Arms that bend carry a torque over to the other level axis, late: extra torque = gain (-s_y, s_x).

    time s' = tau - s with tau the commanded roll and pitch torque.
    """

    gain: float  # [1]
    time: float  # [s]

    identifier: ClassVar[str] = "soft_arms"
    state_size: ClassVar[int] = 2

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(..., 2) filtered roll and pitch torque [N·m]."""
        return np.asarray(thrust, float) @ vehicle.mixer[1:3].T

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(..., 4) [N]."""
        carried = np.stack([-state[..., 1], state[..., 0]], axis=-1)
        return command + self.gain * carried @ vehicle.unmixer[:, 1:3].T
