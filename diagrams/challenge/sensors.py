"""From an exact log to what ideal (`clean`), real or ill-calibrated (`wild`) sensors would have
logged, and what its input columns hold.

Every figure of `wild` is drawn from three times the range of `real`: log-uniform from a third of
the lower bound to three times the upper one, signed figures within three times their bounds. A
constant of `real` counts as a range without width.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import signal

from np_drake import attitude
from np_drake.effects.base import Effect
from np_drake.effects.library import unobservable
from np_drake.effects.mass_error import MassError
from np_drake.effects.parameter import log_uniform
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.flight_log import FlightLog
from np_drake.logs.import_sheet import Sheet
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle.vehicle import INPUTS, MeasurementNoise, Vehicle

CLEAN, REAL, WILD = QUALITIES = ("clean", "real", "wild")
JITTER = 0.05  # of the instants, of the interval [1]
RATE = 100.0  # rows a second [Hz]
WIDER = 3.0  # the range of `wild` over that of `real`, to either side [1]
RATES = (50.0, 500.0)  # of `wild` [Hz]
LONGEST_DROP = 3  # rows of `wild` that are lost in succession; one in `real`
WANDER = (0.35, 0.65)  # of `real` [deg]
# Ranges of `real`, in the units of `SensorQuality`.
RANGES = {
    "attitude": (0.005, 0.010),
    "wander": (np.deg2rad(WANDER[0]), np.deg2rad(WANDER[1])),
    "wander_time": (5.0, 20.0),
    "velocity_wander": (0.02, 0.04),
    "velocity_time": (0.5, 2.0),
    "rate_flicker": (0.006, 0.015),
    "acceleration_flicker": (0.05, 0.12),
    "drops": (0.005, 0.01),
    "jitter": (JITTER, JITTER),
}
ROTOR = 0.01  # of the speed in hover [1]
OFF = 0.01  # of mass and thrust, to either side [1]
SEMANTICS = ("held_after", "held_before", "averaged", "sampled")  # of a row's command
FINER = 2  # commands in an interval of rows, where a row does not hold one command [1]
THROTTLE = 0.6  # exponent of the throttle over thrust [1]
# What the log states of the time at which a row's command acts: its deviation over the interval of
# rows [1]. Source: as np_drake.logs.importing, but that a mean over the interval acts somewhere in
# it; that the command acted before its row is not known, for who knows it shifts the commands.
TIMING = {"held_after": 0.0, "held_before": 0.5, "averaged": 12**-0.5, "sampled": 12**-0.5}
# Effects that are a shift of the commands' time, which only a log of held commands tells.
COMMAND_TIME = ("command_delay", "clock_offset")
# Out-of-library effects that the map of an input absorbs: the exponent of a throttle is fitted to
# the flight.
ABSORBED = {"normalised": ("bent_thrust_curve",)}


@dc.dataclass(frozen=True)
class SensorQuality:
    """The sensors of one case; `clean` has white noise as the vehicle file states and a constant
    rate.

    `wild` has other white noise than the vehicle file states, which is that of `real`. Deviations
    of white noise, RMS of the coloured part, correlation times [s]. Source: own choice, the size of
    motion capture, MEMS sensors and a Kalman filter's velocity.
    """

    name: str = CLEAN
    attitude: float = 0.0  # white [rad]
    wander: float = 0.0  # RMS [rad]
    wander_time: float = 10.0
    velocity_wander: float = 0.0  # [m/s]
    velocity_time: float = 1.0
    rate_flicker: float = 0.0  # [rad/s]
    acceleration_flicker: float = 0.0  # [m/s²]
    rotor: float = 2.0  # [rad/s]; negative: no rotor columns
    drops: float = 0.0  # share of rows that are missing [1]
    turned: bool = False  # `a` was turned to W with the measured attitude
    mass_off: float = 0.0  # of the vehicle file [1]
    thrust_off: float = 0.0
    jitter: float = JITTER  # of the instants, of the interval; of real sensors [1]
    rate: float = RATE  # [Hz]
    longest_drop: int = 1  # rows that are lost in succession
    # White noise besides the attitude's; None: as the vehicle file states.
    white: MeasurementNoise | None = None

    @property
    def real(self) -> bool:
        """Return whether the sensors are no ideal ones."""
        return self.name != CLEAN

    def background(self, vehicle: Vehicle) -> list[Effect]:
        """Return what the vehicle file is off by; it acts throughout and is no cause."""
        if not self.real:
            return []
        return [MassError(self.mass_off * vehicle.mass), ThrustScale(1 + self.thrust_off)]

    def stated_noise(self) -> MeasurementNoise:
        """Return the white noise that the vehicle file states."""
        return MeasurementNoise(attitude=0.005) if self.real else MeasurementNoise()

    def stated_uncertainty(self) -> dict[str, float]:
        """Return what the vehicle file of `wild` states of how well mass and thrust are known, by
        field: the standard deviation of the uniform error that is drawn [1].
        """
        if self.name != WILD:
            return {}
        return dict.fromkeys(
            ("mass_uncertainty", "thrust_uncertainty"), round(WIDER * OFF / np.sqrt(3.0), 4)
        )

    def instants(self, rng: np.random.Generator, seconds: float) -> np.ndarray:
        """Return the times (n,) of the rows of a flight of that length [s]."""
        t = np.arange(round(seconds * self.rate)) / self.rate
        return t + (self.jitter / self.rate * rng.uniform(-1, 1, len(t)) if self.real else 0.0)


def draw_sensor_quality(name: str, rng: np.random.Generator, spin: float) -> SensorQuality:
    """Draw sensors of a quality of `QUALITIES`; `spin` is the rotor speed in hover [rad/s].

    Rotor columns are there in half of the cases.
    """
    if name == CLEAN:
        return SensorQuality()
    if name == WILD:
        stated = dc.asdict(SensorQuality(REAL).stated_noise())
        white = {name: _wider(rng, x, x) for name, x in stated.items() if name != "attitude"}
        return SensorQuality(
            name=WILD,
            **{figure: _wider(rng, *bounds) for figure, bounds in RANGES.items()},
            rotor=_wider(rng, ROTOR * spin, ROTOR * spin) * float(rng.choice([1.0, -1.0])),
            turned=bool(rng.integers(2)),
            mass_off=rng.uniform(-WIDER * OFF, WIDER * OFF),
            thrust_off=rng.uniform(-WIDER * OFF, WIDER * OFF),
            rate=log_uniform(rng, *RATES),
            longest_drop=LONGEST_DROP,
            white=MeasurementNoise(**white),
        )
    return SensorQuality(
        name=REAL,
        attitude=rng.uniform(*RANGES["attitude"]),
        wander=np.deg2rad(rng.uniform(*WANDER)),
        wander_time=rng.uniform(*RANGES["wander_time"]),
        velocity_wander=rng.uniform(*RANGES["velocity_wander"]),
        velocity_time=rng.uniform(*RANGES["velocity_time"]),
        rate_flicker=rng.uniform(*RANGES["rate_flicker"]),
        acceleration_flicker=rng.uniform(*RANGES["acceleration_flicker"]),
        rotor=float(rng.choice([ROTOR * spin, -1.0])),
        drops=rng.uniform(*RANGES["drops"]),
        turned=bool(rng.integers(2)),
        mass_off=rng.uniform(-OFF, OFF),
        thrust_off=rng.uniform(-OFF, OFF),
    )


def _wider(rng: np.random.Generator, low: float, high: float) -> float:
    return log_uniform(rng, low / WIDER, WIDER * high)


def kept_rows(rng: np.random.Generator, quality: SensorQuality, n: int) -> np.ndarray:
    """Return the rows (m,) of n that are not dropped, never the first or last.

    Up to `longest_drop` are dropped in succession, two kept at least between one loss and the next.
    """
    count, longest = round(quality.drops * n), quality.longest_drop
    dropped: set[int] = set()
    while len(dropped) < count:
        row = int(rng.integers(2, n - 1 - longest))
        lost = min(int(rng.integers(1, longest + 1)), count - len(dropped)) if longest > 1 else 1
        if not set(range(row - 2, row + lost + 2)) & dropped:
            dropped |= set(range(row, row + lost))
    return np.setdiff1d(np.arange(n), sorted(dropped))


def gauss_markov(
    rng: np.random.Generator, t: np.ndarray, channels: int, *, rms: float, tau: float
) -> np.ndarray:
    """Draw a first-order process (n, channels) at times t (n,) with correlation time `tau` [s],
    which starts in its stationary distribution; the median step stands for all.
    """
    # Exact discretisation of dx = -x / tau dt + noise: an AR(1) process with decay exp(-step /
    # tau).
    decay = np.exp(-float(np.median(np.diff(t))) / tau)
    white = rng.normal(size=(len(t), channels))
    white[1:] *= np.sqrt(1 - decay**2)
    return rms * signal.lfilter([1.0], [1.0, -decay], white, axis=0)


def flicker(rng: np.random.Generator, t: np.ndarray, channels: int, *, rms: float) -> np.ndarray:
    """Draw noise (n, channels) of about 1/f from 0.02 to 10 Hz: Gauss-Markov processes of equal
    power a decade.
    """
    taus = (0.016, 0.16, 1.6, 8.0)  # [s]
    parts = [gauss_markov(rng, t, channels, rms=rms / np.sqrt(len(taus)), tau=tau) for tau in taus]
    return np.sum(parts, axis=0)


def with_sensor_noise(
    log: FlightLog, vehicle: Vehicle, quality: SensorQuality, rng: np.random.Generator
) -> FlightLog:
    """Return an exact log with sensor noise; every sensor has draws of its own.

    The accelerometer reads R^T (a + g z) + n in body axes; it comes to W with the true attitude or,
    where `turned`, with the measured one.
    """
    if log.a is None or log.al is None or log.rotor is None:
        raise ValueError("measured: the exact log must have accelerations and rotor speed.")
    white, n = quality.white or vehicle.measurement_noise, len(log)
    parts = rng.spawn(7)
    draw = [part.normal(size=(n, 3)) for part in parts[:6]]
    turn = quality.attitude * draw[0]
    v, w = white.velocity * draw[1], white.rate * draw[2]
    n_B = white.acceleration * draw[3]
    if quality.real:
        turn += gauss_markov(parts[0], log.t, 3, rms=quality.wander, tau=quality.wander_time)
        v += gauss_markov(
            parts[1], log.t, 3, rms=quality.velocity_wander, tau=quality.velocity_time
        )
        w += flicker(parts[2], log.t, 3, rms=quality.rate_flicker)
        n_B += flicker(parts[3], log.t, 3, rms=quality.acceleration_flicker)
    small = np.concatenate([np.ones((n, 1)), 0.5 * turn], axis=1)  # rotation, to first order
    q = attitude.multiply(log.q, small)
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    g = np.array([0.0, 0.0, vehicle.gravity])
    specific = attitude.rotate_back(log.q, log.a + g) + n_B
    rotor = None if quality.rotor < 0 else log.rotor + quality.rotor * parts[6].normal(size=(n, 4))
    return dc.replace(
        log,
        p=log.p + white.position * draw[5],
        q=q,
        v=log.v + v,
        w=log.w + w,
        a=attitude.rotate(q if quality.turned else log.q, specific) - g,
        al=None if quality.real else log.al + white.angular_acceleration * draw[4],
        rotor=rotor,
    )


def rows_of(log: FlightLog, rows: np.ndarray) -> FlightLog:
    """Return the log with these rows alone."""
    arrays = {f.name: getattr(log, f.name) for f in dc.fields(log)}
    cut = {name: value[rows] for name, value in arrays.items() if isinstance(value, np.ndarray)}
    return dc.replace(log, **cut)


@dc.dataclass(frozen=True)
class LoggedInput:
    """The input of one case's logs.

    kind: as `FlightLog.input`.
    semantics: `held_after` (a row's command acts until the next row), `held_before` (it acted until
        this row, the log lags by one row), `averaged` (mean over the interval after the row),
        `sampled` (one of the commands in it).
    late: which of the commands in an interval is sampled, 0 … FINER - 1.
    """

    kind: str = "command"
    semantics: str = "held_after"
    late: int = 0

    @property
    def finer(self) -> int:
        """Return how many commands act in an interval of rows [1]."""
        return 1 if self.semantics.startswith("held") else FINER

    @property
    def held(self) -> bool:
        """Return whether the log holds commands that act from their row to the next."""
        return self.semantics == "held_after" and self.kind != "rotor_speed"

    def timing(self, step: float) -> float:
        """Return the deviation of the time at which a row's command acts, as a log with this
        interval of rows states it; zero where the input is no command [s].
        """
        return 0.0 if self.kind == "rotor_speed" else round(TIMING[self.semantics] * step, 6)

    def sheet(self, step: float) -> Sheet | None:
        """Return what lies beside a log with this interval of rows [s]: the uncertainty of its
        commands' time; None: nothing.
        """
        timing = self.timing(step)
        meaning = "unknown" if self.semantics == "held_before" else self.semantics
        return Sheet(timing, {"command": meaning}) if timing > 0 else None

    def instants(self, t: np.ndarray) -> np.ndarray:
        """Return the times (n * finer,) at which a command is given, of rows at t (n,) [s]."""
        if self.finer == 1:
            return t
        after = np.append(t, 2 * t[-1] - t[-2])
        return np.interp(np.arange(len(t) * self.finer) / self.finer, np.arange(len(after)), after)


def draw_logged_input(rng: np.random.Generator, names: Sequence[str]) -> LoggedInput:
    """Draw the input of a case's logs among those that can tell its effects."""
    hidden = {kind: {*unobservable(kind), *ABSORBED.get(kind, ())} for kind in INPUTS}
    kind = str(rng.choice([kind for kind in INPUTS if not hidden[kind] & set(names)]))
    timed = bool(set(COMMAND_TIME) & set(names))
    semantics = str(rng.choice(SEMANTICS[:1] if timed else SEMANTICS))
    return LoggedInput(kind, semantics, int(rng.integers(FINER)) if semantics == "sampled" else 0)


