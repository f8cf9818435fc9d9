"""What an effect is: where it acts decides which pure functions it has.

An effect is a frozen dataclass of its parameters (names and units of its own file). The simulator adds it through
one of the wrappers in `systems/`; a diagnosis fits the same object to logs. All functions are vectorised over
leading axes. An effect acts at one of four places: wrench, actuator, mass, measurement.
"""

import dataclasses as dc
from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar, Protocol

import numpy as np

from np_drake import attitude
from np_drake.rigid_body import Q
from np_drake.vehicle import Vehicle

_STILL = np.zeros(3)
_STEADY = np.zeros(4)


@dc.dataclass(frozen=True)
class Parameter:
    """One figure of an effect: where it vanishes, where it may lie, and how large it usually is.

    neutral: value at which the effect vanishes, if `vanishes`.   lower, upper: bounds of a fit.
    typical: usual distance from neutral: the deviation of the prior, and the scale of finite differences.
    choices: the only values, where it is no continuous figure.
    """

    name: str
    unit: str
    neutral: float
    lower: float
    upper: float
    typical: float
    choices: tuple[float, ...] = ()
    vanishes: bool = True


class Effect:
    """What all effects share. A subclass is a frozen dataclass whose fields carry the parameters' names."""

    identifier: ClassVar[str]
    place: ClassVar[str]  # wrench | actuator | mass | measurement
    parameters: ClassVar[tuple[Parameter, ...]]
    linear: ClassVar[bool] = True  # in all parameters
    begins: ClassVar[bool] = True  # may begin in mid-flight
    needs: ClassVar[tuple[str, ...]] = ()  # it acts through one of these (wind through a drag)
    isotropic: ClassVar[bool] = False  # its figures are one vector that prefers no axis

    @property
    def values(self) -> dict[str, float]:
        """Parameters by name."""
        return {p.name: float(getattr(self, p.name)) for p in self.parameters}

    @property
    def foreseen(self) -> "Effect":
        """What its parameters tell of another flight: the effect itself, but for what is drawn anew each time."""
        return self

    @classmethod
    def neutral(cls) -> "Effect":
        """The effect at which nothing happens."""
        return cls.of({p.name: p.neutral for p in cls.parameters})

    @classmethod
    def of(cls, values: Mapping[str, float]) -> "Effect":
        """The effect with these parameters; the others at their defaults."""
        return cls(**values)


@dc.dataclass(frozen=True)
class Motion:
    """What a wrench effect may depend on.

    t (...,) [s], x (..., 13), rotor_thrust (..., 4) [N], wind (..., 3) velocity of the air in W [m/s],
    rotor_rate (..., 4) time derivative of rotor speed [rad/s²].
    """

    t: np.ndarray | float
    x: np.ndarray
    rotor_thrust: np.ndarray
    wind: np.ndarray = dc.field(default_factory=lambda: _STILL)
    rotor_rate: np.ndarray = dc.field(default_factory=lambda: _STEADY)

    @cached_property
    def R_WB(self) -> np.ndarray:
        """(..., 3, 3) attitude."""
        return attitude.rotation_matrix(self.x[..., Q])


class WrenchEffect(Effect):
    """Adds a wrench to the body, or moves the air (`air_velocity`), which the drags of the same model feel.

    pushes, turns: has it a force, a torque? The fit takes none from an effect that says no.   feels_rotor_rate: does it
    depend on the rotors' acceleration? The simulator gives none to one that says no. A class with a `wrench` of its
    own says so for itself.
    """

    place = "wrench"
    pushes: ClassVar[bool] = True
    turns: ClassVar[bool] = True
    feels_rotor_rate: ClassVar[bool] = True

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        for flag in ("pushes", "turns", "feels_rotor_rate") if "wrench" in vars(cls) else ():
            if flag not in vars(cls):
                setattr(cls, flag, True)

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """(..., 6) its part of chi = [f in W, tau in B] [N, N·m]; the force acts at Bo."""
        return np.zeros((*motion.x.shape[:-1], 6))

    def air_velocity(self, t: np.ndarray | float) -> np.ndarray:
        """(..., 3) its part of the velocity of the air in W [m/s]."""
        return np.zeros((*np.shape(t), 3))


class ActuatorEffect(Effect):
    """Stands between commanded and actual rotor thrust. A memoryless effect has state_size 0 and no delay.

    turns_rotor: whether it changes how fast the rotor turns (a motor), or what a turning rotor gives (a propeller).
    """

    place = "actuator"
    state_size: ClassVar[int] = 0
    turns_rotor: ClassVar[bool] = False

    @property
    def dead_time(self) -> float:
        """By which it holds commands back [s]."""
        return 0.0

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """(state_size,) state at which a constant command `thrust` (4,) [N] rests."""
        return np.zeros(0)

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(..., state_size) time derivative of the state under the commanded thrusts (..., 4) [N]."""
        return np.zeros((*np.shape(command)[:-1], 0))

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """(..., 4) actual rotor thrusts [N] at time t (...,) [s]."""
        raise NotImplementedError

    def respond(self, vehicle: Vehicle, t: np.ndarray, command: np.ndarray) -> np.ndarray:
        """(n, 4) mean thrusts [N] over equal intervals that begin at t (n,) [s] and hold `command` (n, 4) [N].

        For a sequence that begins at rest. A memoryless effect needs no own version.
        """
        return self.thrust(vehicle, np.zeros(0), command, t)


@dc.dataclass(frozen=True)
class MassProperties:
    """Of the rigid vehicle: mass [kg], p_BoBcm_B (3,) [m], J (3, 3) about the centre of mass in body axes [kg·m²]."""

    mass: float
    p_BoBcm_B: np.ndarray
    J: np.ndarray

    @staticmethod
    def of(vehicle: Vehicle) -> "MassProperties":
        """As the vehicle file has them: the centre of mass at Bo."""
        return MassProperties(vehicle.mass, np.zeros(3), vehicle.J)

    @property
    def rigid(self) -> bool:
        """Has any rigid body these? No principal moment exceeds the sum of the two others."""
        least, _, most = moments = np.linalg.eigvalsh(self.J)
        return bool(self.mass > 0 and least > 0 and 2 * most <= moments.sum() * (1 + 1e-9))


class MassEffect(Effect):
    """Changes the mass properties of the rigid vehicle."""

    place = "mass"

    def properties(self, nominal: MassProperties) -> MassProperties:
        """What `nominal` is with the effect."""
        raise NotImplementedError


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


class SensorEffect(Effect):
    """A systematic error of a sensor: a MeasurementEffect without draws, so that it can be fitted.

    corrupts: the columns of a flight log that it touches.   clock_shift: by which state rows run ahead of the
    commands [s].
    """

    place = "measurement"
    begins = False
    white_size: ClassVar[int] = 0
    corrupts: ClassVar[tuple[str, ...]] = ()

    @property
    def clock_shift(self) -> float:
        """By how much later than their row's time the state columns were taken [s]."""
        return 0.0

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """The reading when the truth is `truth`; nothing is drawn."""
        return truth
