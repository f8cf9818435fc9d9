"""States of a logged flight from which a replay starts and with which it is compared."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import signal
from scipy.integrate import cumulative_trapezoid

from np_drake import attitude
from np_drake.diagnosis.residuals import smooth_attitude
from np_drake.effects.base import Measurement, SensorEffect
from np_drake.flight_log import FlightLog
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle

POSITION_SPAN = 0.25  # half width of the parabola through the position that the velocity does not explain [s]
VELOCITY_SPAN = 0.05  # half width of the cubic through the velocity [s]
RATE_SPAN = 0.03  # half width of the cubic through the body rates [s]
_SWEEPS = 3  # fixed-point iterations that remove a sensor effect; a bias is exact after one or two


@dc.dataclass(frozen=True)
class States:
    """States x (n, 13) of Bo at times t (n,) [s] on the clock of the commands."""

    t: np.ndarray
    x: np.ndarray

    def about(self, p_BoLo_B: np.ndarray) -> "States":
        """Return the states of Bo, given that these are of another body point at p_BoLo_B (3,) [m]."""
        if not np.any(p_BoLo_B):
            return self
        x, R = self.x.copy(), attitude.rotation_matrix(self.x[:, Q])
        x[:, P] -= R @ p_BoLo_B
        x[:, V] -= (R @ np.cross(x[:, W], p_BoLo_B)[..., None])[..., 0]
        return States(self.t, x)

    def acceleration_at(self, time: float) -> np.ndarray:
        """Return the mean dv/dt (3,) in W over the rows around `time` [s], in m/s²."""
        k = int(np.clip(np.searchsorted(self.t, time), 1, len(self.t) - 2))
        return (self.x[k + 1, V] - self.x[k - 1, V]) / (self.t[k + 1] - self.t[k - 1])


def true_states(log: FlightLog, vehicle: Vehicle, effects: Sequence[SensorEffect], *, smooth: bool) -> States:
    """Return the log's states corrected for sensor effects.

    Args:
        log: the flight.
        vehicle: the nominal vehicle.
        effects: sensor effects to remove.
        smooth: whether to smooth the states lightly (`smooth_states`).
    """
    x = unread(vehicle, log.x, effects)
    shift = sum(effect.clock_shift for effect in effects)
    return States(log.t + shift, smooth_states(log.t, x) if smooth else x)


def unread(vehicle: Vehicle, x: np.ndarray, effects: Sequence[SensorEffect]) -> np.ndarray:
    """Return the states (n, 13) whose measurement through the effects is `x` (n, 13), by fixed-point iteration."""
    truth = x
    still = np.zeros((len(x), 3))
    for _ in range(_SWEEPS if effects else 0):
        reading = Measurement(truth, still, still, np.zeros((len(x), 4)))
        for effect in effects:
            reading = effect.measure(vehicle, reading, np.zeros((len(x), 0)))
        truth = truth + x - reading.x
        truth[:, Q] /= np.linalg.norm(truth[:, Q], axis=1, keepdims=True)
    return truth


def smooth_states(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return states (n, 13) with less noise in attitude, velocity and body rates, at zero phase.

    Positions are unchanged. The attitude error of an initial state grows into a position error g θ t² / 2, so that
    attitude matters most.
    """
    smooth, step = x.copy(), float(np.median(np.diff(t)))
    smooth[:, Q], _ = smooth_attitude(t, x[:, Q], x[:, W])
    velocity = x[:, V] + slow_velocity_error(t, x, step)
    smooth[:, V] = local_polynomial(velocity, step, VELOCITY_SPAN, order=3)
    smooth[:, W] = local_polynomial(x[:, W], step, RATE_SPAN, order=3)
    return smooth


def slow_velocity_error(t: np.ndarray, x: np.ndarray, step: float) -> np.ndarray:
    """Return the slow error (n, 3) of the velocity against the position, without its mean over the flight [m/s].

    An estimator's velocity is off by some cm/s for about a second, which moves a replay by as many cm. The position
    corrects this. A constant offset is left: it is an effect to be found (`velocity_bias`).

    Source: complementary filter, run in both directions; the span is own choice.
    """
    missed = x[:, P] - cumulative_trapezoid(x[:, V], t, axis=0, initial=0.0)
    slope = local_polynomial(missed, step, POSITION_SPAN, order=2, derivative=1)
    return slope - slope.mean(axis=0)


def local_polynomial(
    value: np.ndarray, step: float, span: float, *, order: int, derivative: int = 0
) -> np.ndarray:
    """Return the centred local polynomial fit (n, m), or its derivative; `value` unchanged where rows are too few.

    Args:
        value: (n, m) samples.
        step: sample interval [s].
        span: half width of the fit [s].
        order: order of the polynomial.
        derivative: order of the derivative.
    """
    window = 2 * int(span / step + 1e-6) + 1
    window = min(window, len(value) - (len(value) + 1) % 2)
    if derivative:
        window = max(window, order + 2 - order % 2 + 1)
    if window <= order:
        return value
    return signal.savgol_filter(value, window, order, deriv=derivative, delta=step, axis=0)
