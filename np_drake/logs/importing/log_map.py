"""Map of a log: which columns hold which quantity, in which unit and convention, and the conversion
to SI units and our frames.
"""

import dataclasses as dc
import itertools
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import numpy as np
import scipy

from np_drake import attitude
from np_drake.checks import require
from np_drake.files.yaml_file import check_fields, load_checked, number, read_yaml, word
from np_drake.logs.columns import GRAVITY as GRAVITY

# Where an axis of a frame may point: forward, left, up of the body; east, north, up of the world.
POINTS = {"f": 0, "l": 1, "u": 2, "e": 0, "n": 1}
AXES = {letter: np.eye(3)[axis] for letter, axis in POINTS.items()}
AXES |= {back: -AXES[letter] for back, letter in zip("brdws", "fluen", strict=True)}


def axes_of_word(word: str) -> np.ndarray:
    """Return the axes x, y, z (3, 3) that the letters of a frame name, as columns in our frame."""
    return np.stack([AXES[letter] for letter in word], axis=1)


def _frames(usual: tuple[str, ...], letters: str) -> tuple[str, ...]:
    """Return the words of the 24 right-handed frames, the usual first."""
    right = (
        word
        for word in map("".join, itertools.permutations(letters, 3))
        if np.linalg.det(axes_of_word(word)) > 0
    )
    return tuple(dict.fromkeys((*usual, *right)))


WORLDS = _frames(("enu", "ned"), "enuwsd")  # z up (any horizontal axes), z down, others
BODIES = _frames(("flu", "frd"), "flubrd")  # z along the thrust, z against it, others
TIMINGS = ("held_after", "held_before", "averaged", "sampled", "unknown")
UNITS: dict[str, dict[str, float]] = {  # by quantity: factor to SI
    "position": {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048},
    "velocity": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001, "km/h": 1 / 3.6},
    "attitude": {"1": 1.0, "rad": 1.0, "deg": 0.017453292519943295},
    "rates": {"rad/s": 1.0, "deg/s": 0.017453292519943295, "mrad/s": 0.001},
    "acceleration": {"m/s2": 1.0, "g": 9.80665, "mg": 9.80665e-3, "mm/s2": 0.001},
    "angular_acceleration": {"rad/s2": 1.0, "deg/s2": 0.017453292519943295},
    "thrust": {"N": 1.0, "mN": 0.001, "gf": 9.80665e-3, "weight": 1.0},
    "torque": {"N.m": 1.0, "mN.m": 0.001},
    "rotor_speed": {
        "rad/s": 1.0,
        "rpm": 0.10471975511965977,
        "Hz": 6.283185307179586,
        "erpm": 0.10471975511965977,
    },
    "throttle": {"1": 1.0, "percent": 0.01, "us": 1.0, "pwm16": 1 / 65535, "dshot": 1 / 2000},
    "hover_throttle": {"1": 1.0, "percent": 0.01, "us": 1.0, "pwm16": 1 / 65535, "dshot": 1 / 2000},
    "voltage": {"V": 1.0, "mV": 0.001},
    "commanded_rates": {"rad/s": 1.0, "deg/s": 0.017453292519943295},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
}
ORDERS = ("wxyz", "xyzw")
DIRECTIONS = ("body_to_world", "world_to_body")
SIZES: dict[str, tuple[int, ...]] = {  # number of columns
    "position": (3,),
    "velocity": (3,),
    "attitude": (4, 3),
    "rates": (3,),
    "acceleration": (3,),
    "angular_acceleration": (3,),
    "thrust": (1,),
    "torque": (3,),
    "rotor_speed": (4,),
    "throttle": (1, 4, 6, 8),  # of more than four rotors their collective is taken
    "hover_throttle": (1,),
    "voltage": (1,),
    "commanded_rates": (3,),
}
RATES = (4.0, 20000.0)  # of the rows of a flight log [Hz]: those that are read again
MOST_POLE_PAIRS = 50  # of a motor; own choice: more than any of a multirotor
PRESETS = Path(__file__).parents[1] / "maps"  # maps of public data sets, by name


