"""The vehicle file: parameters of the nominal model of a quadrotor."""

import dataclasses as dc
from functools import cached_property
from pathlib import Path

import numpy as np

from np_drake.files.yaml_file import load_checked, read_yaml
from np_drake.vehicle.calibration import Calibration, ThrottleMap
from np_drake.vehicle.physics import implausible
from np_drake.vehicle.rate_loop import RateLoop
from np_drake.vehicle.sources import Intervals, checked_intervals, without

PRESETS = Path(__file__).parent / "presets"  # vehicle files by name
SLOWEST_ROTOR = 1.0  # time constant beyond which the file's is in another unit than seconds [s]
VAGUEST = (
    0.5  # standard deviation over the value at which a figure is no figure [1]; source: own choice
)
LONGEST_ARM = 5.0  # beyond which rotor positions are in another unit than metres [m]
POSITIVE = ("mass", "gravity", "thrust_coefficient", "rotor_radius", "max_rotor_thrust")
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


def _paper_rotors() -> list[list[float]]:
    return [[0.127, 0.127, 0.0], [0.127, -0.127, 0.0], [-0.127, -0.127, 0.0], [-0.127, 0.127, 0.0]]


@dc.dataclass
class MeasurementNoise:
    """Standard deviations of white measurement noise, one sample of the log each."""

    position: float = 0.001  # [m]
    velocity: float = 0.01  # [m/s]
    attitude: float = 0.0  # [rad]
    rate: float = 0.01  # [rad/s]
    acceleration: float = 0.1  # [m/s²]
    angular_acceleration: float = 0.5  # [rad/s²]

    def check(self) -> "MeasurementNoise":
        """Return self after checking the deviations.

        Raises: ValueError: where one is negative or not finite.
        """
        for name, value in dc.asdict(self).items():
            if not 0 <= value < np.inf:
                raise ValueError(
                    f"MeasurementNoise: {name} must be finite and not negative; got {value}."
                )
        return self


