"""Quantities of a vehicle file that the parameters of the model tell, with intervals and what told
them.
"""

import dataclasses as dc
from collections.abc import Callable
from functools import partial

import numpy as np

from np_drake.identification.model import (
    Frame,
    Values,
    collective_thrust,
    inertia,
    rotor_gains,
    target_speed,
)
from np_drake.identification.signals import G
from np_drake.vehicle.rotor_layout import RotorName

# deviation over that of the prior below which flights tell a quantity [1]; own choice: two bits
OBSERVABLE_RATIO = 0.5
Z_975 = 1.959964  # standard deviations of 95 %


@dc.dataclass(frozen=True)
class Basis:
    """What turns quantities over mass into those of a vehicle.

    frame: what is given.
    drive: what turned the rotors.
    mass: given [kg]; None: not.
    coefficient: of thrust, where it is trusted and the mass is not given [N/(rad/s)²].
    spin: rotor speed in hover, or an estimate [rad/s]. newtons: whether the mass follows from
        commanded thrust.
    """

    frame: Frame
    drive: str
    mass: float | None
    coefficient: float | None
    spin: float
    newtons: bool = False

    @property
    def ratios(self) -> bool:
        """Whether neither mass nor thrust is known, so that all is told over the mass."""
        return self.mass is None and self.coefficient is None and not self.newtons

    def mass_of(self, v: Values) -> float:
        """Return the mass [kg], or 1 where only ratios are told."""
        if self.mass is not None:
            return self.mass
        per_mass = 0.25 * G * v["scale"] * v["charge"]
        if self.newtons:
            return self.frame.unit / per_mass
        return 1.0 if self.coefficient is None else self.coefficient * self.frame.unit**2 / per_mass

    def hover_thrust(self, v: Values) -> float:
        """Return the thrust of one rotor at the unit of input [N, or N/kg where only ratios are
        told].
        """
        return self.mass_of(v) * 0.25 * G * v["scale"] * v["charge"]


@dc.dataclass(frozen=True)
class Quantity:
    """One number of a vehicle file.

    field: of the vehicle file; empty: of none.
    index: place in a vector or matrix.
    unit: as printed; over mass where only ratios are told.
    of: from the parameters.
    positive: whether its interval is one of ratios. needs: what a log must hold.
    per_mass: whether it scales with the mass.
    why: what a flight that does not tell it lacks, and `manoeuvre`: what would tell it.
    """

    name: str
    field: str
    unit: str
    of: Callable[[Values, Basis], float]
    index: tuple[int, ...] = ()
    positive: bool = False
    needs: tuple[str, ...] = ()
    per_mass: bool = False
    why: str = ""
    manoeuvre: str = ""


def _length(name: str) -> Callable[[Values, Basis], float]:
    return lambda v, b: b.frame.arm * v[name]


def _center(axis: str) -> Callable[[Values, Basis], float]:
    return lambda v, b: b.frame.arm * (v[f"com_{axis}"] + v[f"shift_{axis}"])


def _plain(name: str) -> Callable[[Values, Basis], float]:
    return lambda v, b: v[name]


def _drag(name: str) -> Callable[[Values, Basis], float]:
    """Return the drag over mass at the rotor speed of hover, with which it grows [1/s]."""
    return lambda v, b: v[name] / float(np.sqrt(v["scale"] * v["charge"]))


def _moment(i: int, k: int) -> Callable[[Values, Basis], float]:
    return lambda v, b: b.mass_of(v) * b.frame.arm**2 * float(inertia(v)[i, k])


def _gain(i: int) -> Callable[[Values, Basis], float]:
    return lambda v, b: float(rotor_gains(v, b.frame)[i])


def _full_over_hover(v: Values, b: Basis) -> float:
    """Return rotor speed at full throttle over that in hover [1]."""
    return v["full_speed"] / float(target_speed(np.array(b.frame.throttle), v["curve"], v["idle"]))


def _full(v: Values, b: Basis) -> float:
    """Return the thrust of one rotor at full throttle and the reference voltage [N]."""
    if b.drive == "collective":
        return b.hover_thrust(v) * float(
            collective_thrust(1.0 / b.frame.throttle, v["slope"], v["bend"])
        )
    return b.hover_thrust(v) * _full_over_hover(v, b) ** 2


def _linear(v: Values, b: Basis) -> float:
    """Return the linear share of the vehicle file's curve, which has no idle speed, that gives the
    thrust of hover.
    """
    u = float(np.clip(b.frame.throttle, 0.05, 0.95))
    share = float(target_speed(np.array(u), v["curve"], v["idle"])) ** 2
    if b.drive == "collective":
        idle = max(_without_thrust(v, b), 0.0)
        u = (u - idle) / (1.0 - idle)
        share = b.hover_thrust(v) / _full(v, b)
    return (share - u * u) / (u - u * u)


