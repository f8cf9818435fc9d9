"""The newest foreign effects of the sets on which it was not set what is unknown.

Source of each law: own choice, of what vehicles are known to meet.
"""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from diagrams.challenge.out_of_library.actuators import ForeignActuator
from diagrams.challenge.out_of_library.aerodynamic import ForeignWrench, along_z, pushed, twisted
from np_drake.effects.air_speed import air_velocity_B, chi_from_body
from np_drake.effects.base import Motion
from np_drake.rigid_body import P, V
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class WinchTether(ForeignWrench):
    """A winch keeps a tether taut: f = -tension (1 + friction tanh(v · n / creep)) n in W.

    n is the direction from `anchor` to Bo. The drum rubs, so it pulls harder while the tether runs out than
    while it is wound in.
    """

    tension: float  # at constant length [N]
    friction: float  # of the drum, over the tension [1]
    creep: float  # speed at which the drum begins to slip [m/s]
    anchor: tuple[float, float, float]  # [m]

    identifier: ClassVar[str] = "winch_tether"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        r = motion.x[..., P] - self.anchor
        n = r / np.maximum(np.linalg.norm(r, axis=-1, keepdims=True), 1e-6)
        runs_out = np.sum(motion.x[..., V] * n, axis=-1, keepdims=True)
        return pushed(-self.tension * (1.0 + self.friction * np.tanh(runs_out / self.creep)) * n)


@dc.dataclass(frozen=True)
class PlatformEdge(ForeignWrench):
    """Ground effect of a platform that ends: each rotor over it gives more, those beyond its edge do not.

    Extra thrust of a rotor at p in W: strength f exp(-(z - height) / reach) (1 + tanh(inside / edge)) / 2,
    inside = normal · p - from_origin, f its thrust.
    """

    strength: float  # on the platform [1]
    reach: float  # [m]
    height: float  # of the platform [m]
    normal: tuple[float, float, float]  # level, inwards from the edge
    from_origin: float  # distance of the edge [m]
    edge: float  # half width over which it fades [m]

    identifier: ClassVar[str] = "platform_edge"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        rotors = motion.x[..., None, P] + np.array(vehicle.rotor_positions) @ np.swapaxes(motion.R_WB, -1, -2)
        above = np.maximum(rotors[..., 2] - self.height, 0.0)
        over = 0.5 * (1.0 + np.tanh((rotors @ np.array(self.normal) - self.from_origin) / self.edge))
        gained = self.strength * motion.rotor_thrust * np.exp(-above / self.reach) * over
        given = gained @ vehicle.mixer.T
        return along_z(motion, given[..., 0]) + twisted(given[..., 1:])


@dc.dataclass(frozen=True)
class OddPropeller(ForeignWrench):
    """One propeller of another make: its side force is not balanced by those that turn the other way.

    f = c sqrt(f_i / h) (z x v) in B at the rotor, v of Bo through the air, h the thrust in hover;
    tau = place x f.
    """

    rotor: int  # 0, 1, 2, 3
    c: float  # in hover [N·s/m]

    identifier: ClassVar[str] = "odd_propeller"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        over_hover = 4 * motion.rotor_thrust[..., self.rotor] / (vehicle.mass * vehicle.gravity)
        turning = np.sqrt(np.maximum(over_hover, 0.0))  # speed of the rotor over that in hover
        f_B = self.c * turning[..., None] * np.cross([0.0, 0.0, 1.0], air_velocity_B(motion))
        return chi_from_body(motion, f_B, np.cross(vehicle.rotor_positions[self.rotor], f_B))


@dc.dataclass(frozen=True)
class BentVane(ForeignWrench):
    """A bent plate in the rotors' wake twists: tau_z = lever F / (1 + (u / speed)²), F of all rotors.

    u is the lateral air speed: flow from the side blows the wake off the plate.
    """

    lever: float  # in hover [m]
    speed: float  # at which half of it is left [m/s]

    identifier: ClassVar[str] = "bent_vane"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) [N, N·m]."""
        lateral = np.sum(air_velocity_B(motion)[..., :2] ** 2, axis=-1)
        turn = self.lever * motion.rotor_thrust.sum(axis=-1) / (1.0 + lateral / self.speed**2)
        return twisted(turn[..., None] * np.array([0.0, 0.0, 1.0]))


@dc.dataclass(frozen=True)
class SprungLoad(ForeignActuator):
    """A load on springs bounces along body z: extra collective thrust = share (F - s - 2 damping s' / w).

    s'' = w² (F - s) - 2 damping w s', w = 2 pi frequency; -s / (m w²) is the load's way from the frame [m],
    and its acceleration from it is what the frame feels.
    """

    frequency: float  # [Hz]
    damping: float  # [1]
    share: float  # of the mass [1]

    identifier: ClassVar[str] = "sprung_load"
    state_size: ClassVar[int] = 2

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(..., 2) displacement in collective thrust [N] and its rate [N/s], at rest."""
        total = np.sum(thrust, axis=-1)
        return np.stack([total, np.zeros_like(total)], axis=-1)

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., 2) [N/s, N/s²]."""
        w = 2 * np.pi * self.frequency
        return np.stack([state[..., 1], w**2 * self._unmoved(state, command)], axis=-1)

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(..., 4) [N]."""
        return command + self.share * self._unmoved(state, command)[..., None] * vehicle.unmixer[:, 0]

    def _unmoved(self, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(...,) F - s - 2 damping s' / w [N]."""
        w = 2 * np.pi * self.frequency
        return np.sum(command, axis=-1) - state[..., 0] - 2 * self.damping * state[..., 1] / w


@dc.dataclass(frozen=True)
class LosingSync(ForeignActuator):
    """A motor whose thrust is to rise too fast loses step with its controller: f = c (1 - loss d).

    time d' = g - d, time l' = c - l; g rises from 0 to 1 as (c - l) / h does from `jump` to twice that, h the
    thrust in hover.
    """

    rotor: int  # 0, 1, 2, 3
    loss: float  # out of step [1]
    jump: float  # of the thrust over that in hover [1]
    time: float  # [s]

    identifier: ClassVar[str] = "losing_sync"
    state_size: ClassVar[int] = 2

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(..., 2) filtered thrust of the rotor [N], and how far it is out of step [1]."""
        own = np.asarray(thrust, float)[..., self.rotor]
        return np.stack([own, np.zeros_like(own)], axis=-1)

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., 2) [N/s, 1/s]."""
        ahead = command[..., self.rotor] - state[..., 0]
        over_hover = 4 * ahead / (vehicle.mass * vehicle.gravity)
        out_of_step = np.clip(over_hover / self.jump - 1.0, 0.0, 1.0)
        return np.stack([ahead, out_of_step - state[..., 1]], axis=-1) / self.time

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(..., 4) [N]."""
        lost = self.loss * state[..., 1:] * (np.arange(4) == self.rotor)
        return command * (1.0 - lost)