@dc.dataclass
class Vehicle:
    """Quadrotor of the nominal model (docs/reference/vehicle-file.md); the defaults are the paper's
    vehicle.

    Rotor i gives the thrust f_i = thrust_coefficient * speed² along body z at `rotor_positions[i]`
    and the torque `rotor_directions[i] * torque_coefficient * speed²` about body z.
    """

    name: str = "paper"
    mass: float = 2.0  # [kg]
    inertia: list[list[float]] = dc.field(  # about the centre of mass, body axes [kg·m²]
        default_factory=lambda: [[0.02, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.035]]
    )
    gravity: float = 9.81  # [m/s²]
    rotor_positions: list[list[float]] = dc.field(default_factory=_paper_rotors)  # body axes [m]
    rotor_directions: list[float] = dc.field(default_factory=lambda: [1.0, -1.0, 1.0, -1.0])  # [1]
    thrust_coefficient: float = 1.0e-5  # [N/(rad/s)²]
    torque_coefficient: float = 1.6e-7  # [N·m/(rad/s)²]
    rotor_radius: float = 0.1  # [m]
    max_rotor_thrust: float = 12.0  # [N]
    rotor_time_constant: float = 0.0  # what the nominal simulator assumes [s]
    logged_point: str = "origin"  # origin | center_of_mass
    input: str = "command"  # command | rotor_speed | thrust_only | normalised
    command_timing: str = "unknown"  # held: from its row until the next | unknown: as the log looks
    measurement_noise: MeasurementNoise = dc.field(
        default_factory=MeasurementNoise
    )  # of the sensors
    # Standard deviation over the value [1]; None: the file does not say.
    mass_uncertainty: float | None = None
    thrust_uncertainty: float | None = None  # of thrust from command, rotor speed or throttle
    throttle: ThrottleMap | None = None  # None: not known
    calibration: Calibration = dc.field(default_factory=Calibration)
    rate_loop: RateLoop | None = None  # of the autopilot; None: not known
    # By field, as `mass` or `calibration.command_delay`; they say nothing of the vehicle itself, so
    # two are equal whatever is said of them.
    sources: dict[str, str] = dc.field(default_factory=dict, compare=False)
    intervals: Intervals = dc.field(
        default_factory=dict, compare=False
    )  # of 95 %; a single number has one pair

    def check(self) -> "Vehicle":
        """Return self after checking all parameters.

        Raises: ValueError: where one is impossible.
        """
        self.input = ALIASES.get(self.input, self.input)
        for name, value in dc.asdict(self).items():
            if not isinstance(value, (str, dict, type(None))):
                _require(bool(np.all(np.isfinite(value))), f"{name} must be finite; got {value}")
        for name in POSITIVE:
            _require(getattr(self, name) > 0, f"{name} must be positive; got {getattr(self, name)}")
        _require(
            0 <= self.rotor_time_constant <= SLOWEST_ROTOR,
            (
                f"rotor_time_constant must be 0 to {SLOWEST_ROTOR:g} s; got "
                f"{self.rotor_time_constant}. Is it in seconds?"
            ),
        )
        _require(np.shape(self.rotor_positions) == (4, 3), "rotor_positions must be 4 x 3 [m]")
        _require(
            np.shape(self.rotor_directions) == (4,) and set(np.abs(self.rotor_directions)) == {1.0},
            "rotor_directions must be four signs, 1 or -1",
        )
        _require(np.shape(self.inertia) == (3, 3), "inertia must be 3 x 3 [kg·m²]")
        J = np.array(self.inertia, float)
        moments = np.linalg.eigvalsh(J) if np.allclose(J, J.T) else np.zeros(3)
        _require(moments[0] > 0, "inertia must be symmetric and positive definite [kg·m²]")
        _require(
            moments[2] <= moments[0] + moments[1] + 1e-12,
            "inertia must meet the triangle inequality",
        )
        _require(
            self.logged_point in ("origin", "center_of_mass"),
            "logged_point: origin | center_of_mass",
        )
        _require(self.command_timing in ("held", "unknown"), "command_timing: held | unknown")
        _require(self.input in INPUTS, f"input: {' | '.join(INPUTS)}")
        self.measurement_noise.check()
        self._check_rotors()
        self._check_uncertainty()
        self._check_calibration()
        self.intervals = checked_intervals(self)
        return self

    def _check_uncertainty(self) -> None:
        for name in ("mass_uncertainty", "thrust_uncertainty"):
            value = getattr(self, name)
            _require(
                value is None or 0 <= value < VAGUEST,
                (
                    f"{name} must be a standard deviation over the value, 0 to below "
                    f"{VAGUEST:g}; got {value}"
                ),
            )

    def _check_rotors(self) -> None:
        longest = float(np.linalg.norm(self.rotor_positions, axis=1).max())
        _require(
            longest <= LONGEST_ARM,
            (
                f"rotor_positions must be within {LONGEST_ARM:g} m of the origin; got "
                f"{longest:g}. Are they in metres?"
            ),
        )
        _require(
            self.torque_coefficient >= 0,
            "torque_coefficient must not be negative, for rotor_directions hold the signs; "
            f"got {self.torque_coefficient}",
        )
        _require(
            abs(np.linalg.det(self.mixer)) > 1e-12, "the rotors must span thrust and three torques"
        )
        lift, weight = 4 * self.max_rotor_thrust, self.mass * self.gravity
        _require(
            lift >= weight,
            f"max_rotor_thrust must let four rotors carry the weight, {weight:.4g} N; got "
            f"{self.max_rotor_thrust} N "
            "each. Is it in N, of one rotor, and the mass in kg?",
        )
        if wrong := implausible(self):
            raise ValueError(f"Vehicle: {wrong}")

    def _check_calibration(self) -> None:
        known = self.calibration.check()
        if self.throttle is not None:
            self.throttle.check()
        if self.rate_loop is not None:
            self.rate_loop.check()
        reach = float(np.linalg.norm(self.rotor_positions, axis=1).max())
        offset = float(np.linalg.norm(known.center_of_mass))
        _require(
            offset <= reach,
            f"calibration.center_of_mass must lie no farther from Bo than the rotors, "
            f"{reach:g} m; got {offset:g}. "
            "Is it in metres?",
        )
        _require(
            known.rotor_inertia <= self.inertia[2][2],
            f"calibration.rotor_inertia must be below that of the vehicle, "
            f"{self.inertia[2][2]:g} kg·m²; got "
            f"{known.rotor_inertia:g}. Is it in kg·m²?",
        )

    @property
    def described(self) -> bool:
        """Whether the file describes the vehicle that flies, as that of a simulator or a test stand
        does.

        Such a file states that commands act as they are logged (`command_timing: held`). Other
        vehicles differ from their file as healthy vehicles do.
        """
        return self.command_timing == "held"

    @cached_property
    def J(self) -> np.ndarray:
        """Inertia about the centre of mass in body axes, (3, 3) [kg·m²]."""
        return np.array(self.inertia, float)

    @cached_property
    def mixer(self) -> np.ndarray:
        """Map from rotor thrusts [N] to u = [f_u, tau_m] [N, N·m], (4, 4)."""
        p = np.array(self.rotor_positions, float)
        kappa = self.torque_coefficient / self.thrust_coefficient
        return np.stack(
            [np.ones(4), p[:, 1], -p[:, 0], kappa * np.array(self.rotor_directions, float)]
        )

    @cached_property
    def unmixer(self) -> np.ndarray:
        """Map from u = [f_u, tau_m] [N, N·m] to rotor thrusts [N], (4, 4)."""
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
        sources, intervals = without(self.sources, "mass"), without(self.intervals, "mass")
        return dc.replace(self, mass=mass, sources=sources, intervals=intervals).check()


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
    if not condition:
        raise ValueError(f"Vehicle: {message}{'' if message.endswith('?') else '.'}")
