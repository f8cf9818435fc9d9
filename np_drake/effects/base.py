"""Interfaces of effects, by the place where an effect acts.

An effect is a frozen dataclass of its parameters (names and units of its own file). The simulator
adds it through one of the wrappers in `systems/`; a diagnosis fits the same object to logs. All
functions are vectorised over leading axes. An effect acts at one of four places: wrench, actuator,
mass, measurement.
"""

import dataclasses as dc
import math
import re
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar, Protocol

import numpy as np

from np_drake import attitude
from np_drake.checks import require
from np_drake.files.number_text import departure_unit, measure
from np_drake.flight_log import Neighbour
from np_drake.rigid_body import Q, V
from np_drake.vehicle import Vehicle

PAPER = Vehicle()  # of whose size the library's typical values are


@dc.dataclass(frozen=True)
class Parameter:
    """Range and scale of one parameter of an effect.

    neutral: value at which the effect vanishes, if `vanishes`.   lower, upper: bounds of a fit.
    typical: usual distance from neutral: the deviation of the prior, and the scale of finite
        differences.
    choices: the only values, where it is not continuous.
    departure: how a vehicle or sensor differs that has another value than neutral, as "{rotor}:
        thrust {signed}";
        where the sign decides the words, "{size} ahead|{size} behind", of more and of less.
    """

    name: str
    unit: str
    neutral: float
    lower: float
    upper: float
    typical: float
    choices: tuple[float, ...] = ()
    vanishes: bool = True
    departure: str = ""


def departure(p: Parameter, value: float, rotor: object, *, shares: bool) -> tuple[str, str]:
    """Return the unit of a parameter, and in words how far it departs from neutral by `value`.

    rotor: name of that of its effect, if any; shares: whether its factors are shares.
    """
    unit = "share" if p.unit == "1" and shares else p.unit
    more, _, less = p.departure.partition("|")
    factor, shown = departure_unit(unit)
    size = measure(factor * abs(value), shown)
    words = less if less and value < 0 else more
    sign = "−" if value < 0 else "+"
    return unit, words.format(size=size, signed=f"{sign}{size}", rotor=rotor)


def usual_size(parameter: Parameter, vehicle: Vehicle) -> float:
    """Return the usual size of a parameter; the library's is for the paper's vehicle."""
    mass = vehicle.mass / PAPER.mass
    span = arm(vehicle) / arm(PAPER)
    scale = {
        "kg": mass,
        "N": mass,
        "N·s/m": mass,
        "N·s²/m²": mass,
        "N·m·s/m": mass * span,
        "kg·m²": mass * span**2,
    }
    longer = {"m": span} if parameter.name != "length" else {}
    return parameter.typical * (scale | longer).get(parameter.unit, 1.0)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number, every decade as likely."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def signed(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a log-uniform number of either sign."""
    return float(rng.choice([-1.0, 1.0])) * log_uniform(rng, low, high)


def arm(vehicle: Vehicle) -> float:
    """Return the mean distance of a rotor from Bo in the plane of the rotors [m]."""
    return float(np.mean(np.linalg.norm(vehicle.rotor_positions_B[:, :2], axis=1)))


def direction(rng: np.random.Generator, rise: float | None = None) -> np.ndarray:
    """Draw a unit vector (3,).

    Args:
        rise: deviation of its slope, where it is about level [1]; None: in all directions.
    """
    n = rng.normal(size=3)
    if rise is not None:
        n[2] = rise * n[2] * np.hypot(n[0], n[1])
    return n / np.linalg.norm(n)


def drag_coefficients(
    rng: np.random.Generator, vehicle: Vehicle, low: float, high: float
) -> np.ndarray:
    """Draw drag coefficients (3,) in body axes: a heavy vehicle has more drag, and the level axes
    about the same.
    """
    lateral = log_uniform(rng, low, high) * vehicle.mass
    return lateral * rng.uniform([0.8, 0.8, 0.3], [1.2, 1.2, 1.2])