def as_logged(log: FlightLog, semantics: str, finer: int, late: int = 0) -> FlightLog:
    """Return every `finer`-th row, with a command as these semantics of `LoggedInput` log it."""
    u, rows = log.u, np.arange(0, len(log), finer)
    if semantics == "held_before":
        u = np.concatenate([u[:1], u[:-1]])
    if semantics == "averaged":
        u = np.stack([np.roll(u, -i, axis=0) for i in range(finer)]).mean(axis=0)
    if semantics == "sampled":
        u = np.roll(u, -late, axis=0)
    return rows_of(dc.replace(log, u=u), rows)


def with_input(log: FlightLog, vehicle: Vehicle, kind: str) -> FlightLog:
    """Return the log with one kind of input (`FlightLog.input`), as a file is to hold it."""
    if kind == "command":
        return log
    if kind == "rotor_speed":
        return dc.replace(log, input=kind)
    log = dc.replace(log, rotor=None, input=kind)
    if kind == "thrust_only":
        return dc.replace(log, u=np.column_stack([log.u[:, 0], np.full((len(log), 3), np.nan)]))
    share = np.maximum(log.u @ vehicle.unmixer.T, 0.0) / vehicle.max_rotor_thrust
    return dc.replace(log, throttle=share**THROTTLE)


def best_known(log: FlightLog, command: np.ndarray, vehicle: Vehicle, kind: str) -> FlightLog:
    """Return the log with the input of the true model, which knows all commands (n, 4) and no
    rotor's speed [N, N·m].

    Where rotor speed is the input it is what the log measures. A throttle's scale and exponent are
    known; a torque that the file does not hold is not.
    """
    log = dc.replace(log, u=command, throttle=None, input="command")
    if kind == "rotor_speed":
        return with_rotor_input(log, vehicle)
    return with_input(log, vehicle, kind) if kind == "thrust_only" else log