@dc.dataclass
class Source:
    """Columns that hold one quantity; none: the log lacks it."""

    # `stream/column`, or `column` where one stream alone has it
    columns: list[str] = dc.field(default_factory=list)
    unit: str = ""  # of `UNITS`; empty: SI
    scale: float = 1.0  # factor on the columns before the unit; −1 turns a sign [1]
    # of each column, 1 or −1: `[1, -1, 1]` turns a left-handed pitch; empty: all 1
    signs: list[float] = dc.field(default_factory=list)
    axes: str = word("", "", "world", "body")  # empty: world for velocity and dv/dt, else body
    # of an acceleration: specific_force (an accelerometer's; so if empty) | acceleration (dv/dt)
    kind: str = word("", "", "specific_force", "acceleration")
    order: str = word("wxyz", *ORDERS)  # of a quaternion
    direction: str = word("body_to_world", *DIRECTIONS)  # of an attitude
    world: str = word("", "", *WORLDS, meaning="`world`, where it differs from the map's")
    body: str = word("", "", *BODIES, meaning="`body`, where it differs from the map's")
    # by which the stamps are later than the quantity; None: measured (`on_one_clock`) [s]
    late: float | None = None
    # of a throttle, its readings at 0 and 1, once or for each column; empty: those of the unit
    ends: list[float] = dc.field(default_factory=list)
    pole_pairs: int = 0  # of motors whose speed is in `erpm`; 0: not stated

    def __bool__(self) -> bool:
        return bool(self.columns)

    def unit_of(self, name: str) -> str:
        """Return the unit of a quantity of this name, also where it is left open."""
        return self.unit or next(iter(UNITS[name]))

    def axes_of(self, name: str) -> str:
        """Return the axes of a vector of this name, `world` or `body`, also where they are left
        open.
        """
        derived = name == "acceleration" and self.kind == "acceleration"
        return self.axes or ("world" if derived or name in ("position", "velocity") else "body")

    def is_turned(self, name: str) -> bool:
        """Return whether a vector of this name is turned by the attitude: its axes are not those of
        `convert`.
        """
        wanted = "world" if name in ("position", "velocity", "acceleration") else "body"
        return self.axes_of(name) != wanted


@dc.dataclass
class LogMap:
    """Columns and conventions of a log (docs/reference/log-map.md)."""

    # crazyflie | blackbox | ulog | dataflash | tlog | ros | neural_fly | table; empty: as it looks
    format: str = ""
    # Frames, by letters that say where x, y and z point.
    world: str = word("enu", *WORLDS, meaning="world: enu (z up), ned (z down), eus (y up), others")
    body: str = word("flu", *BODIES, meaning="body: flu (z along the thrust), frd, lbu, others")
    # of the board to the left, about the thrust, against the rotors' places [deg]
    board_turn: float = number(0.0, "deg", -180.0, 180.0)
    # when a row's command acts: held_after (from this row to the next) | held_before (until this
    # row) | averaged (its mean over the interval after this row) | sampled (of one that changes in
    # between, as in a thinned log) | unknown
    command: str = word("unknown", *TIMINGS)
    start: float = number(0.0, "s", 0.0)  # of the part to import, from the first attitude
    stop: float = number(0.0, "s", 0.0)  # its end; 0: the end of the log
    # of the rows, 4 to 20 000; 0: that of the fastest signal, at most 500 [Hz]
    rate: float = 0.0
    # the column of times, where the format does not know it
    time: Source = dc.field(default_factory=Source)
    position: Source = dc.field(default_factory=Source)  # 3 columns
    # 3 columns, of the world unless `axes: body`
    velocity: Source = dc.field(default_factory=Source)
    # 4 columns of a quaternion, or 3: roll, pitch, yaw
    attitude: Source = dc.field(default_factory=Source)
    rates: Source = dc.field(default_factory=Source)  # 3 columns, of the body unless `axes: world`
    acceleration: Source = dc.field(default_factory=Source)  # 3 columns
    angular_acceleration: Source = dc.field(default_factory=Source)  # 3 columns
    thrust: Source = dc.field(default_factory=Source)  # 1 column, collective
    torque: Source = dc.field(default_factory=Source)  # 3 columns
    rotor_speed: Source = dc.field(default_factory=Source)  # 4 columns, in the vehicle file's order
    # 1 column (collective), 4 (rotors), or 6 or 8, of which the collective is taken
    throttle: Source = dc.field(default_factory=Source)
    hover_throttle: Source = dc.field(default_factory=Source)  # 1 column: the throttle that hovers
    voltage: Source = dc.field(default_factory=Source)  # 1 column, of the battery
    # 3 columns: body rates that an autopilot was asked for
    commanded_rates: Source = dc.field(default_factory=Source)

    def frames(self, source: Source) -> tuple[str, str]:
        """Return the frames W and B of one of its quantities."""
        return source.world or self.world, source.body or self.body

    def sources(self) -> Iterator[tuple[str, Source]]:
        """Yield name and source of every quantity that the log holds."""
        for name in SIZES:
            source = getattr(self, name)
            if source:
                yield name, source

    @property
    def in_body(self) -> bool:
        """Whether it names a gyro and an accelerometer that read in body axes."""
        rates = self.rates
        force = self.acceleration
        axes = {rates.axes_of("rates"), force.axes_of("acceleration")}
        return bool(rates and force) and force.kind != "acceleration" and axes == {"body"}

    @property
    def tells_motion(self) -> bool:
        """Whether it names attitude and any motion of the centre, or what both can be integrated
        from.
        """
        return self.in_body or bool(
            self.attitude and (self.position or self.velocity or self.acceleration)
        )

    def names(self) -> list[str]:
        """Return the names of all columns that are used, the time among them."""
        return [
            *self.time.columns,
            *[column for _, source in self.sources() for column in source.columns],
        ]

    def check(self) -> "LogMap":
        """Return self after checking all fields.

        Raises: ValueError: one line with field, value and what it may be.
        """
        check_fields(self, "LogMap")
        require(
            self.rate == 0 or RATES[0] <= self.rate <= RATES[1],
            f"LogMap: rate must be 0, or {RATES[0]:g} … {RATES[1]:g} Hz; got {self.rate:g}.",
        )
        if self.time:
            _check_source("time", self.time, (1,))
        for name, source in self.sources():
            _check_source(name, source, SIZES[name])
        return self