_STILL = np.zeros(3)  # no wind, for motions without any [m/s]
_STEADY = np.zeros(4)  # constant rotor speed [rad/s²]


class Effect:
    """Base class of all effects: all that simulator, diagnosis and report know of one.

    A subclass is a frozen dataclass whose fields carry the parameters' names. It states
    `parameters` and its function; everything else has a default.
    """

    identifier: ClassVar[str]  # default: the name of its class, in words joined by _
    place: ClassVar[str]  # wrench | actuator | mass | measurement
    parameters: ClassVar[tuple[Parameter, ...]]
    # cause: the diagnosis searches it.   mixer: only on logs of measured rotor speed, where a
    # command's mixer is known. neighbour: only on logs beside which that of a vehicle nearby is
    # given. change: only since flights before. simulated: in scenarios alone.   nuisance: an error
    # of file or input that every model holds, never a cause.
    role: ClassVar[str] = "cause"

    # Its mathematics.
    linear: ClassVar[bool] = True  # in all parameters
    begins: ClassVar[bool] = True  # may begin in mid-flight
    # of how airframe and propellers are made: the same in all flights of a vehicle
    constant: ClassVar[bool] = False
    # what happens to a healthy vehicle in flight: a load, a broken rotor, a wind
    sudden: ClassVar[bool] = False
    needs: ClassVar[tuple[str, ...]] = ()  # it acts through one of these (wind through a drag)
    # Prior correlation of its continuous parameters; (): none [1].
    prior_correlation: ClassVar[tuple[tuple[float, ...], ...]] = ()
    # its prior widens to the size of its estimate: usual sizes are not known
    widens: ClassVar[bool] = False
    # a motion of its own, which no log holds (a payload's swing)
    has_hidden_state: ClassVar[bool] = False
    # in time against the state: a lag, a delay, another clock
    shifts_commands: ClassVar[bool] = False
    pure_delay: ClassVar[bool] = False  # it does nothing but that
    requires: ClassVar[tuple[str, ...]] = ()  # what a log must tell: keys of `library.REQUIREMENTS`
    tolerance: ClassVar[str] = ""  # field of `Tolerance`: how far vehicle file or sensor may be off

    # Its size in a simulated case, log-uniform; see `draw`.
    drawn: ClassVar[tuple[float, float] | None] = None
    rise: ClassVar[float | None] = None  # slope of its direction, if it is about level [1]
    either_sign: ClassVar[bool] = False  # of its only parameter's distance from neutral

    # Its words in a report.
    named: ClassVar[str] = ""  # within a sentence, with its article; "": the identifier's words
    phrase: ClassVar[str] = ""  # with its size, as in "a {mass} payload on {length}"; "": composed
    shares: ClassVar[bool] = False  # its dimensionless parameters are shown in per cent
    bench_check: ClassVar[str] = ""  # how to see it without a flight
    excited_by: ClassVar[str] = ""  # manoeuvre that shows it
    # identifier of another effect: manoeuvre that tells the two
    told_from: ClassVar[Mapping[str, str]] = {}

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        if "identifier" not in vars(cls):
            cls.identifier = re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower()

    def __post_init__(self) -> None:
        """Raises: ValueError: if a parameter is not a finite number."""
        for p in self.parameters:
            value = getattr(self, p.name)
            require(
                isinstance(value, float | int | np.number) and math.isfinite(value),
                f"{type(self).__name__}: {p.name} must be a finite number [{p.unit}]; "
                f"got {value!r}.",
            )

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters by name."""
        return {p.name: float(getattr(self, p.name)) for p in self.parameters}

    @property
    def acts(self) -> bool:
        """Whether any parameter is not neutral."""
        return any(self.values[p.name] != p.neutral for p in self.parameters if not p.choices)

    @property
    def predicted(self) -> "Effect":
        """Effect that is predicted for another flight: the effect itself without what is drawn anew
        each time.
        """
        return self

    def time_shift(self, vehicle: Vehicle) -> float:
        """Return the time by which commands act later on the state, beyond what the vehicle file
        says [s].
        """
        return 0.0

    def possible(self, vehicle: Vehicle, height: float) -> bool:
        """Return whether a vehicle can have these parameters.

        Args:
            vehicle: the nominal vehicle.
            height: largest above the ground that it flies at; infinite: not known [m].
        """
        return True

    def lacking(self) -> str:
        """Return what the effect lacks to act in a simulation, with the remedy; empty: nothing."""
        return ""

    @classmethod
    def title(cls) -> str:
        """Return its name within a sentence, with its article."""
        return cls.named or cls.identifier.replace("_", " ")

    @classmethod
    def grid(cls, vehicle: Vehicle) -> list[dict[str, float]]:
        """Return the values of its parameters at which a search linearises it; [] where it is
        linear enough.
        """
        if cls.linear or cls.needs or cls.place in ("mass", "measurement"):
            return []
        free = [p for p in cls.parameters if not p.choices]
        return [{p.name: p.neutral + sign * p.typical for p in free} for sign in (0.5, 1.0, -0.5)]

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case, log-uniform from invisible to strong.

        A `drawn` size is that of the only parameter, or of three along a random direction; without,
        each has its own.

        Args:
            rng: source of the draw.
            vehicle: on which the effect acts.
            seconds: duration of the flights [s].
        Source: own choice: the weak end drowns in sensor noise, the strong end is what a controller
            still flies.
        """
        if cls.drawn is not None:
            size = (signed if cls.either_sign else log_uniform)(rng, *cls.drawn)
            along = direction(rng, cls.rise) if len(cls.parameters) == 3 else np.ones(1)
            return {
                p.name: float(p.neutral + size * n)
                for p, n in zip(cls.parameters, along, strict=True)
            }
        drawn = {}
        for p in cls.parameters:
            away = usual_size(p, vehicle) * log_uniform(rng, 0.1, 3.0)
            sign = (
                1.0
                if p.lower == p.neutral
                else -1.0
                if p.upper == p.neutral
                else rng.choice([-1.0, 1.0])
            )
            value = (
                rng.choice(p.choices)
                if p.choices
                else np.clip(p.neutral + sign * away, p.lower, p.upper)
            )
            drawn[p.name] = float(value)
        return drawn

    @classmethod
    def neutral(cls) -> "Effect":
        """Return the effect with neutral parameters, at which nothing happens."""
        return cls.of({p.name: p.neutral for p in cls.parameters})

    @classmethod
    def of(cls, values: Mapping[str, float]) -> "Effect":
        """Return the effect with these values of parameters by name, the others at their
        defaults.
        """
        return cls(**values)


