"""What out-of-library effects are built from: base classes, and the wrenches of simple forces."""

from typing import ClassVar

import numpy as np

from np_drake.effects.air_speed import chi_from_body
from np_drake.effects.base import ActuatorEffect, Motion, Parameter, WrenchEffect
from np_drake.vehicle import Vehicle


class OutOfLibraryWrench(WrenchEffect):
    """A wrench without parameters that could be fitted."""

    parameters: ClassVar[tuple[Parameter, ...]] = ()


class OutOfLibraryActuator(ActuatorEffect):
    """An actuator effect without parameters that could be fitted; it acts through the thrusts of the rotors."""

    parameters: ClassVar[tuple[Parameter, ...]] = ()


class LaggingActuator(OutOfLibraryActuator):
    """An actuator effect whose state follows `state_at` of the commands with a first-order lag."""

    time: float  # of the lag [s]

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the rate of the state (..., state_size) [state/s]."""
        return (self.state_at(vehicle, command) - state) / self.time


def chi_of_force(f_W: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of a force at Bo (..., 3) in W [N]."""
    return np.concatenate([f_W, np.zeros_like(f_W)], axis=-1)


def chi_of_torque(tau_B: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of a torque (..., 3) in B [N·m]."""
    return np.concatenate([np.zeros_like(tau_B), tau_B], axis=-1)


def chi_along_z(motion: Motion, force: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of a force (...,) along body z [N]."""
    return chi_from_body(motion, force[..., None] * np.array([0.0, 0.0, 1.0]))


def chi_of_rotors(motion: Motion, added: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of collective thrust and torque (..., 4) that rotors add in B [N, N·m]."""
    return chi_along_z(motion, added[..., 0]) + chi_of_torque(added[..., 1:])