def _command(v: Values, b: Basis, weights: float) -> float:
    """Return the collective command with which thrust is so many weights [1]."""
    more = weights / (v["scale"] * v["charge"]) - 1.0
    root = np.sqrt(max(v["slope"] ** 2 + 4.0 * v["bend"] * more, 0.0))
    return b.frame.throttle * (1.0 + 2.0 * more / (v["slope"] + root))


_hover = partial(_command, weights=1.0)
_without_thrust = partial(_command, weights=0.0)


def _steepness(v: Values, b: Basis) -> float:
    """Return the change of thrust with the collective command at hover, over the weight [1]."""
    beyond = _hover(v, b) / b.frame.throttle - 1.0
    slope = v["slope"] + 2.0 * v["bend"] * beyond
    return v["scale"] * v["charge"] * slope / b.frame.throttle


ROLL = "roll and pitch doublets"
YAW = "fast turns of the heading"
BLIPS = "quick changes of height"
MOTORS = ("motors",)
SPEED = ("speed",)
THROTTLE = ("throttle",)
ROTORS = ("rotors",)
COLLECTIVE = ("collective",)
ROTOR_GAINS = "calibration.rotor_gains"
HEIGHTS = "climbs and descents"

QUANTITIES: tuple[Quantity, ...] = (
    Quantity("mass", "mass", "kg", lambda v, b: b.mass_of(v), positive=True, needs=("trusted",)),
    Quantity(
        "thrust coefficient",
        "thrust_coefficient",
        "N/(rad/s)²",
        lambda v, b: b.hover_thrust(v) / b.spin**2,
        positive=True,
        needs=("speed", "mass"),
        per_mass=True,
        why="the vehicle hardly flies",
        manoeuvre=BLIPS,
    ),
    Quantity(
        "logged thrust, true over logged",
        "",
        "1",
        lambda v, b: b.hover_thrust(v) / b.frame.unit,
        positive=True,
        needs=("newtons", "mass"),
        per_mass=True,
    ),
    *(
        Quantity(
            f"inertia {a}",
            "inertia",
            "kg·m²",
            _moment(i, k),
            (i, k),
            positive=i == k,
            needs=ROTORS,
            per_mass=True,
            why=f"the vehicle hardly {w}",
            manoeuvre=m,
        )
        for a, i, k, w, m in (
            ("xx", 0, 0, "rolls", ROLL),
            ("yy", 1, 1, "pitches", ROLL),
            ("zz", 2, 2, "turns fast about two axes at once", f"{ROLL} while turning"),
            ("xy", 0, 1, "rolls and pitches", ROLL),
            ("xz", 0, 2, "rolls and yaws", ROLL),
            ("yz", 1, 2, "pitches and yaws", ROLL),
        )
    ),
    *(
        Quantity(
            f"centre of mass {a}",
            "calibration.center_of_mass",
            "m",
            _center(a),
            (i,),
            needs=ROTORS,
            why="rotors that are unequal look the same",
            manoeuvre=BLIPS,
        )
        for i, a in enumerate("xy")
    ),
    Quantity(
        "centre of mass z",
        "calibration.center_of_mass",
        "m",
        lambda v, b: b.frame.arm * v["com_z"],
        (2,),
        needs=ROTORS,
        why="a lower IMU and the air's moment look the same",
        manoeuvre="a measurement of it",
    ),
    *(
        Quantity(
            f"gain of rotor {i + 1}",
            ROTOR_GAINS,
            "1",
            _gain(i),
            (i,),
            needs=ROTORS,
            why="a centre of mass beside the middle looks the same",
            manoeuvre=f"{BLIPS} and {ROLL}",
        )
        for i in range(4)
    ),
    Quantity(
        "torque over thrust",
        "torque_coefficient",
        "m",
        lambda v, b: v["torque"] * b.frame.radius,
        positive=True,
        needs=ROTORS,
        why="only its ratio to inertia zz shows",
        manoeuvre=f"{ROLL} while turning",
    ),
    Quantity(
        "inertia of a rotor",
        "calibration.rotor_inertia",
        "kg·m²",
        lambda v, b: v["rotor_momentum"] * _moment(2, 2)(v, b) / b.spin,
        positive=True,
        per_mass=True,
        needs=SPEED,
        why="the heading is hardly accelerated",
        manoeuvre=YAW,
    ),
    Quantity(
        "time constant up",
        "rotor_time_constant",
        "s",
        _plain("lag"),
        positive=True,
        needs=MOTORS,
        why="commands change slowly",
        manoeuvre=f"{ROLL}, {BLIPS}",
    ),
    Quantity(
        "time constant down",
        "calibration.rotor_time_constant_down",
        "s",
        lambda v, b: v["lag"] * v["lag_ratio"],
        positive=True,
        needs=MOTORS,
        why="commands change slowly",
        manoeuvre=f"{ROLL}, {BLIPS}",
    ),
    Quantity(
        "transport delay",
        "calibration.command_delay",
        "s",
        _plain("delay"),
        needs=MOTORS,
        why="commands change slowly",
        manoeuvre=ROLL,
    ),
    Quantity(
        "clock of the state",
        "calibration.clock_offset",
        "s",
        lambda v, b: -v["clock"],
        needs=SPEED,
        why="rotor speed changes slowly",
        manoeuvre=ROLL,
    ),
    Quantity(
        "thrust at full throttle",
        "throttle.full_thrust",
        "N",
        _full,
        positive=True,
        needs=("throttle", "mass"),
        per_mass=True,
        why="throttle stays near hover",
        manoeuvre="climbs at full throttle",
    ),
    Quantity(
        "rotor speed at full throttle",
        "",
        "rad/s",
        lambda v, b: b.spin * _full_over_hover(v, b),
        positive=True,
        needs=("throttle", "speed"),
        why="throttle stays near hover",
        manoeuvre="climbs at full throttle",
    ),
    Quantity(
        "linear share of throttle",
        "throttle.linear",
        "1",
        _linear,
        needs=THROTTLE,
        why="throttle stays near hover",
        manoeuvre="climbs and descents",
    ),
    Quantity(
        "hover command",
        "",
        "1",
        _hover,
        positive=True,
        needs=COLLECTIVE,
        why="the vehicle hardly flies",
        manoeuvre=BLIPS,
    ),
    Quantity(
        "thrust over command at hover, in weights",
        "",
        "1",
        _steepness,
        positive=True,
        needs=COLLECTIVE,
        why="the command stays near hover",
        manoeuvre=HEIGHTS,
    ),
    Quantity(
        "command without thrust",
        "throttle.idle",
        "1",
        _without_thrust,
        needs=("collective", "full"),
        why="the command stays near hover",
        manoeuvre=HEIGHTS,
    ),
    Quantity(
        "thrust at full command",
        "throttle.full_thrust",
        "N",
        _full,
        positive=True,
        needs=("collective", "mass", "full"),
        per_mass=True,
        why="the command stays near hover",
        manoeuvre="climbs at full throttle",
    ),
    Quantity(
        "linear share of command",
        "throttle.linear",
        "1",
        _linear,
        needs=("collective", "full"),
        why="the command stays near hover",
        manoeuvre=HEIGHTS,
    ),
    Quantity(
        "idle speed over full speed",
        "",
        "1",
        _plain("idle"),
        needs=THROTTLE,
        why="throttle stays near hover",
        manoeuvre="descents with idle motors",
    ),
    Quantity(
        "power of the voltage",
        "throttle.voltage_exponent",
        "1",
        _plain("sag"),
        needs=("voltage",),
        why="the voltage hardly falls",
        manoeuvre="a flight until the battery is low",
    ),
    *(
        Quantity(
            f"IMU {a}",
            "calibration.imu_position",
            "m",
            _length(f"imu_{a}"),
            (i,),
            needs=("accelerometer",),
            why="the vehicle hardly turns",
            manoeuvre=m,
        )
        for i, (a, m) in enumerate((("x", YAW), ("y", YAW), ("z", ROLL)))
    ),
    *(
        Quantity(
            f"IMU tilt {a}",
            "calibration.imu_tilt",
            "rad",
            _plain(f"tilt_{a}"),
            (i,),
            needs=("accelerometer",),
            why="a bias of the accelerometer looks the same",
            manoeuvre=BLIPS,
        )
        for i, a in enumerate("xyz")
    ),
    *(
        Quantity(
            name,
            "",
            unit,
            of,
            needs=("velocity", *needs),
            why=f"it {motion} slowly",
            manoeuvre=BLIPS if motion == "climbs" else "speed",
        )
        for name, unit, of, needs, motion in (
            ("drag, lateral", "1/s", _drag("drag"), (), "flies"),
            ("drag, vertical", "1/s", _drag("climb"), (), "climbs"),
            ("lift of lateral speed", "1/m", _plain("lift"), (), "flies"),
            ("pitch moment of forward speed", "m/s", _length("flap_x"), ROTORS, "flies"),
            ("roll moment of lateral speed", "m/s", _length("flap_y"), ROTORS, "flies"),
        )
    ),
)


@dc.dataclass(frozen=True)
class Identified:
    """One quantity as flights and prior tell it.

    value, low, high: with its 95 % interval.
    prior: (low, high) of the prior.
    observable: whether flights tell it. p: probability that flights which agree differ as much as
        these do [1]; NaN: not tested.
    follows: parameter of the model on which the value depends most.
    rotor: what its rotor is called; None: it is of no single one.
    """

    quantity: Quantity
    value: float
    low: float
    high: float
    prior: tuple[float, float]
    observable: bool
    p: float = float("nan")
    follows: str = ""
    rotor: RotorName | None = None

    @property
    def title(self) -> str:
        """Name of the quantity for people, with that of its rotor."""
        return f"gain of the {self.rotor}" if self.rotor else self.name

    @property
    def name(self) -> str:
        """Name of the quantity."""
        return self.quantity.name
