"""What an effect is: where it acts decides which pure functions it has.

An effect is a dataclass of its parameters (names and units of its own file). The simulator adds it through one of the
wrappers in `systems/`; a diagnosis fits the same object to logs. All functions are vectorised over leading axes.
"""

import dataclasses as dc
from typing import ClassVar, Protocol

import numpy as np

from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class Motion:
    """What a wrench effect may depend on: t (...,) [s], x (..., 13), rotor_thrust (..., 4) [N]."""

    t: np.ndarray | float
    x: np.ndarray
    rotor_thrust: np.ndarray


class WrenchEffect(Protocol):
    """Adds a wrench to the body."""

    identifier: ClassVar[str]

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) its part of chi = [f in W, tau in B] [N, N·m]."""
        ...


class ActuatorEffect(Protocol):
    """Stands between commanded and actual rotor thrust. A memoryless effect has state_size 0.

    turns_rotor: whether it changes how fast the rotor turns (a motor), or what a turning rotor gives (a propeller).
    """

    identifier: ClassVar[str]
    state_size: ClassVar[int]
    turns_rotor: ClassVar[bool]

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(state_size,) state at which a constant command `thrust` (4,) [N] rests."""
        ...

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., state_size) time derivative of the state under the commanded thrusts (..., 4) [N]."""
        ...

    def thrust(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., 4) actual rotor thrusts [N]."""
        ...


@dc.dataclass(frozen=True)
class Measurement:
    """What the rig reads: x (..., 13); a (..., 3) in W [m/s²]; al (..., 3) in B [rad/s²]; rotor (..., 4) [rad/s]."""

    x: np.ndarray
    a: np.ndarray
    al: np.ndarray
    rotor: np.ndarray


class MeasurementEffect(Protocol):
    """Corrupts what is read, not what happens. `white` are `white_size` standard normal draws per sample."""

    identifier: ClassVar[str]
    white_size: ClassVar[int]

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """The reading when the truth is `truth`; `white`: (..., white_size) standard normal [1]."""
        ...