@dc.dataclass(frozen=True)
class MapFile:
    """A map as its file names it: values, and the fields that the file names, with the options of
    each quantity.
    """

    values: LogMap
    named: Mapping[str, tuple[str, ...]]

    def over(self, log_map: LogMap | None) -> LogMap:
        """Return the map of a log: a file without a position amends what the format's own names
        tell (`own`).
        """
        if log_map is None or "position" in self.named:
            return self.values
        for name, options in self.named.items():
            value = getattr(self.values, name)
            if options and not value.columns:  # options of columns that the format names
                value = dc.replace(
                    getattr(log_map, name), **{option: getattr(value, option) for option in options}
                )
            log_map = dc.replace(log_map, **{name: value})
        return log_map


def load_map_file(name: str | Path) -> MapFile:
    """Read a map of a log (YAML) or the preset of that name, and which fields it names.

    Raises: ValueError: one line with file and field, on bad content.
    """
    presets = sorted(path.stem for path in PRESETS.glob("*.yaml"))  # of public data sets
    path = (
        PRESETS / f"{name}.yaml"
        if str(name) in presets and not Path(name).is_file()
        else Path(name)
    )
    require(
        path.exists() or path.suffix,
        f"log map {name}: must be a file, or the preset of a data set: {', '.join(presets)}.",
    )
    values = load_checked(LogMap, path, "log map")
    return MapFile(
        values,
        {k: tuple(v) if isinstance(v, dict) else () for k, v in (read_yaml(path) or {}).items()},
    )


def _check_source(name: str, source: Source, known: tuple[int, ...]) -> None:
    count = len(source.columns)
    usual = next(iter(UNITS[name]))
    if count not in known:
        sizes = " or ".join(map(str, known))
        raise ValueError(f"LogMap: {name} must name {sizes} columns; got {count}.")
    check_fields(source, f"LogMap: {name}")
    pairs = list(zip(source.ends[::2], source.ends[1::2], strict=False))
    signs = [abs(sign) for sign in source.signs]
    checks = [
        (
            f"unit must be one of {', '.join(UNITS[name])}; got {source.unit!r}",
            source.unit in ("", *UNITS[name]),
        ),
        (
            f"signs must be 1 or -1 for each column, as [1, -1, 1]; got {source.signs} for "
            f"{count} columns",
            not signs or signs == [1.0] * count,
        ),
        (f"scale must be finite and not zero; got {source.scale}", 0 < abs(source.scale) < 1e12),
        (
            "ends must be the readings of a throttle at 0 and at 1, once or for every column; got "
            f"{source.ends}",
            not source.ends
            or (
                name in ("throttle", "hover_throttle")
                and len(source.ends) in (2, 2 * count)
                and all(abs(low) < 1e6 and low < high < 1e6 for low, high in pairs)
            ),
        ),
        (
            f"pole_pairs must be 1 to {MOST_POLE_PAIRS} with unit: erpm, and 0 with any other; got "
            f"{source.pole_pairs} with unit: {source.unit or usual}. It is half the count of the "
            "magnets of a motor",
            (source.unit == "erpm") == bool(source.pole_pairs)
            and 0 <= source.pole_pairs <= MOST_POLE_PAIRS,
        ),
        (f"late must be within 10 s; got {source.late}", abs(source.late or 0.0) <= 10),
    ]
    for what, holds in checks:
        require(holds, f"LogMap: {name}: {what}.")


