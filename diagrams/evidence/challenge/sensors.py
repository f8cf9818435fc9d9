"""From an exact log to what ideal (`clean`) or real sensors would have logged."""

import dataclasses as dc

import numpy as np
import scipy

from np_drake import attitude
from np_drake.effects.base import Effect
from np_drake.effects.mass_error import MassError
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.flight_log import FlightLog
from np_drake.vehicle.vehicle import Vehicle

CLEAN, REAL = QUALITIES = ("clean", "real")
RATE = 100.0  # rows a second [Hz]
JITTER = 0.05  # of the instants of real sensors, of the interval [1]
ROTOR = 0.01  # of the speed in hover [1]
OFF = 0.01  # of mass and thrust, to either side [1]


@dc.dataclass(frozen=True)
class SensorQuality:
    """The sensors of one case; `clean` has white noise as the vehicle file states and a constant
    rate.

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

    @property
    def real(self) -> bool:
        """Return whether the sensors are no ideal ones."""
        return self.name != CLEAN

    def background(self, vehicle: Vehicle) -> list[Effect]:
        """Return what the vehicle file is off by; it acts throughout and is no cause."""
        if not self.real:
            return []
        return [MassError(self.mass_off * vehicle.mass), ThrustScale(1 + self.thrust_off)]

    def instants(self, rng: np.random.Generator, seconds: float) -> np.ndarray:
        """Return the times (n,) of the rows of a flight of that length [s]."""
        t = np.arange(round(seconds * RATE)) / RATE
        return t + (JITTER / RATE * rng.uniform(-1, 1, len(t)) if self.real else 0.0)


def draw_sensor_quality(name: str, rng: np.random.Generator, spin: float) -> SensorQuality:
    """Draw sensors of a quality of `QUALITIES`; `spin` is the rotor speed in hover [rad/s].

    Rotor columns are there in half of the cases.
    """
    if name == CLEAN:
        return SensorQuality()
    return SensorQuality(
        name=REAL,
        attitude=rng.uniform(0.005, 0.010),
        wander=np.deg2rad(rng.uniform(0.35, 0.65)),
        wander_time=rng.uniform(5.0, 20.0),
        velocity_wander=rng.uniform(0.02, 0.04),
        velocity_time=rng.uniform(0.5, 2.0),
        rate_flicker=rng.uniform(0.006, 0.015),
        acceleration_flicker=rng.uniform(0.05, 0.12),
        rotor=float(rng.choice([ROTOR * spin, -1.0])),
        drops=rng.uniform(0.005, 0.01),
        turned=bool(rng.integers(2)),
        mass_off=rng.uniform(-OFF, OFF),
        thrust_off=rng.uniform(-OFF, OFF),
    )


def kept_rows(rng: np.random.Generator, quality: SensorQuality, n: int) -> np.ndarray:
    """Return the rows (m,) of n that are not dropped, never the first or last; two are kept at
    least between one loss and the next.
    """
    count = round(quality.drops * n)
    dropped: set[int] = set()
    while len(dropped) < count:
        row = int(rng.integers(2, n - 2))
        if not set(range(row - 2, row + 3)) & dropped:
            dropped.add(row)
    return np.setdiff1d(np.arange(n), sorted(dropped))


def gauss_markov(rng: np.random.Generator, t: np.ndarray, *, rms: float, tau: float) -> np.ndarray:
    """Draw a first-order process (n, 3) at times t (n,) with correlation time `tau` [s],
    which starts in its stationary distribution; the median step stands for all.
    """
    # Exact discretisation of dx = -x / tau dt + noise: an AR(1) process with decay exp(-step /
    # tau).
    decay = np.exp(-float(np.median(np.diff(t))) / tau)
    white = rng.normal(size=(len(t), 3))
    white[1:] *= np.sqrt(1 - decay**2)
    return rms * scipy.signal.lfilter([1.0], [1.0, -decay], white, axis=0)


def flicker(rng: np.random.Generator, t: np.ndarray, *, rms: float) -> np.ndarray:
    """Draw noise (n, 3) of about 1/f from 0.02 to 10 Hz: Gauss-Markov processes of equal
    power a decade.
    """
    taus = (0.016, 0.16, 1.6, 8.0)  # [s]
    parts = [gauss_markov(rng, t, rms=rms / np.sqrt(len(taus)), tau=tau) for tau in taus]
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
    white = vehicle.measurement_noise
    n = len(log)
    parts = rng.spawn(7)
    draw = [part.normal(size=(n, 3)) for part in parts[:6]]
    turn = quality.attitude * draw[0]
    turn += gauss_markov(parts[0], log.t, rms=quality.wander, tau=quality.wander_time)
    v = white.velocity * draw[1]
    v += gauss_markov(parts[1], log.t, rms=quality.velocity_wander, tau=quality.velocity_time)
    w = white.rate * draw[2] + flicker(parts[2], log.t, rms=quality.rate_flicker)
    n_B = white.acceleration * draw[3]
    n_B += flicker(parts[3], log.t, rms=quality.acceleration_flicker)
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