@dc.dataclass(frozen=True)
class Motion:
    """State, rotor thrust and air on which a wrench effect may depend.

    t: (...,) [s].
    x: (..., 13).
    rotor_thrust: (..., 4) [N].
    wind: (..., 3) velocity of the air in W [m/s]. rotor_rate: (..., 4) time derivative of rotor
        speed [rad/s²].
    nominal_thrust: (..., 4) what nominal rotors would give at the speed; None: as rotor_thrust [N].
    """

    t: np.ndarray | float
    x: np.ndarray
    rotor_thrust: np.ndarray
    wind: np.ndarray = dc.field(default_factory=lambda: _STILL)
    rotor_rate: np.ndarray = dc.field(default_factory=lambda: _STEADY)
    nominal_thrust: np.ndarray | None = None

    @cached_property
    def R_WB(self) -> np.ndarray:
        """Rotation matrix of the attitude, (..., 3, 3)."""
        return attitude.rotation_matrix(self.x[..., Q])

    @cached_property
    def air_B(self) -> np.ndarray:
        """Velocity of Bo relative to the air, in B, (..., 3) [m/s]."""
        return ((self.x[..., V] - self.wind)[..., None, :] @ self.R_WB)[..., 0, :]


class WrenchEffect(Effect):
    """Effect that adds a wrench to the body, or moves the air (`air_velocity`) that the drags of
    the model feel.

    pushes, turns: whether it has a force, a torque; the fit sets those to zero for an effect that
    declares none. They are true of a class with its own wrench unless it says otherwise, and false
    of a wind, which has none.
    """

    place = "wrench"
    widens: ClassVar[bool] = True
    pushes: ClassVar[bool] = False
    turns: ClassVar[bool] = False

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        for flag in ("pushes", "turns") if {"wrench", "body_wrench"} & vars(cls).keys() else ():
            if flag not in vars(cls):
                setattr(cls, flag, True)

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return the effect's part of chi = [f in W, tau in B] (..., 6) [N, N·m]; the force acts at
        Bo.

        Args:
            vehicle: nominal vehicle.
            motion: on which the wrench depends, over any leading axes.
        """
        body = self.body_wrench(vehicle, motion)
        return chi_from_body(motion, body[..., :3], body[..., 3:])

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return force at Bo and torque in B, (..., 6) [N, N·m]; zeros, where a law in W is that of
        `wrench`.
        """
        return np.zeros((*motion.x.shape[:-1], 6))

    def near(self, neighbours: Sequence[Neighbour]) -> "WrenchEffect":
        """Return the effect in a flight with these vehicles nearby; most effects are the same."""
        return self

    def air_velocity(self, t: np.ndarray | float) -> np.ndarray:
        """Return the effect's part of the velocity of the air in W, (..., 3) [m/s]."""
        return np.zeros((*np.shape(t), 3))


