"""What out-of-library effects in rotorpy are built from: hidden states, and the wrenches of simple forces."""

import numpy as np

from diagrams.challenge.simulators.rotorpy.library_effects import Instant, Values
from np_drake.vehicle import Vehicle


class StatefulEffect:
    """An effect with a state of its own, driven by what the rotors give, drive (4,) = [f, tau] in B [N, N·m]."""

    size = 1

    def __init__(self, vehicle: Vehicle, values: Values):
        self.vehicle, self.c = vehicle, values

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """Return the state (size,) at rest under a constant drive."""
        raise NotImplementedError

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what it adds to the drive (4,) [N, N·m], and the rate (size,) of its state."""
        raise NotImplementedError


def from_world(now: Instant, f_W: np.ndarray) -> np.ndarray:
    """Return the wrench (6,) of a force at Bo (3,) in W [N]."""
    return np.concatenate([f_W @ now.R, np.zeros(3)])


def of_rotors(vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
    """Return the wrench (6,) of additional thrusts (4,) [N]."""
    force, *torque = vehicle.mixer @ thrust
    return np.array([0.0, 0.0, force, *torque])
