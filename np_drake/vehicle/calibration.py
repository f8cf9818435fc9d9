"""Optional content of a vehicle file: thrust over throttle, and what a healthy vehicle differs by
from its drawing.
"""

import dataclasses as dc

import numpy as np

LINEAR = (
    -0.5,
    1.5,
)  # of `ThrottleMap.linear`: outside thrust falls with throttle, or a third of it gives none [1]
MOST_IDLE = 0.5  # throttle at which any rotor turns [1]; source: own choice
# power of voltage in thrust [1]; own choice: thrust goes with rotor speed squared, speed with
# voltage
STEEPEST = 4.0
GAINS = (0.5, 1.5)  # of a healthy rotor [1]; own choice: one outside is broken, which is a cause
UNEQUAL = 1e-3  # of the mean of the rotors' gains and 1 [1]
SLOWEST = 1.0  # time beyond which a lag, a delay or a clock is in another unit than seconds [s]
LONGEST = 5.0  # beyond which a position is in another unit than metres [m]


@dc.dataclass
class ThrottleMap:
    """Thrust of one rotor over its throttle.

    f = full_thrust (V / voltage)^voltage_exponent ((1 - linear) u² + linear u) with u = (throttle -
    idle) / (1 - idle),
    not below zero; V is the battery's voltage.
    Source: the usual maps lie between a linear and a quadratic one.
    """

    full_thrust: float = (
        0.0  # of one rotor at full throttle and the reference voltage; a file must name it [N]
    )
    linear: float = 0.0  # share of the linear part [1]
    idle: float = 0.0  # throttle at which a rotor begins to turn [1]
    voltage: float | None = None  # reference voltage; None: no battery voltage is known [V]
    voltage_exponent: float = 0.0  # [1]

    def check(self) -> "ThrottleMap":
        """Return self after checking the map.

        Raises: ValueError: where a value is impossible.
        """
        _require(
            0 < self.full_thrust < np.inf,
            f"throttle: full_thrust must be positive [N]; got {self.full_thrust}",
        )
        _within(self.linear, LINEAR, "throttle: linear", "[1]")
        _within(self.idle, (0.0, MOST_IDLE), "throttle: idle", "[1]")
        _within(self.voltage_exponent, (0.0, STEEPEST), "throttle: voltage_exponent", "[1]")
        if self.voltage is None:
            known = self.voltage_exponent == 0
            _require(
                known, "throttle: voltage must be named where voltage_exponent is [V]; got none"
            )
        else:
            _require(
                0 < self.voltage < np.inf,
                f"throttle: voltage must be positive [V]; got {self.voltage}",
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

        Args:
            thrust: of a rotor, of any shape [N].
            voltage: of the battery, of the same shape or one for all [V]; None: the reference
                voltage.
        """
        share = np.maximum(np.asarray(thrust, float), 0.0) / self._full(voltage)
        root = np.sqrt(np.maximum(self.linear**2 + 4 * (1 - self.linear) * share, 0.0))
        if self.linear <= 0.5:
            return self.idle + (1 - self.idle) * (root - self.linear) / (2 * (1 - self.linear))
        return self.idle + (1 - self.idle) * 2 * share / (
            root + self.linear
        )  # near 1 that difference is rounding

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

    center_of_mass: list[float] = dc.field(
        default_factory=lambda: [0.0, 0.0, 0.0]
    )  # from Bo, body axes [m]
    # Thrust of each rotor over that of the thrust map; mean 1 [1].
    rotor_gains: list[float] = dc.field(default_factory=lambda: [1.0, 1.0, 1.0, 1.0])
    # Of a rotor that slows down; None: `rotor_time_constant`, which is then that of one that speeds
    # up [s].
    rotor_time_constant_down: float | None = None
    command_delay: float = 0.0  # from a command to the rotors, beyond their lag [s]
    clock_offset: float = (
        0.0  # the state in row t of a log is that of t + clock_offset, as effect `clock_offset` [s]
    )
    rotor_inertia: float = 0.0  # of one rotor and propeller about its axis [kg·m²]
    imu_position: list[float] | None = (
        None  # of the accelerometer from Bo, body axes; None: not known [m]
    )
    imu_tilt: list[float] = dc.field(
        default_factory=lambda: [0.0, 0.0, 0.0]
    )  # rotation vector, body to IMU axes [rad]

    def check(self) -> "Calibration":
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        _vector(self.center_of_mass, 3, LONGEST, "center_of_mass", "m")
        if self.imu_position is not None:
            _vector(self.imu_position, 3, LONGEST, "imu_position", "m")
        _vector(self.imu_tilt, 3, np.pi, "imu_tilt", "rad")
        _vector(self.rotor_gains, 4, np.inf, "rotor_gains", "1")
        for gain in self.rotor_gains:
            _within(gain, GAINS, "calibration: rotor_gains", "[1]")
        mean = float(np.mean(self.rotor_gains))
        _require(
            abs(mean - 1) <= UNEQUAL,
            (
                f"calibration: rotor_gains must have the mean 1, for thrust_coefficient holds "
                f"the rest; got {mean:g}"
            ),
        )
        if self.rotor_time_constant_down is not None:
            _within(
                self.rotor_time_constant_down,
                (0.0, SLOWEST),
                "calibration: rotor_time_constant_down",
                "s",
            )
        _within(self.command_delay, (0.0, SLOWEST), "calibration: command_delay", "s")
        _within(self.clock_offset, (-SLOWEST, SLOWEST), "calibration: clock_offset", "s")
        _require(
            0 <= self.rotor_inertia < np.inf,
            f"calibration: rotor_inertia must not be negative [kg·m²]; got {self.rotor_inertia}",
        )
        return self


def _vector(value: list[float], size: int, most: float, name: str, unit: str) -> None:
    whole = np.shape(value) == (size,) and bool(np.all(np.isfinite(value)))
    _require(whole, f"calibration: {name} must be {size} numbers [{unit}]; got {value}")
    length = float(np.linalg.norm(value))
    _require(
        length <= most,
        f"calibration: {name} must be at most {most:.3g} {unit} long; got {length:.4g}",
    )


def _within(value: float, bounds: tuple[float, float], name: str, unit: str) -> None:
    least, most = bounds
    _require(least <= value <= most, f"{name} must be {least:g} to {most:g} {unit}; got {value}")


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise ValueError(f"{message}.")
