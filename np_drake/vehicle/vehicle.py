"""The vehicle file: parameters of the nominal model of a quadrotor, and what a healthy vehicle
differs by from its drawing.
"""

import dataclasses as dc
import math
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.files.yaml_file import POSITIVE, check_fields, load_checked, number, read_yaml, word
from np_drake.vehicle.sources import (
    HALF_WIDTH_95,
    Intervals,
    checked_intervals,
    part,
    value_of,
    values,
    without,
)

PRESETS = Path(__file__).parent / "presets"  # vehicle files by name
SLOWEST = 1.0  # time beyond which a lag, a delay or a clock is in another unit than seconds [s]
LONGEST = 5.0  # coordinate beyond which a position is in another unit than metres [m]
# standard deviation over the value below which a figure is one [1]; source: own choice
VAGUEST = math.nextafter(0.5, 0.0)
MOST_IDLE = 0.5  # throttle at which any rotor turns [1]; source: own choice
# of `ThrottleMap.linear`: outside thrust falls with throttle, or a third of it gives none [1]
LINEAR = (-0.5, 1.5)
# power of voltage in thrust [1]; own choice: thrust goes with rotor speed squared, speed with
# voltage
STEEPEST = 4.0
HEALTHY = (0.5, 1.5)  # gain of a rotor [1]; own choice: one outside is broken, which is a cause
UNEQUAL = 1e-3  # of the mean of the rotors' gains and 1 [1]
LOOP_GAINS = (0.2, 5.0)  # rate over commanded rate of any loop that flies [1]; source: own choice
FASTEST = 44.0  # rate beyond which it is in another unit than rad/s [rad/s]; source: own choice
GRAVITY = 9.81  # [m/s²]
AIR = 1.225  # density at sea level, 15 °C [kg/m³]
SOUND = 340.0  # its speed of sound [m/s]
# Largest moment of inertia over mass times squared arm [1]; own choice. All mass at the rotors
# gives 1, the presets 0.3 to 0.6, a vehicle whose payload bay is as long as its arms below 2.
INERTIA = (0.005, 5.0)
# Torque over that of a rotor without loss, from which it is one [1]; own choice: 1 is the bound,
# and C_T is a guess.
EFFICIENT = 0.25
STRONGEST = 50.0  # largest thrust over weight [1]; own choice: racing quadrotors have 10 to 20
ALIASES = {"thrust_torque": "command"}
INPUTS = ("command", "rotor_speed", "thrust_only", "normalised")
RIGID = (
    "mass",
    "inertia",
    "rotor_positions",
    "thrust_coefficient",
    "torque_coefficient",
    "max_rotor_thrust",
)
INERTIA_OF_PAPER = [[0.02, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.035]]  # [kg·m²]
ROTORS_OF_PAPER = [
    [0.127, 0.127, 0.0],
    [0.127, -0.127, 0.0],
    [-0.127, -0.127, 0.0],
    [-0.127, 0.127, 0.0],
]


# Power of a battery's voltage in thrust at a throttle, and its deviation [1]; source: own choice,
# thrust goes with the square of rotor speed, and speed less than with the voltage.
VOLTAGE = 1.5
VOLTAGE_SCATTER = 0.5
# Power of throttle in thrust, and its deviation [1]. Source: a linearised motor has 1; thrust goes
# with the square of a propeller's speed, and speed with voltage.
THROTTLE_POWER = 1.5
THROTTLE_POWER_SCATTER = 0.5


@dc.dataclass(frozen=True)
class PowerMap:
    """Thrust of a rotor over that of hover: (throttle / hover)^exponent (V / volts)^`VOLTAGE`; no
    volts, no V.
    """

    thrust_at_hover: float  # [N]
    hover: float  # [1]
    exponent: float  # [1]
    volts: float | None  # [V]
    # Squares of the scatter of log thrust between flights that should agree, and their number less
    # that of the means [1].
    scatter: float = 0.0
    freedom: int = 0

    def thrust(self, throttle: np.ndarray, voltage: np.ndarray | None) -> np.ndarray:
        """Return the thrust (n, k) of rotors [N], of their throttle (n, k) and the battery's
        voltage (n, 1).
        """
        charge = 1.0 if voltage is None or self.volts is None else (voltage / self.volts) ** VOLTAGE
        return self.thrust_at_hover * charge * (throttle / self.hover) ** self.exponent