class ActuatorEffect(Effect):
    """Effect between commanded and actual rotor thrust; without memory it has state_size 0 and no
    delay.

    turns_rotor: whether it changes how fast the rotor turns (a motor), or what a turning rotor
    gives (a propeller).
    """

    place = "actuator"
    state_size: ClassVar[int] = 0
    turns_rotor: ClassVar[bool] = False

    @property
    def dead_time(self) -> float:
        """Time by which commands are held back [s]."""
        return 0.0

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state (state_size,) at which a constant command rests.

        Args:
            vehicle: nominal vehicle.
            thrust: (4,) commanded [N].
        """
        return np.zeros(0)

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the time derivative of the state, (..., state_size).

        Args:
            vehicle: nominal vehicle.
            state: (..., state_size).
            command: (..., 4) commanded rotor thrusts [N].
        """
        return np.zeros((*np.shape(command)[:-1], 0))

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return the actual rotor thrusts (..., 4) [N].

        Args:
            vehicle: nominal vehicle.
            state: (..., state_size).
            command: (..., 4) commanded rotor thrusts [N].
            t: (...,) time since the flight began [s].
        """
        return self.thrust_gain(t) * command

    def thrust_gain(self, t: np.ndarray | float) -> np.ndarray | float:
        """Return actual over commanded thrust at t (...,) [s], (4,), (..., 1) or of all rotors [1].

        Only an effect with its own `thrust` has none.
        """
        raise NotImplementedError

    def respond(self, vehicle: Vehicle, t: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the mean thrusts (n, 4) [N] over equal intervals that begin at t (n,) [s].

        For a sequence that begins at rest. A memoryless effect needs no own version.

        Args:
            vehicle: nominal vehicle.
            t: (n,) starts of the intervals [s].
            command: (n, 4) held over each interval [N].
        """
        return self.thrust(vehicle, np.zeros(0), command, t)


@dc.dataclass(frozen=True)
class MassProperties:
    """Mass properties of the rigid vehicle.

    mass: [kg].
    p_BoBcm_B: (3,) centre of mass [m].
    J: (3, 3) about the centre of mass in body axes [kg·m²].
    rotor_positions_B: (4, 3) places of the rotors [m].
    """

    mass: float
    p_BoBcm_B: np.ndarray
    J: np.ndarray
    rotor_positions_B: np.ndarray = dc.field(default_factory=lambda: np.zeros((4, 3)))

    @staticmethod
    def of(vehicle: Vehicle) -> "MassProperties":
        """Return the mass properties in the vehicle file, with the centre of mass at Bo."""
        return MassProperties(vehicle.mass, np.zeros(3), vehicle.J, vehicle.rotor_positions_B)

    @property
    def rigid(self) -> bool:
        """Whether a rigid body can have them: no principal moment exceeds the sum of the two
        others.
        """
        least, _, most = moments = np.linalg.eigvalsh(self.J)
        return bool(self.mass > 0 and least > 0 and 2 * most <= moments.sum() * (1 + 1e-9))


