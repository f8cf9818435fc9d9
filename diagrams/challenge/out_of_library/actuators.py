"""Oddities between command and rotor thrust that the library does not have. Source of each law: own choice."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.effects.base import ActuatorEffect, Parameter
from np_drake.vehicle import Vehicle


class ForeignActuator(ActuatorEffect):
    """Without parameters that could be fitted. What it does to the wrench it does through the rotors' thrusts."""

    parameters: ClassVar[tuple[Parameter, ...]] = ()


class LaggingActuator(ForeignActuator):
    """One whose state follows what `state_at` has of the commands, with a lag of first order."""

    time: float  # of the lag [s]

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., state_size) [state/s]."""
        return (self.state_at(vehicle, command) - state) / self.time


@dc.dataclass(frozen=True)
class BentThrustCurve(ForeignActuator):
    """f = c - bend (c - h)³ / h² with h the thrust of a hovering rotor: right in hover, too little far above."""

    bend: float  # [1]

    identifier: ClassVar[str] = "bent_thrust_curve"

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(..., 4) [N]."""
        hover = vehicle.mass * vehicle.gravity / 4
        return np.maximum(command - self.bend * (command - hover) ** 3 / hover**2, 0.0)


@dc.dataclass(frozen=True)
class ThrustRateTorque(LaggingActuator):
    """A torque that grows with the change of collective thrust F: (arm_x, arm_y) (F - F filtered over `time`)."""

    arm_x: float  # [m]
    arm_y: float
    time: float  # [s]

    identifier: ClassVar[str] = "thrust_rate_torque"
    state_size: ClassVar[int] = 1

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(..., 1) filtered collective thrust [N]."""
        return np.sum(thrust, axis=-1, keepdims=True)

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(..., 4) [N]."""
        change = np.sum(command, axis=-1, keepdims=True) - state
        return command + change * (vehicle.unmixer[:, 1:3] @ [self.arm_x, self.arm_y])


@dc.dataclass(frozen=True)
class YawBacklash(ForeignActuator):
    """The yaw torque follows its command with play: it moves only when pushed at the edge of a band."""

    play: float  # half width of the band [N·m]
    time: float = 0.015  # with which the edge pushes [s]

    identifier: ClassVar[str] = "yaw_backlash"
    state_size: ClassVar[int] = 1

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(1,) yaw torque [N·m]."""
        return np.array([vehicle.mixer[3] @ thrust])

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., 1) [N·m/s]."""
        ahead = (command @ vehicle.mixer[3])[..., None] - state
        return np.sign(ahead) * np.maximum(np.abs(ahead) - self.play, 0.0) / self.time

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(..., 4) [N]."""
        lost = state - (command @ vehicle.mixer[3])[..., None]
        return command + lost * vehicle.unmixer[:, 3]


@dc.dataclass(frozen=True)
class LiquidSlosh(ForeignActuator):
    """Liquid in a tank as two oscillators (roll, pitch) that the commanded torques drive; it twists back.

    s'' = -2 damping w s' - w² s + w² tau, w = 2 pi frequency; extra torque = -gain s.
    """

    frequency: float  # [Hz]
    damping: float  # [1]
    gain: float  # [1]

    identifier: ClassVar[str] = "liquid_slosh"
    state_size: ClassVar[int] = 4

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(4,) displacement in torque [N·m] and its rate [N·m/s], at rest."""
        return np.concatenate([vehicle.mixer[1:3] @ thrust, np.zeros(2)])

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., 4)."""
        w, s, rate = 2 * np.pi * self.frequency, state[..., :2], state[..., 2:]
        drive = w**2 * (command @ vehicle.mixer[1:3].T - s) - 2 * self.damping * w * rate
        return np.concatenate([rate, drive], axis=-1)

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(..., 4) [N]."""
        return command - self.gain * (state[..., :2] @ vehicle.unmixer[:, 1:3].T)
