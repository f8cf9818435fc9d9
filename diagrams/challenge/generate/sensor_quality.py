"""Sensor quality: from an exact log to what ideal (`clean`), real or ill-calibrated (`wild`)
sensors would have logged.

Every figure of `wild` is drawn from three times the range of `real`: log-uniform from a third of
the lower bound to three times the upper one, signed figures within three times their bounds. A
constant of `real` counts as a range without width.
"""

import dataclasses as dc

import numpy as np

from diagrams.challenge.simulators.coloured_noise import flicker, gauss_markov
from np_drake import attitude
from np_drake.effects.base import Effect
from np_drake.effects.mass_error import MassError
from np_drake.effects.parameter import log_uniform
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.flight_log import FlightLog
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle

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
DIGITS = 4  # of an uncertainty in a vehicle file


@dc.dataclass(frozen=True)
class SensorQuality:
    """The sensors of one case; `clean` has white noise as the vehicle file states and a constant
    rate.

    `wild` has other white noise than the vehicle file states, which is that of `real`.

    Deviations of white noise, RMS of the coloured part, correlation times [s]. Source: own choice,
    the size of motion capture, MEMS sensors and a Kalman filter's velocity.
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
    white: MeasurementNoise | None = (
        None  # besides the attitude's; None: as the vehicle file states
    )

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
        """Return what the vehicle file states of how well mass and thrust are known, by field [1].

        `wild`: the standard deviation of the uniform error that is drawn; others state nothing.
        """
        if self.name != WILD:
            return {}
        deviation = round(WIDER * OFF / np.sqrt(3.0), DIGITS)
        return {"mass_uncertainty": deviation, "thrust_uncertainty": deviation}

    def instants(self, rng: np.random.Generator, seconds: float) -> np.ndarray:
        """Return the times (n,) of the rows [s].

        Args:
            seconds: length of the flight [s].
        """
        t = np.arange(round(seconds * self.rate)) / self.rate
        return t + (self.jitter / self.rate * rng.uniform(-1, 1, len(t)) if self.real else 0.0)


def draw_sensor_quality(name: str, rng: np.random.Generator, spin: float) -> SensorQuality:
    """Draw sensors of a quality.

    Args:
        name: one of `QUALITIES`.
        spin: rotor speed in hover [rad/s].
    """
    if name == CLEAN:
        return SensorQuality()
    if name == WILD:
        return _draw_ill_calibrated(rng, spin)
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


def _draw_ill_calibrated(rng: np.random.Generator, spin: float) -> SensorQuality:
    """Draw every figure from three times the range of `real`; rotor columns are there in half of
    the cases.
    """
    stated = dc.asdict(SensorQuality(REAL).stated_noise())
    white = {
        name: _wider(rng, value, value) for name, value in stated.items() if name != "attitude"
    }
    return SensorQuality(
        name=WILD,
        **{name: _wider(rng, *bounds) for name, bounds in RANGES.items()},
        rotor=_wider(rng, ROTOR * spin, ROTOR * spin) * float(rng.choice([1.0, -1.0])),
        turned=bool(rng.integers(2)),
        mass_off=rng.uniform(-WIDER * OFF, WIDER * OFF),
        thrust_off=rng.uniform(-WIDER * OFF, WIDER * OFF),
        rate=log_uniform(rng, *RATES),
        longest_drop=LONGEST_DROP,
        white=MeasurementNoise(**white),
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


def with_sensor_noise(
    log: FlightLog, vehicle: Vehicle, quality: SensorQuality, rng: np.random.Generator
) -> FlightLog:
    """Return a log with sensor noise; every sensor has draws of its own.

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
    q = _rotated_by(log.q, turn)
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


def _rotated_by(q: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return q (n, 4) after a rotation (n, 3) in body axes [rad], to first order."""
    small = np.concatenate([np.ones((len(turn), 1)), 0.5 * turn], axis=1)
    out = attitude.multiply(q, small)
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def rows_of(log: FlightLog, rows: np.ndarray) -> FlightLog:
    """Return the log with these rows alone."""
    arrays = {f.name: getattr(log, f.name) for f in dc.fields(log)}
    cut = {name: value[rows] for name, value in arrays.items() if isinstance(value, np.ndarray)}
    return dc.replace(log, **cut)
