"""Faults between command and rotor thrust that the library does not have.

Source of each law: own choice, of what vehicles are known to meet.
"""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from diagrams.challenge.out_of_library.base import (
    Draw,
    LaggingActuator,
    OutOfLibraryActuator,
    OutOfLibraryWrench,
    any_rotor,
    chi_of_rotors,
    hover_thrust,
    level_offset,
    weight,
)
from np_drake.effects.air_speed import chi_from_body
from np_drake.effects.base import Motion
from np_drake.effects.parameter import arm, log_uniform, signed
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class RotorSaturation(OutOfLibraryWrench):
    """Saturation: no rotor gives more than `limit`."""

    limit: float  # [N]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        lost = -np.maximum(motion.rotor_thrust - self.limit, 0.0) @ vehicle.mixer.T
        return chi_of_rotors(motion, lost)


@dc.dataclass(frozen=True)
class StutteringRotor(OutOfLibraryWrench):
    """A rotor that stutters: for `share` of every `period` it gives less by `loss`."""

    rotor: int  # 0, 1, 2, 3
    loss: float  # [1]
    period: float  # [s]
    share: float  # [1]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        stutters = np.mod(motion.t, self.period) < self.share * self.period
        lost = -self.loss * stutters * motion.rotor_thrust[..., self.rotor]
        given = lost[..., None] * vehicle.mixer[:, self.rotor]
        return chi_of_rotors(motion, given)


@dc.dataclass(frozen=True)
class TwistingMount(OutOfLibraryWrench):
    """A rotor's mount gives way: thrust f tilts by twist f / h [rad] about its arm, h the thrust in
    hover.

    A force twist f² / h at the rotor, level and across the arm; what tilt takes from f is of second
    order.
    """

    rotor: int  # 0, 1, 2, 3
    twist: float  # in hover [rad]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        hover = hover_thrust(vehicle)
        place = np.array(vehicle.rotor_positions[self.rotor])
        across = np.array([-place[1], place[0], 0.0]) / np.hypot(place[0], place[1])
        f_B = (self.twist * motion.rotor_thrust[..., self.rotor] ** 2 / hover)[..., None] * across
        return chi_from_body(motion, f_B, np.cross(place, f_B))