@dc.dataclass
class ThrottleMap:
    """Thrust of one rotor over its throttle.

    f = full_thrust (V / voltage)^voltage_exponent ((1 - linear) u² + linear u) with u = (throttle -
    idle) / (1 - idle),
    not below zero; V is the battery's voltage.
    Source: the usual maps lie between a linear and a quadratic one.
    """

    # f_1, of one rotor at full throttle and the reference voltage; a file must name it
    full_thrust: float = number(0.0, "N", POSITIVE)
    linear: float = number(0.0, "1", *LINEAR)  # l, share of the linear part; −0.5 to 1.5
    idle: float = number(0.0, "1", 0.0, MOST_IDLE)  # i, where a rotor begins to turn
    # V_0, the reference; None: no battery voltage is known
    voltage: float | None = number(None, "V", POSITIVE)
    voltage_exponent: float = number(0.0, "1", 0.0, STEEPEST)  # e

    def check(self) -> "ThrottleMap":
        """Return self after checking the map; ValueError where a value is impossible."""
        check_fields(self, "throttle")
        require(
            self.voltage is not None or self.voltage_exponent == 0,
            "throttle: voltage must be named where voltage_exponent is [V]; got none.",
        )
        return self

    def thrust(
        self, throttle: np.ndarray | float, voltage: np.ndarray | float | None = None
    ) -> np.ndarray:
        """Return the thrust of a rotor [N], at rest as it will be once its lag is over.

        Args:
            throttle: of any shape, 0 to 1 [1].
            voltage: of the battery, of the same shape or one for all [V]; None: the reference
                voltage.
        """
        u = np.maximum((np.asarray(throttle, float) - self.idle) / (1 - self.idle), 0.0)
        share = (1 - self.linear) * np.square(u) + self.linear * u
        return self._full(voltage) * np.maximum(share, 0.0)

    def throttle(
        self, thrust: np.ndarray | float, voltage: np.ndarray | float | None = None
    ) -> np.ndarray:
        """Return the throttle that gives a thrust, the inverse of `thrust`; for none, that at which
        it begins [1].
        """
        share = np.maximum(np.asarray(thrust, float), 0.0) / self._full(voltage)
        root = np.sqrt(np.maximum(self.linear**2 + 4 * (1 - self.linear) * share, 0.0))
        if self.linear <= 0.5:
            return self.idle + (1 - self.idle) * (root - self.linear) / (2 * (1 - self.linear))
        # near 1 that difference is rounding
        return self.idle + (1 - self.idle) * 2 * share / (root + self.linear)

    def _full(self, voltage: np.ndarray | float | None) -> np.ndarray | float:
        if voltage is None or self.voltage is None:
            return self.full_thrust
        return (
            self.full_thrust * (np.asarray(voltage, float) / self.voltage) ** self.voltage_exponent
        )


@dc.dataclass
class Calibration:
    """What a healthy vehicle differs by from its drawing; the defaults are no difference.

    `np_drake.effects.calibration.effects_of` makes the effects of it with which a simulator flies.
    """

    # from Bo, body axes
    center_of_mass: list[float] = number([0.0, 0.0, 0.0], "m", -LONGEST, LONGEST)
    # of thrust; mean 1
    rotor_gains: list[float] = number([1.0, 1.0, 1.0, 1.0], "1", *HEALTHY)
    # of a rotor that slows; None: `rotor_time_constant`
    rotor_time_constant_down: float | None = number(None, "s", 0.0, SLOWEST)
    # from a command to the rotors, beyond their lag
    command_delay: float = number(0.0, "s", 0.0, SLOWEST)
    # row t of a log holds the state of t + offset
    clock_offset: float = number(0.0, "s", -SLOWEST, SLOWEST)
    # of one rotor and propeller about its axis
    rotor_inertia: float = number(0.0, "kg·m²", 0.0)
    # of the accelerometer from Bo, body axes; None: not known
    imu_position: list[float] | None = number(None, "m", -LONGEST, LONGEST, shape=(3,))
    # rotation vector, body to IMU axes
    imu_tilt: list[float] = number([0.0, 0.0, 0.0], "rad", -math.pi, math.pi)

    def check(self) -> "Calibration":
        """Return self after checking all values; ValueError where one is impossible."""
        check_fields(self, "calibration")
        mean = float(np.mean(self.rotor_gains))
        require(
            abs(mean - 1) <= UNEQUAL,
            f"calibration: rotor_gains must have the mean 1, for thrust_coefficient holds "
            f"the rest; got {mean:g}.",
        )
        return self


