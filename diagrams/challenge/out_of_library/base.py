"""What out-of-library effects are built from: base classes, wrenches of simple forces, and
draws.
"""

import re
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from np_drake.effects.air_speed import chi_from_body
from np_drake.effects.base import ActuatorEffect, Effect, Motion, Parameter, WrenchEffect
from np_drake.effects.parameter import direction
from np_drake.vehicle import Vehicle

Draw = Callable[[np.random.Generator, Vehicle], Effect]
UP = np.array([0.0, 0.0, 1.0])


class OutOfLibrary(Effect):
    """An effect without parameters that could be fitted; `identifier` follows from the name of its
    class.
    """

    parameters: ClassVar[tuple[Parameter, ...]] = ()

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        cls.identifier = re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower()


class OutOfLibraryWrench(OutOfLibrary, WrenchEffect):
    """An out-of-library effect that adds a wrench."""

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi (..., 6) [N, N·m]."""
        return self._chi(vehicle, motion)

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        raise NotImplementedError


class OutOfLibraryActuator(OutOfLibrary, ActuatorEffect):
    """An out-of-library effect that acts through the thrusts of the rotors."""

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return what the rotors give (..., 4) [N].

        Args:
            state: (..., state_size).
            command: (..., 4) [N].
        """
        return self._given(vehicle, state, command)

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state at rest (..., state_size).

        Args:
            thrust: (..., 4) constant command [N].
        """
        return self._rest(vehicle, np.asarray(thrust, float))

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the rate of the state (..., state_size) [state/s].

        Args:
            state: (..., state_size).
            command: (..., 4) [N].
        """
        return self._rate(vehicle, state, command)

    def _given(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    def _rest(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        return np.zeros(0)

    def _rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        return np.zeros((*np.shape(command)[:-1], 0))


class LaggingActuator(OutOfLibraryActuator):
    """An actuator effect whose state follows that at rest under the commands with a first-order
    lag.
    """

    time: float  # of the lag [s]

    def _rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        return (self.state_at(vehicle, command) - state) / self.time


def hover_thrust(vehicle: Vehicle) -> float:
    """Return the thrust of a rotor in hover [N]."""
    return vehicle.mass * vehicle.gravity / 4


def chi_of_force(f_W: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of a force at Bo (..., 3) in W [N]."""
    return np.concatenate([f_W, np.zeros_like(f_W)], axis=-1)


def chi_of_torque(tau_B: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of a torque (..., 3) in B [N·m]."""
    return np.concatenate([np.zeros_like(tau_B), tau_B], axis=-1)


def chi_along_z(motion: Motion, force: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of a force along body z.

    Args:
        force: (...,) [N].
    """
    return chi_from_body(motion, force[..., None] * UP)


def chi_of_rotors(motion: Motion, added: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of what rotors give besides.

    Args:
        added: (..., 4) collective thrust and torque in B [N, N·m].
    """
    return chi_along_z(motion, added[..., 0]) + chi_of_torque(added[..., 1:])


def weight(vehicle: Vehicle) -> float:
    """Return the weight [N]."""
    return vehicle.mass * vehicle.gravity


def any_rotor(rng: np.random.Generator) -> int:
    """Draw the number of a rotor, 0 to 3."""
    return int(rng.integers(4))


def any_course(rng: np.random.Generator) -> float:
    """Draw a heading [rad]."""
    return rng.uniform(-np.pi, np.pi)


def level_direction(rng: np.random.Generator) -> tuple[float, float, float]:
    """Draw a level unit vector."""
    course = any_course(rng)
    return float(np.cos(course)), float(np.sin(course)), 0.0


def level_offset(rng: np.random.Generator, size: float) -> tuple[float, float]:
    """Return a level vector (x, y) of a size and any direction."""
    x, y, _ = size * direction(rng, 0.0)
    return float(x), float(y)


def ground_place(rng: np.random.Generator) -> tuple[float, float, float]:
    """Draw a place on the ground, 1.5 m about the origin at most along either axis [m]."""
    return *rng.uniform(-1.5, 1.5, 2), 0.0