NED_TO_ENU = axes_of_word("ned")
FRD_TO_FLU = np.diag(axes_of_word("frd"))
Q_WORLD = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])  # of NED_TO_ENU
Q_BODY = np.array([0.0, 1.0, 0.0, 0.0])  # of FRD_TO_FLU
Values = Mapping[str, np.ndarray]


@cache
def _turn(word: str, angle: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return matrix (3, 3) and quaternion (4,) from a frame of a log, turned about z [deg], to
    ours.
    """
    rotation = scipy.spatial.transform.Rotation
    R = rotation.from_euler("z", angle, degrees=True) * rotation.from_matrix(axes_of_word(word))
    return R.as_matrix(), np.roll(R.as_quat(), 1)


def convert(raw: Values, log_map: LogMap) -> dict[str, np.ndarray]:
    """Return quantities (n, k) in SI units and our frames.

    position, velocity: in W [m, m/s].
    attitude: (n, 4) w, x, y, z, body to W.
    rates, angular_acceleration, torque: in B [rad/s, rad/s², N·m].
    acceleration: dv/dt in W without gravity [m/s²].
    thrust [N] or, with unit `weight`, over the weight [1].
    rotor_speed [rad/s].
    throttle: 0 … 1; unit `us`: of 1000 … 2000 µs.

    Args:
        raw: (n, k) columns of a log at common times, by quantity.
    """
    q = convert_quantity("attitude", raw["attitude"], log_map) if "attitude" in raw else None
    return ({} if q is None else {"attitude": q}) | {
        name: convert_quantity(name, values, log_map, q)
        for name, values in raw.items()
        if name != "attitude"
    }


def convert_quantity(
    name: str, values: np.ndarray, log_map: LogMap, q: np.ndarray | None = None
) -> np.ndarray:
    """Return one quantity (n, k) as `convert` does.

    Args:
        values: (n, k) of the log.
        q: (n, 4) attitude at its times, where it has to be turned between W and B.
    """
    source = getattr(log_map, name)
    scaled = values * (source.scale * UNITS[name].get(source.unit, 1.0) / (source.pole_pairs or 1))
    if source.signs:
        scaled = scaled * source.signs
    if name in ("throttle", "hover_throttle") and (source.ends or source.unit == "us"):
        low, high = np.reshape(source.ends or (1000.0, 2000.0), (-1, 2)).T
        return (values * source.scale - low) / (high - low)
    if name == "attitude":
        return _attitude(scaled, source, log_map)
    return _turned(name, scaled, q, log_map) if SIZES[name] == (3,) else scaled


def _attitude(values: np.ndarray, source: Source, log_map: LogMap) -> np.ndarray:
    """Return w, x, y, z from body to W, of unit norm where the log's norm is not zero."""
    if values.shape[1] == 3:  # turns about z, then y, then x, in body axes
        x, y, z = (
            attitude.from_rotation_vector(angle[:, None] * axis)
            for angle, axis in zip(values.T, np.eye(3), strict=True)
        )
        q = attitude.multiply(z, attitude.multiply(y, x))
    else:
        q = values if source.order == "wxyz" else np.roll(values, 1, axis=1)
        q = q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1e-9)
    if source.direction == "world_to_body":
        q = q * [1.0, -1.0, -1.0, -1.0]
    world, body = log_map.frames(source)
    q_W = _turn(world)[1]
    q_B = _turn(body, log_map.board_turn)[1]
    return attitude.multiply(attitude.multiply(q_W, q), attitude.conjugate(q_B))


def _turned(name: str, values: np.ndarray, q: np.ndarray | None, log_map: LogMap) -> np.ndarray:
    """Return a vector in the axes of its quantity: W for position, velocity and acceleration, B for
    the others.
    """
    source = getattr(log_map, name)
    world, body = log_map.frames(source)
    axes = source.axes_of(name)
    frame = _turn(world) if axes == "world" else _turn(body, log_map.board_turn)
    values = values @ frame[0].T
    if source.is_turned(name) and q is not None:
        values = attitude.rotate(q, values) if axes == "body" else attitude.rotate_back(q, values)
    if name == "acceleration" and source.kind != "acceleration":
        values = values - [0.0, 0.0, GRAVITY]
    return values