@dc.dataclass
class RateLoop:
    """What an autopilot makes of commanded body rates: on each body axis a first-order lag.

    dw/dt = (gain w_c - w) / lag. Besides the autopilot's controller, the lag holds the motors' and
    the link's.
    """

    lag: list[float] = number([0.075, 0.075, 0.2], "s", 1e-3, SLOWEST)  # with rotors, filters, link
    gain: list[float] = number([1.0, 1.0, 1.0], "1", *LOOP_GAINS)  # rate over command, at rest
    # largest that may be commanded
    max_rate: list[float] = number([6.0, 6.0, 3.0], "rad/s", 1e-2, FASTEST)

    def torque(self, J: np.ndarray, w: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the torque (..., 3) by which the loop turns the vehicle, with what its own
        rotation needs [N·m].

        Args:
            J: (3, 3) inertia [kg·m²].
            w: (..., 3) body rates [rad/s].
            command: (..., 3) commanded body rates [rad/s].
        """
        al = (np.array(self.gain) * command - w) / np.array(self.lag)
        return al @ J.T + np.cross(w, w @ J.T)

    def command(self, w: np.ndarray, al: np.ndarray) -> np.ndarray:
        """Return the commanded rates (..., 3) that give an angular acceleration [rad/s].

        Args:
            w: (..., 3) body rates [rad/s].
            al: (..., 3) angular acceleration in body axes [rad/s²].
        """
        return (w + np.array(self.lag) * al) / np.array(self.gain)


@dc.dataclass
class MeasurementNoise:
    """Standard deviations of white measurement noise, one sample of the log each."""

    position: float = number(0.001, "m", 0.0)  # of px, py, pz
    velocity: float = number(0.01, "m/s", 0.0)  # of vx, vy, vz
    attitude: float = number(0.0, "rad", 0.0)  # of the quaternion, as a small rotation
    rate: float = number(0.01, "rad/s", 0.0)  # of wx, wy, wz
    acceleration: float = number(0.1, "m/s²", 0.0)  # of specific force, in body axes
    angular_acceleration: float = number(0.5, "rad/s²", 0.0)  # of alx, aly, alz


@dc.dataclass
class Vehicle:
    """Quadrotor of the nominal model (docs/reference/vehicle-file.md); the defaults are the paper's
    vehicle.

    Rotor i gives the thrust f_i = thrust_coefficient * speed² along body z at `rotor_positions[i]`
    and the torque `rotor_directions[i] * torque_coefficient * speed²` about body z.
    """

    name: str = "paper"  # in messages and reports
    mass: float = number(2.0, "kg", POSITIVE)  # without payload
    # about the centre of mass, body axes; symmetric, positive definite, triangle inequality
    inertia: list[list[float]] = number(INERTIA_OF_PAPER, "kg·m²")
    gravity: float = number(9.81, "m/s²", POSITIVE)  # positive
    # rotor 1 to 4 from Bo, body axes
    rotor_positions: list[list[float]] = number(ROTORS_OF_PAPER, "m", -LONGEST, LONGEST)
    # sign of the reaction torque about body z
    rotor_directions: list[float] = number([1.0, -1.0, 1.0, -1.0], "1", -1.0, 1.0)
    # thrust over squared rotor speed
    thrust_coefficient: float = number(1.0e-5, "N/(rad/s)²", POSITIVE)
    # torque over squared rotor speed
    torque_coefficient: float = number(1.6e-7, "N·m/(rad/s)²", 0.0)
    rotor_radius: float = number(0.1, "m", POSITIVE)  # tips stay below the speed of sound
    # of one rotor; four must carry the weight
    max_rotor_thrust: float = number(12.0, "N", POSITIVE)
    # lag of rotor speed that the nominal model assumes
    rotor_time_constant: float = number(0.0, "s", 0.0, SLOWEST)
    logged_point: str = word(
        "origin",
        "origin",
        "center_of_mass",
        meaning="of a log's position: origin (middle of the rotors) | center_of_mass",
    )
    input: str = word("command", *INPUTS, meaning=f"what drives the model: {' | '.join(INPUTS)}")
    command_timing: str = word(
        "unknown",
        "held",
        "unknown",
        meaning="held: from its row until the next | unknown: as the log looks",
    )
    # of the sensors
    measurement_noise: MeasurementNoise = dc.field(default_factory=MeasurementNoise)
    # standard deviation over the value; None: that of the diagnosis
    mass_uncertainty: float | None = number(None, "1", 0.0, VAGUEST)
    # the same of thrust from command, rotor speed or throttle; from 0.1 on a guess
    thrust_uncertainty: float | None = number(None, "1", 0.0, VAGUEST)
    throttle: ThrottleMap | None = None  # thrust over throttle; None: not known
    calibration: Calibration = dc.field(default_factory=Calibration)
    rate_loop: RateLoop | None = None  # of an autopilot; None: not known
    # by field, as `calibration.command_delay`, or number, as `inertia[0][1]`: where it is from
    sources: dict[str, str] = dc.field(default_factory=dict, compare=False)
    # by field: 95 % [low, high] of each of its numbers
    intervals: Intervals = dc.field(default_factory=dict, compare=False)

    def __post_init__(self) -> None:
        """Raises: ValueError: where a number is outside its bounds."""
        self.input = ALIASES.get(self.input, self.input)
        check_fields(self, "Vehicle")

    def check(self) -> "Vehicle":
        """Return self after checking all parameters; ValueError where one is impossible."""
        self.__post_init__()
        check_fields(self.measurement_noise, "MeasurementNoise")
        self.calibration.check()
        if self.throttle is not None:
            self.throttle.check()
        if self.rate_loop is not None:
            check_fields(self.rate_loop, "rate_loop")
        J = np.array(self.inertia, float)
        moments = np.linalg.eigvalsh(J) if np.allclose(J, J.T) else np.zeros(3)
        _require(moments[0] > 0, "inertia must be symmetric and positive definite [kg·m²]")
        _require(
            moments[2] <= moments[0] + moments[1] + 1e-12,
            "inertia must meet the triangle inequality",
        )
        _require(
            set(np.abs(self.rotor_directions)) == {1.0},
            "rotor_directions must be four signs, 1 or -1",
        )
        _require(
            abs(np.linalg.det(self.mixer)) > 1e-12, "the rotors must span thrust and three torques"
        )
        self._check_sizes(float(moments[2]))
        self._check_rotors()
        self.intervals = checked_intervals(self)
        return self

    def _check_sizes(self, largest: float) -> None:
        """Check inertia, of which `largest` is the largest moment [kg·m²], and thrust against mass
        and arms.
        """
        arm = float(np.linalg.norm(self.rotor_positions, axis=1).max())
        weight = self.mass * self.gravity
        unit = self.mass * arm**2
        most = self.max_rotor_thrust
        offset = float(np.linalg.norm(self.calibration.center_of_mass))
        _require(
            4 * most >= weight,
            f"max_rotor_thrust must let four rotors carry the weight, {weight:.4g} N; got {most} N "
            "each. Is it in N, of one rotor, and the mass in kg?",
        )
        _require(
            INERTIA[0] * unit <= largest <= INERTIA[1] * unit,
            f"inertia must be comparable with mass times squared arm, {unit:.2g} kg·m² "
            f"({INERTIA[0] * unit:.2g} to {INERTIA[1] * unit:.2g}); got {largest:.3g}. Is it in "
            "kg·m² (1 g·mm² is 1e-9, 1 g·cm² 1e-7 kg·m²), the mass in kg, the arm in m?",
        )
        _require(
            4 * most <= STRONGEST * weight,
            f"max_rotor_thrust must be of one rotor, in all at most {STRONGEST:g} times the "
            f"weight of {weight:.3g} N; got {most:.4g} N each. Is it in N (1 gf is 0.0098 N), and "
            "the mass in kg?",
        )
        _require(
            offset <= arm,
            f"calibration.center_of_mass must lie no farther from Bo than the rotors, {arm:g} m; "
            f"got {offset:g}. Is it in metres?",
        )
        _require(
            self.calibration.rotor_inertia <= self.inertia[2][2],
            f"calibration.rotor_inertia must be below that of the vehicle, {self.inertia[2][2]:g} "
            f"kg·m²; got {self.calibration.rotor_inertia:g}. Is it in kg·m²?",
        )

    def _check_rotors(self) -> None:
        """Check thrust and torque of a rotor against momentum theory."""
        most = self.max_rotor_thrust
        D = 2 * self.rotor_radius
        speed = math.sqrt(most / self.thrust_coefficient)
        tip = speed * self.rotor_radius
        # The air through the disc moves at sqrt(T / (2 rho A)), which no blade's tip can be slower
        # than.
        induced = math.sqrt(most / (2 * AIR * math.pi * self.rotor_radius**2))
        unit = (
            "Is thrust_coefficient in N/(rad/s)² (1 N/rpm² is 91.2 N/(rad/s)²), and rotor_radius "
            "in m?"
        )
        named = (
            f"thrust_coefficient must give {most:.4g} N from a rotor of {self.rotor_radius:.3g} m"
        )
        _require(
            tip < SOUND,
            f"{named} below the speed of sound; got tips at {tip:.0f} m/s ({speed:.5g} rad/s). "
            f"{unit}",
        )
        _require(
            tip >= induced,
            f"{named} with tips faster than its air, {induced:.3g} m/s; got {tip:.2g} m/s. {unit}",
        )
        lever = self.torque_coefficient / self.thrust_coefficient
        number = self.thrust_coefficient * (2 * math.pi) ** 2 / (AIR * D**4)
        least = EFFICIENT * least_torque_over_thrust(number, D)
        _require(
            least <= lever <= D,
            f"torque_coefficient over thrust_coefficient must be {least:.2g} to {D:.2g} m, the "
            f"rotor's diameter; got {lever:.3g} m. Are both per (rad/s)², and rotor_radius in m?",
        )

    @property
    def described(self) -> bool:
        """Whether the file describes the vehicle that flies, as that of a simulator or a test stand
        does.

        Such a file states that commands act as they are logged (`command_timing: held`). Other
        vehicles differ from their file as healthy vehicles do.
        """
        return self.command_timing == "held"

    def known_within(self, field: str, *index: int) -> float | None:
        """Return the standard deviation that the file states of a number, by its interval [its
        unit]; None: it states none.

        Args:
            index: place in a list or matrix, from 0.
        """
        value: Any = np.asarray(value_of(field, values(self)), float)
        # Of the number, of its row, or of the whole field.
        for depth in range(len(index), -1, -1):
            name = part(field, *index[:depth])
            if name in self.intervals:
                ends: Any = np.array(self.intervals[name], float)
                ends = ends.reshape(*value[index[:depth]].shape, 2)[index[depth:]]
                return float(np.max(np.abs(ends - value[index]))) / HALF_WIDTH_95
        return None

    def uncertainty(self, of: str) -> float | None:
        """Return the standard deviation over the value that the file states of `mass` or `thrust`
        [1]; None: it states none.
        """
        field = {"mass": "mass", "thrust": "thrust_coefficient"}[of]
        stated = getattr(self, f"{of}_uncertainty")
        known = self.known_within(field)
        return stated if stated is not None or known is None else known / getattr(self, field)

    @property
    def measured(self) -> bool:
        """Whether the file states how well thrust and each moment of inertia are known."""
        moments = [self.known_within("inertia", i, i) for i in range(3)]
        return None not in (self.uncertainty("thrust"), *moments)

    @cached_property
    def rotor_positions_B(self) -> np.ndarray:
        """Positions of the rotors (4, 3), from Bo in body axes [m]."""
        return np.array(self.rotor_positions, float)

    @cached_property
    def J(self) -> np.ndarray:
        """Inertia about the centre of mass in body axes, (3, 3) [kg·m²]."""
        return np.array(self.inertia, float)

    @cached_property
    def mixer(self) -> np.ndarray:
        """Map from rotor thrusts [N] to u = [f_u, tau_m], [N, N·m], (4, 4)."""
        p = self.rotor_positions_B
        kappa = self.torque_coefficient / self.thrust_coefficient
        return np.stack(
            [np.ones(4), p[:, 1], -p[:, 0], kappa * np.array(self.rotor_directions, float)]
        )

    @cached_property
    def unmixer(self) -> np.ndarray:
        """Map from u = [f_u, tau_m], [N, N·m], to rotor thrusts [N], (4, 4)."""
        return np.linalg.inv(self.mixer)

    @property
    def hover_input(self) -> np.ndarray:
        """Input u (4,) that carries the nominal weight [N, N·m]."""
        return np.array([self.mass * self.gravity, 0.0, 0.0, 0.0])

    def saturate(self, u: np.ndarray) -> np.ndarray:
        """Return the nearest u (..., 4), in rotor space, that the rotors can give [N, N·m]."""
        # Projection on the box of rotor thrusts.
        thrust = np.clip(u @ self.unmixer.T, 0.0, self.max_rotor_thrust)
        return thrust @ self.mixer.T

    def with_mass(self, mass: float) -> "Vehicle":
        """Return a copy of the vehicle with another mass [kg], without what is said of the present
        one.
        """
        sources = without(self.sources, "mass")
        intervals = without(self.intervals, "mass")
        return dc.replace(self, mass=mass, sources=sources, intervals=intervals).check()


def least_torque_over_thrust(number: float, diameter: float) -> float:
    """Return torque over thrust of a rotor without loss, of figure of merit 1 [m].

    Momentum theory: the power Omega Q of a propeller of disc area A that hovers at thrust T is T
    sqrt(T / (2 rho A)), hence Q / T = D sqrt(2 C_T / pi) / (2 pi).

    Args:
        number: thrust number C_T = T / (rho n² D⁴), n in revolutions a second [1].
        diameter: D of the rotor [m].
    """
    return diameter * math.sqrt(2 * number / math.pi) / (2 * math.pi)


def preset_names() -> list[str]:
    """Return the names of the vehicles that come with the package; their files state the
    sources.
    """
    return sorted(file.stem for file in PRESETS.glob("*.yaml"))


def vehicle_file(name: str | Path) -> Path:
    """Return the vehicle file at the path `name`, or that of the preset called `name`.

    Raises: ValueError: where there is neither.
    """
    if str(name) in preset_names():
        return PRESETS / f"{name}.yaml"
    path = Path(name)
    if not path.exists() and path.name == str(name) and not path.suffix:
        raise ValueError(
            f"{name}: no such vehicle file, and no preset; the presets are "
            f"{', '.join(preset_names())}."
        )
    return path


def load_vehicle(name: str | Path) -> Vehicle:
    """Read a vehicle file (YAML), the nominal vehicle of a scenario file, or the preset of that
    name.

    Raises: ValueError: one line with file and field, on bad content.
    """
    return load_checked(Vehicle, vehicle_file(name), "vehicle file", part="vehicle")


def left_out(name: str | Path) -> list[str]:
    """Return the parameters of `RIGID` that a readable vehicle file does not name, for which
    defaults are used.
    """
    named = read_yaml(vehicle_file(name))
    named = named.get("vehicle") or named
    return [field for field in RIGID if field not in named]


def _require(condition: bool, message: str) -> None:
    require(condition, f"Vehicle: {message}{'' if message.endswith('?') else '.'}")