class MassEffect(Effect):
    """Effect that changes the mass properties of the rigid vehicle."""

    place = "mass"

    def properties(self, nominal: MassProperties) -> MassProperties:
        """Return `nominal` changed by the effect."""
        raise NotImplementedError

    def possible(self, vehicle: Vehicle, height: float) -> bool:
        """Return whether it is a rigid body with these parameters.

        Args:
            vehicle: the nominal vehicle.
            height: not used.
        """
        return self.properties(MassProperties.of(vehicle)).rigid


@dc.dataclass(frozen=True)
class Measurement:
    """Reading of the sensors.

    x: (..., 13) state.
    a: (..., 3) in W [m/s²].
    al: (..., 3) in B [rad/s²].
    rotor: (..., 4) rotor speed [rad/s].
    """

    x: np.ndarray
    a: np.ndarray
    al: np.ndarray
    rotor: np.ndarray


class MeasurementEffect(Protocol):
    """Effect that corrupts the reading and not the motion.

    white_size: number of standard normal draws that it takes for a sample.
    """

    identifier: str
    white_size: int

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the reading of the sensors.

        Args:
            vehicle: nominal vehicle.
            truth: what is to be read.
            white: (..., white_size) standard normal [1].
        """


class SensorEffect(Effect):
    """Systematic error of a sensor: a MeasurementEffect without random draws, so that it can be
    fitted.

    corrupts: columns of a flight log that it changes.
    clock_shift: by which state rows run ahead of the commands [s].
    """

    place = "measurement"
    begins = False
    small: ClassVar[bool] = False  # it adds up, and other effects act at the motion as it was read
    white_size: ClassVar[int] = 0
    corrupts: ClassVar[tuple[str, ...]] = ()

    @property
    def clock_shift(self) -> float:
        """Time by which the state columns were taken later than their row's time [s]."""
        return 0.0

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the reading of `truth`, as a `MeasurementEffect` that draws nothing."""
        return truth


def prior_root(effect: type[Effect], vehicle: Vehicle) -> np.ndarray:
    """Return the lower root (k, k) of the prior covariance of an effect's k continuous parameters,
    in their units.
    """
    sizes = np.array([usual_size(p, vehicle) for p in effect.parameters if not p.choices])
    # Covariance D P D with P = L L^T has the lower root D L.
    return sizes[:, None] * correlation_root(effect)


def correlation_root(effect: type[Effect]) -> np.ndarray:
    """Return the lower root (k, k) of the prior correlation of an effect's k continuous parameters
    [1].
    """
    return (
        np.linalg.cholesky(np.array(effect.prior_correlation))
        if effect.prior_correlation
        else np.eye(sum(not p.choices for p in effect.parameters))
    )


# Prior correlation of drag coefficients along x, y, z: the two level axes of a multirotor see
# nearly the same airframe and rotors (within some 30 %), the rotor axis another. Source: own
# choice.
ALIKE = ((1.0, 0.95, 0.5), (0.95, 1.0, 0.5), (0.5, 0.5, 1.0))


def chi_from_body(motion: Motion, f_B: np.ndarray, tau_B: np.ndarray | None = None) -> np.ndarray:
    """Return chi = [f in W, tau in B] (..., 6) of a wrench in body axes [N, N·m].

    Args:
        f_B: (..., 3) force at Bo in B [N].
        tau_B: (..., 3) torque in B [N·m]; None: none.
    """
    chi = np.zeros((*f_B.shape[:-1], 6))
    chi[..., :3] = (motion.R_WB @ f_B[..., None])[..., 0]
    if tau_B is not None:
        chi[..., 3:] = tau_B
    return chi
