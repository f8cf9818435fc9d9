"""Smoothed attitude, accelerations and velocities of a flight, which enter as regressors.

The attitude is smoothed by a complementary filter of integrated gyro rates and readings.
"""

import dataclasses as dc
from functools import cached_property

import numpy as np
import scipy

from np_drake import attitude
from np_drake.estimation.noise import white_noise
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.signals import Signal
from np_drake.rigid_body import P, Q, W
from np_drake.vehicle import Vehicle

REGRESSOR_BAND = 8.0  # low-pass on accelerations that enter as regressors [Hz]; own choice
RINGING = (0.5, 1.5)  # band in which payloads resonate [Hz]
# initial ratio of accelerometer error to white noise in that band [1]: flicker of a MEMS sensor
REDDER = 3.0
# least noise of an accelerometer [m/s²]; avoids a division by zero
LEAST_ACCELEROMETER_NOISE = 1e-6


@dc.dataclass(frozen=True)
class Instants:
    """States of a flight at the instants t (n,) [s]: x (n, 13) of Bo.

    a (n, 3) in W [m/s²] and al (n, 3) in B [rad/s²] are smoothed accelerations, for use as
    regressors.
    """

    t: np.ndarray
    x: np.ndarray
    a: np.ndarray
    al: np.ndarray

    @property
    def q(self) -> np.ndarray:
        """(n, 4) attitude quaternion (w, x, y, z)."""
        return self.x[:, Q]

    @cached_property
    def R_WB(self) -> np.ndarray:
        """(n, 3, 3) attitude as rotation matrices."""
        return attitude.rotation_matrix(self.q)

    @cached_property
    def sweep(self) -> np.ndarray:
        """(n, 3, 3) matrix that maps p_BoP_B [m] to the velocity of P relative to Bo, in W
        [1/s].
        """
        return self.R_WB @ attitude.skew(self.x[:, W])

    @cached_property
    def lever(self) -> np.ndarray:
        """(n, 3, 3) matrix that maps p_BoP_B [m] to the acceleration of P relative to Bo, in W
        [1/s²].
        """
        turning = attitude.skew(self.x[:, W])
        return self.R_WB @ (attitude.skew(self.al) + turning @ turning)


def make_instants(log: FlightLog, smooth: np.ndarray) -> tuple[Instants, Instants]:
    """Return the states at the rows of a log (without accelerations: its middles) and at the
    middles between them.

    Args:
        smooth: (n, 4) smoothed attitude at the rows.
    """
    dt = np.diff(log.t)[:, None]
    step = log.step
    t_mid = 0.5 * (log.t[1:] + log.t[:-1])
    al = low_pass(np.diff(log.w, axis=0) / dt, step, REGRESSOR_BAND)
    x = np.concatenate([log.p, smooth, log.v, log.w], axis=1)
    x_mid = 0.5 * (x[1:] + x[:-1])
    x_mid[:, Q] = attitude.normalised(x_mid[:, Q])
    if log.a is None:
        rate = np.diff(log.v, axis=0) / dt
        a = low_pass(_corrected_acceleration(t_mid, x_mid[:, P], rate), step, REGRESSOR_BAND)
        mids = Instants(t_mid, x_mid, a, al)
        return mids, mids
    a = low_pass(_corrected_acceleration(log.t, log.p, log.a), step, REGRESSOR_BAND)
    return (
        Instants(log.t, x, a, Signal(t_mid, al).linear(log.t)),
        Instants(t_mid, x_mid, a[:-1], al),
    )


def low_pass(values: np.ndarray, step: float, band: float, pad: float = 2.0) -> np.ndarray:
    """Apply a zero-phase second-order Butterworth low-pass to each column.

    Args:
        values: (n, m) samples.
        step: sample interval [s].
        band: cut-off frequency [Hz].
        pad: length by which either end is continued [1 / band].
    Returns: (n, m) filtered samples; `values` unchanged where the band reaches the sampling limit
        or rows are fewer than 20.
    """
    if band >= 0.45 / step or len(values) < 20:
        return values
    sos = scipy.signal.butter(2, band * 2 * step, output="sos")
    return scipy.signal.sosfiltfilt(
        sos, values, axis=0, padlen=min(len(values) - 1, int(pad / (band * step)))
    )


