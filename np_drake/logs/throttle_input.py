"""Thrust and torque from a normalised throttle, through a map that is estimated from the flights themselves."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import optimize

from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.training_data.accelerations import LIFT_BAND, lift_over_weight, smoothed
from np_drake.vehicle import Vehicle

EXPONENTS = (0.5, 2.5)  # of thrust over throttle: from a linearised to a bare motor [1]
# Prior of the exponent, mean and deviation [1]. Source: a linearised motor has 1; a propeller's thrust goes with the
# square of its speed, and speed with voltage.
USUAL, SCATTER = 1.5, 0.5
NOTE = "thrust from throttle"
GRAVITY = 9.81  # where no vehicle states its own [m/s²]
LEAST = 0.02  # throttle below which a rotor stands [1]


def with_throttle_input(log: FlightLog, vehicle: Vehicle, exponent: float | None = None) -> FlightLog:
    """Return the log with u from its throttle: f = m g (throttle / hover)^exponent, for all rotors together or each.

    hover and exponent are the most likely ones with which thrust carries the measured specific force along body z; a
    flight whose thrust hardly varies leaves the usual exponent. They take mass and thrust from each other: neither can
    be told from such a log. A collective throttle says nothing of torque, which
    is then NaN.

    Args:
        log: with a throttle.
        vehicle: whose weight the throttle carries.
        exponent: of the vehicle [1]; default: that which fits this flight.
    Raises: LogError: if the log has no throttle, or never one that carries the vehicle.
    """
    seen = _lifted(log, vehicle.gravity)
    whose = "exponent of the vehicle" if exponent is not None else "fitted to this flight's lift"
    exponent = _fitted_exponent([seen]) if exponent is None else exponent
    hover = seen.scale(exponent) ** (-1 / exponent)
    f = vehicle.mass * vehicle.gravity * (np.maximum(_throttle(log), 0.0) / hover) ** exponent
    unknown = np.full((len(log), 3), np.nan)
    u = np.column_stack([f, unknown]) if f.shape[1] == 1 else 0.25 * f @ vehicle.mixer.T
    note = f"{NOTE}: m g (throttle / {hover:.4g})^{exponent:.3g}, {whose}"
    others = [other for other in log.notes if not other.startswith(NOTE)]
    return dc.replace(log, u=u, input="normalised", notes=[*others, note])


def with_one_exponent(
    vehicle: Vehicle, train: Sequence[FlightLog], held_out: Sequence[FlightLog]
) -> tuple[list[FlightLog], list[FlightLog]]:
    """Return the flights with thrust from throttle by one exponent, which the training flights share.

    The exponent is a property of the vehicle. The hover throttle is one of the flight: it follows the battery and the
    air. Flights with another input are as they were.

    Args:
        vehicle: whose weight the throttle carries.
        train: flights that share the exponent.
        held_out: flights to which it is applied.
    Raises: LogError: if a throttle never carries the vehicle.
    """

    def known(log: FlightLog) -> bool:
        return log.input == "normalised" and log.throttle is not None

    told = [_lifted(log, vehicle.gravity) for log in train if known(log)]
    if not told:
        return list(train), list(held_out)
    exponent = _fitted_exponent(told)

    def mapped(log: FlightLog) -> FlightLog:
        return with_throttle_input(log, vehicle, exponent) if known(log) else log

    return [mapped(log) for log in train], [mapped(log) for log in held_out]


@dc.dataclass(frozen=True)
class LiftFit:
    """Power of its throttle with which the lift of flights goes, within `EXPONENTS`.

    strength: lift over weight at full throttle [1].   loss: negative logarithm of its likelihood and prior [nat].
    """

    exponent: float
    strength: float
    loss: float


def lift_fit(flights: Sequence[FlightLog]) -> LiftFit:
    """Return the most likely power of their throttle with which the lift of flights goes.

    Args:
        flights: of one vehicle, with a throttle that carries it.
    Raises: LogError: if it never does.
    """
    seen = [_lifted(log, GRAVITY) for log in flights]
    exponent = _fitted_exponent(seen)
    return LiftFit(exponent, float(np.median([own.scale(exponent) for own in seen])), _loss(seen, exponent))


def _throttle(log: FlightLog) -> np.ndarray:
    if log.throttle is None:
        raise LogError(f"{log.name}: must have a column throttle, or throttle1 … throttle4; got none.")
    return log.throttle


@dc.dataclass(frozen=True)
class _Lifted:
    """Throttle (m, k) and t (m,) [s] of a flight, the rows `flying` (m,) in which rotors turn, and lift there (n,).

    Lift is over gravity [1].
    """

    t: np.ndarray
    throttle: np.ndarray
    flying: np.ndarray
    lift: np.ndarray

    @property
    def samples(self) -> float:
        """Number of independent samples of the lift, which is band-limited."""
        return min(float(len(self.lift)), 2 * LIFT_BAND * float(self.t[-1] - self.t[0]))

    def shape(self, exponent: float) -> np.ndarray:
        """Return the mean of the rotors' throttle to the exponent (n,), in the band of the lift [1]."""
        return smoothed(np.mean(self.throttle**exponent, axis=1), self.t, LIFT_BAND)[self.flying]

    def scale(self, exponent: float) -> float:
        """Return the factor of `shape` that fits the lift best."""
        model = self.shape(exponent)
        # Projection of the lift on the model: least squares of one factor.
        return max(float(model @ self.lift / (model @ model)), 1e-6)

    def rest(self, exponent: float) -> np.ndarray:
        """Return what is left of the lift (n,) [1]."""
        return self.lift - self.scale(exponent) * self.shape(exponent)


def _lifted(log: FlightLog, gravity: float) -> _Lifted:
    throttle = np.maximum(_throttle(log), 0.0)
    flying = throttle.mean(axis=1) > LEAST
    if flying.sum() < 20:
        raise LogError(f"{log.name}: throttle must be between 0 and 1 and carry the vehicle; it never exceeds {LEAST}.")
    lift = lift_over_weight(log.t, log.v, log.q, gravity)
    return _Lifted(log.t, throttle, flying, lift[flying])


def _fitted_exponent(flights: Sequence[_Lifted]) -> float:
    """Return the most likely exponent of all flights together [1]."""
    return float(optimize.minimize_scalar(lambda p: _loss(flights, p), bounds=EXPONENTS, method="bounded").x)


def _loss(flights: Sequence[_Lifted], exponent: float) -> float:
    """Return the negative logarithm of likelihood and prior of an exponent [nat].

    Gaussian rest of the lift, of unknown variance in each flight, and the prior of the exponent.
    """
    variance = [(seen.samples, float(np.mean(seen.rest(exponent) ** 2))) for seen in flights]
    prior = 0.5 * ((exponent - USUAL) / SCATTER) ** 2
    return prior + sum(0.5 * n * np.log(max(v, 1e-12)) for n, v in variance)