@dc.dataclass(frozen=True)
class BentThrustCurve(OutOfLibraryActuator):
    """A bent thrust curve: f = c - bend (c - h)³ / h² with h the thrust of a hovering rotor."""

    bend: float  # [1]

    def _given(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        hover = hover_thrust(vehicle)
        return np.maximum(command - self.bend * (command - hover) ** 3 / hover**2, 0.0)


@dc.dataclass(frozen=True)
class CreepingBlades(LaggingActuator):
    """Soft blades give way slowly: f = c (1 - creep (s - 1)), time s' = c / h - s, h that in
    hover.
    """

    creep: float  # [1]
    time: float  # [s]
    state_size: ClassVar[int] = 4

    def _rest(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state at rest: (..., 4) load, filtered, over that in hover [1]."""
        return thrust / hover_thrust(vehicle)

    def _given(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        return command * (1.0 - self.creep * (state - 1.0))


@dc.dataclass(frozen=True)
class ShakingRotors(LaggingActuator):
    """Rotors that shake at one load, and give less while they do: f = c (1 - loss s).

    time s' = exp(-((c / h - load) / width)²) - s, h the thrust in hover.
    """

    loss: float  # while it shakes [1]
    load: float  # over that in hover [1]
    width: float  # [1]
    time: float  # in which it builds up [s]
    state_size: ClassVar[int] = 4

    def _rest(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state at rest: (..., 4) how much each shakes [1]."""
        over_hover = thrust / hover_thrust(vehicle)
        return np.exp(-(((over_hover - self.load) / self.width) ** 2))

    def _given(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        return command * (1.0 - self.loss * state)


@dc.dataclass(frozen=True)
class LosingSync(OutOfLibraryActuator):
    """A motor whose thrust is to rise too fast loses step with its controller: f = c (1 - loss d).

    time d' = g - d, time l' = c - l; g rises from 0 to 1 as (c - l) / h does from `jump` to twice
    that, h the thrust in hover.
    """

    rotor: int  # 0, 1, 2, 3
    loss: float  # out of step [1]
    jump: float  # of the thrust over that in hover [1]
    time: float  # [s]
    state_size: ClassVar[int] = 2

    def _rest(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state at rest: (..., 2) filtered thrust of the rotor [N], and how far it is
        out of step [1].
        """
        own = thrust[..., self.rotor]
        return np.stack([own, np.zeros_like(own)], axis=-1)

    def _rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the rate of the state (..., 2) [N/s, 1/s]."""
        ahead = command[..., self.rotor] - state[..., 0]
        out_of_step = np.clip(ahead / hover_thrust(vehicle) / self.jump - 1.0, 0.0, 1.0)
        return np.stack([ahead, out_of_step - state[..., 1]], axis=-1) / self.time

    def _given(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        lost = self.loss * state[..., 1:] * (np.arange(4) == self.rotor)
        return command * (1.0 - lost)


@dc.dataclass(frozen=True)
class ThrustRateTorque(LaggingActuator):
    """A torque with the change of collective thrust F: (arm_x, arm_y) (F - F filtered over
    `time`).
    """

    arm_x: float  # [m]
    arm_y: float
    time: float  # [s]
    state_size: ClassVar[int] = 1

    def _rest(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state at rest: (..., 1) filtered collective thrust [N]."""
        return np.sum(thrust, axis=-1, keepdims=True)

    def _given(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        change = np.sum(command, axis=-1, keepdims=True) - state
        return command + change * (vehicle.unmixer[:, 1:3] @ [self.arm_x, self.arm_y])


@dc.dataclass(frozen=True)
class YawBacklash(OutOfLibraryActuator):
    """Yaw torque with play: it follows its command only when pushed at the edge of a band."""

    play: float  # half width of the band [N·m]
    time: float = 0.015  # with which the edge pushes [s]
    state_size: ClassVar[int] = 1

    def _rest(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state at rest: (1,) yaw torque [N·m]."""
        return np.array([vehicle.mixer[3] @ thrust])

    def _rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the rate of the state (..., 1) [N·m/s]."""
        ahead = (command @ vehicle.mixer[3])[..., None] - state
        return np.sign(ahead) * np.maximum(np.abs(ahead) - self.play, 0.0) / self.time

    def _given(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        lost = state - (command @ vehicle.mixer[3])[..., None]
        return command + lost * vehicle.unmixer[:, 3]


@dc.dataclass(frozen=True)
class SoftArms(LaggingActuator):
    """Arms that bend carry a torque over to the other level axis, late: extra torque = gain (-s_y,
    s_x).

    time s' = tau - s with tau the commanded roll and pitch torque.
    """

    gain: float  # [1]
    time: float  # [s]
    state_size: ClassVar[int] = 2

    def _rest(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state at rest: (..., 2) filtered roll and pitch torque [N·m]."""
        return thrust @ vehicle.mixer[1:3].T

    def _given(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        carried = np.stack([-state[..., 1], state[..., 0]], axis=-1)
        return command + self.gain * carried @ vehicle.unmixer[:, 1:3].T


DRAWS: dict[str, Draw] = {
    "rotor_saturation": lambda rng, v: RotorSaturation(
        (1.0 + log_uniform(rng, 0.12, 0.6)) * weight(v) / 4
    ),
    "stuttering_rotor": lambda rng, v: StutteringRotor(
        loss=log_uniform(rng, 0.03, 0.2),
        rotor=any_rotor(rng),
        period=rng.uniform(1.5, 5.0),
        share=rng.uniform(0.15, 0.5),
    ),
    "twisting_mount": lambda rng, v: TwistingMount(any_rotor(rng), signed(rng, 0.01, 0.15)),
    "bent_thrust_curve": lambda rng, v: BentThrustCurve(log_uniform(rng, 0.02, 0.12)),
    "creeping_blades": lambda rng, v: CreepingBlades(
        log_uniform(rng, 0.08, 0.6), rng.uniform(0.5, 2.5)
    ),
    "shaking_rotors": lambda rng, v: ShakingRotors(
        log_uniform(rng, 0.03, 0.3),
        rng.uniform(1.08, 1.3),
        rng.uniform(0.05, 0.1),
        rng.uniform(0.1, 0.6),
    ),
    "losing_sync": lambda rng, v: LosingSync(
        loss=log_uniform(rng, 0.05, 0.4),
        jump=rng.uniform(0.015, 0.05),
        rotor=any_rotor(rng),
        time=rng.uniform(0.2, 0.6),
    ),
    "thrust_rate_torque": lambda rng, v: ThrustRateTorque(
        *level_offset(rng, log_uniform(rng, 0.03, 0.2) * arm(v)), rng.uniform(0.08, 0.3)
    ),
    "yaw_backlash": lambda rng, v: YawBacklash(log_uniform(rng, 0.3, 2.0) * v.J[2, 2]),
    "soft_arms": lambda rng, v: SoftArms(signed(rng, 0.06, 0.5), rng.uniform(0.03, 0.2)),
}