def _corrected_acceleration(t: np.ndarray, p: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return the acceleration (n, 3) in W that positions and accelerations (n, 3) show together at
    times t (n,) [m/s²].

    It is the second difference of the path that minimises |path - p|² / s_p² + |path'' - a|² /
    s_a², with the white noise s_p of the positions and s_a of the power of the acceleration error
    where payloads resonate, by a first path.
    Source: Whittaker smoothing as generalised least squares.
    """
    v = scipy.integrate.cumulative_trapezoid(a, t, axis=0, initial=0.0)
    missed = p - scipy.integrate.cumulative_trapezoid(v, t, axis=0, initial=0.0)
    # mean error against the positions
    a = a + 2.0 * np.polynomial.polynomial.polyfit(t - t[0], missed, 2)[2]
    noise_p, noise_a = (float(np.sqrt(np.mean(white_noise([x]) ** 2))) for x in (p, a))
    first = _along_path(t, p, a, noise_p / max(REDDER * noise_a, LEAST_ACCELEROMETER_NOISE))
    ringing = _ringing(first - a, float(np.median(np.diff(t))))
    return _along_path(t, p, a, noise_p / max(noise_a, ringing, LEAST_ACCELEROMETER_NOISE))


def _along_path(t: np.ndarray, p: np.ndarray, a: np.ndarray, ratio: float) -> np.ndarray:
    """Return the second differences (n, 3) of the smoothed path; ratio = s_p / s_a [s²]."""
    # Normal equations (1 + r² D'D) path = p + r² D'a; D'D has five bands, so that they are solved
    # in linear time.
    # The weights (3, n-2) of the previous, current and next row in the second derivative.
    before = np.diff(t)[:-1]
    after = np.diff(t)[1:]
    weight_before = 2 / ((before + after) * before)
    weight_after = 2 / ((before + after) * after)
    D = np.stack([weight_before, -(weight_before + weight_after), weight_after])
    bands = np.zeros((3, len(t)))  # bands of 1 + ratio² D'D, upper form
    bands[2] = 1.0
    target = p.copy()
    for i in range(3):
        rows = slice(i, len(t) - 2 + i)
        target[rows] += ratio**2 * D[i, :, None] * a[1:-1]
        for j in range(i, 3):
            bands[2 - (j - i), slice(j, len(t) - 2 + j)] += ratio**2 * D[i] * D[j]
    path = scipy.linalg.solveh_banded(bands, target)
    inside = sum(D[i, :, None] * path[i : len(t) - 2 + i] for i in range(3))
    correction = inside - a[1:-1]
    return a + np.concatenate([correction[:1], correction, correction[-1:]])


def _ringing(error: np.ndarray, step: float) -> float:
    """Return the deviation of white noise with the power of `error` (n, 3) in the band where
    payloads resonate.
    """
    if RINGING[1] > 0.4 / step or len(error) * step < 4 / RINGING[0]:
        return 0.0
    sos = scipy.signal.butter(2, RINGING, "bandpass", fs=1 / step, output="sos")
    power = np.mean(scipy.signal.sosfiltfilt(sos, error, axis=0) ** 2)
    return float(np.sqrt(power / (2 * step * (RINGING[1] - RINGING[0]))))


def velocity_before(
    t: np.ndarray,
    dt: np.ndarray,
    v: np.ndarray,
    q: np.ndarray,
    thrust: np.ndarray,
    vehicle: Vehicle,
    lead: float,
) -> np.ndarray:
    """Return the velocities (n, 3) in W that are predicted `lead` before the instants [m/s].

    What nominal thrust and gravity leave of the velocity, which the disturbances make, is
    extrapolated linearly.

    Args:
        t: (n,) middles of the intervals between rows [s].
        dt: (n,) their lengths [s].
        v: (n, 3) velocity in W [m/s].
        q: (n, 4) attitude there.
        thrust: (n,) mean nominal thrust in the intervals [N].
        lead: [s].
    Source: one-step predictor of prediction error methods; Ljung, System Identification, ch. 13
        (closed loop).
    """
    lifted = attitude.body_z(q) * (thrust / vehicle.mass)[:, None]
    gained = (lifted - [0.0, 0.0, vehicle.gravity]) * dt[:, None]
    nominal = np.cumsum(gained, axis=0) - 0.5 * gained
    disturbance = Signal(t, v - nominal)
    return nominal + 2 * disturbance.linear(t - lead) - disturbance.linear(t - 2 * lead)


CROSSOVER = 1.0  # [Hz]; own choice: above it the gyro is better than a reading of 1 mrad or worse
# [Hz]; own choice: below it the gyro drifts in W, and the error of a reading drifts in B
DRIFT = 0.2
DRIFT_ROUNDS = 3  # iterations that separate the two drifts; own choice
# attitude noise below which readings are used as they are, and sensors may be ideal [rad]
QUIET = 1e-3


def _unwound(r: np.ndarray) -> np.ndarray:
    """Return the rotation vectors r (n, 3) with full turns added, so that each continues the one
    before.
    """
    angle = np.linalg.norm(r, axis=1)
    if angle.max() < 0.5 * np.pi:
        return r
    out = r.copy()
    for i, axis in enumerate(r / np.maximum(angle, 1e-12)[:, None]):
        turns = round(float(out[max(i - 1, 0)] @ axis - angle[i]) / (2 * np.pi))
        out[i] = (angle[i] + 2 * np.pi * turns) * axis
    return out


def _without_drift(carried: np.ndarray, q: np.ndarray, step: float) -> np.ndarray:
    """Return the integrated gyro attitude (n, 4) without its slow drift in W against the readings q
    (n, 4).

    The error of a reading, which is constant in B, is removed before the drift is estimated.
    """
    reading_error = np.zeros((len(q), 3))
    for _ in range(DRIFT_ROUNDS):
        was = attitude.multiply(q, attitude.from_rotation_vector(-reading_error))
        drift = _unwound(
            attitude.rotation_vector(attitude.multiply(was, attitude.conjugate(carried)))
        )
        carried = attitude.multiply(
            attitude.from_rotation_vector(low_pass(drift, step, DRIFT, pad=1.0)), carried
        )
        error = attitude.turn_between(carried, q)
        reading_error = low_pass(error, step, DRIFT, pad=1.0)
    return carried


def smooth_attitude(t: np.ndarray, q: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the smoothed attitude (n, 4) and the white attitude noise [rad].

    q = q_gyro * exp(low-pass(log(q_gyro^-1 q_read))), zero phase, with q_gyro free of drift.
    Readings with less noise than `QUIET` are returned unchanged.

    Args:
        t: (n,) times [s].
        q: (n, 4) attitude readings.
        w: (n, 3) body rates in B [rad/s].
    Source: complementary filter, run in both directions; the crossover is own choice.
    """
    step = float(np.median(np.diff(t)))
    if 0.5 / step <= 2 * CROSSOVER or len(t) < 30:
        return q, 0.0
    turned = attitude.turn_between(q[:-1], q[1:])
    bias = np.sum(0.5 * (w[1:] + w[:-1]) * np.diff(t)[:, None] - turned, axis=0) / (t[-1] - t[0])
    carried = _without_drift(attitude.integrated(t, q[0], w - bias), q, step)
    error = attitude.turn_between(carried, q)
    # white alone: biases are smooth
    noise = float(np.sqrt(np.mean(np.diff(error, n=2, axis=0) ** 2) / 6))
    if noise < QUIET:
        return q, noise
    return attitude.multiply(
        carried, attitude.from_rotation_vector(low_pass(error, step, CROSSOVER, pad=1.0))
    ), noise
