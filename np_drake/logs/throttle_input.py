"""Thrust and torque from a normalised throttle, through a map that is estimated from the flights
themselves.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import optimize

from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.training_data.accelerations import LIFT_BAND, lift_over_weight, smoothed
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import ThrottleMap

EXPONENTS = (0.5, 2.5)  # of thrust over throttle: from a linearised to a bare motor [1]
# Prior of the exponent, mean and deviation [1]. Source: a linearised motor has 1; a propeller's
# thrust goes with the square of its speed, and speed with voltage.
USUAL, SCATTER = 1.5, 0.5
# Power of a battery's voltage in thrust at a throttle, and its deviation [1]; source: prior of the
# identification.
VOLTAGE, VOLTAGE_SCATTER = 1.5, 0.5
# share by which a voltage may differ from its median within a flight [1]; source: own choice
BELIEVED = 0.3
NOTE = "thrust from throttle"
GRAVITY = 9.81  # where no vehicle states its own [m/s²]
LEAST = 0.02  # throttle below which a rotor stands [1]


def with_throttle_input(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with u from its throttle, for all rotors together or each, by the map that its
    own flight shows.

    A collective throttle says nothing of torque, which is then NaN.
    Raises: LogError: if the log has no throttle, or never one that carries the vehicle.
    """
    return _mapped(log, vehicle, _map_of(vehicle, [log]))


def with_throttle_map(
    vehicle: Vehicle, train: Sequence[FlightLog], held_out: Sequence[FlightLog]
) -> tuple[list[FlightLog], list[FlightLog]]:
    """Return the flights with thrust from throttle by one map, a property of the vehicle.

    It is the vehicle file's, else one of the usual exponent with which the training flights carry
    the vehicle file's weight: scale and exponent are then to be fitted together with all that hangs
    below or drags. Flights with another input are as they were.
    Raises: LogError: if a throttle never carries the vehicle.
    """
    told = [log for log in train if _has_throttle(log)]
    if not told:
        return list(train), list(held_out)
    known = _map_of(vehicle, told, [log for log in held_out if _has_throttle(log)], exponent=USUAL)

    def mapped(log: FlightLog) -> FlightLog:
        return _mapped(log, vehicle, known) if _has_throttle(log) else log

    return [mapped(log) for log in train], [mapped(log) for log in held_out]


def hover_exponent(vehicle: Vehicle) -> float:
    """Return the power of throttle with which the thrust of `with_throttle_map` goes at hover
    [1].
    """
    if vehicle.throttle is None:
        return USUAL
    hover = float(vehicle.throttle.throttle(0.25 * vehicle.mass * vehicle.gravity))
    ends = vehicle.throttle.thrust(np.array([0.99, 1.01]) * hover)
    return float(np.log(ends[1] / ends[0]) / np.log(1.01 / 0.99))


def _has_throttle(log: FlightLog) -> bool:
    return log.input == "normalised" and log.throttle is not None


@dc.dataclass(frozen=True)
class _PowerMap:
    """Thrust of a rotor over that of hover: (throttle / hover)^exponent (V / volts)^`VOLTAGE`; no
    volts, no V.
    """

    thrust_at_hover: float  # [N]
    hover: float  # [1]
    exponent: float  # [1]
    volts: float | None  # [V]

    def thrust(self, throttle: np.ndarray, voltage: np.ndarray | None) -> np.ndarray:
        """Return the thrust (n, k) of rotors [N], of their throttle (n, k) and the battery's
        voltage (n, 1).
        """
        charge = 1.0 if voltage is None or self.volts is None else (voltage / self.volts) ** VOLTAGE
        return self.thrust_at_hover * charge * (throttle / self.hover) ** self.exponent


def _map_of(
    vehicle: Vehicle,
    flights: Sequence[FlightLog],
    others: Sequence[FlightLog] = (),
    *,
    exponent: float | None = None,
) -> ThrottleMap | _PowerMap:
    """Return the vehicle file's map, else that with which the flights carry its weight.

    With voltage, if they and `others` all know it.
    exponent: [1]; None: that with which their lift goes.
    """
    if vehicle.throttle is not None:
        return vehicle.throttle
    volts = None
    if all(voltage_of(log) is not None for log in (*flights, *others)):
        volts = float(np.median(np.concatenate([log.voltage for log in flights])))
    seen = [_lifted(log, vehicle.gravity, volts) for log in flights]
    exponent = _fitted_exponent(seen) if exponent is None else exponent
    hover = float(np.median([own.scale(exponent) for own in seen])) ** (-1 / exponent)
    return _PowerMap(0.25 * vehicle.mass * vehicle.gravity, hover, exponent, volts)


def _mapped(log: FlightLog, vehicle: Vehicle, known: ThrottleMap | _PowerMap) -> FlightLog:
    """Return the log with thrust, and torque where each rotor has its throttle, by a map."""
    f = known.thrust(np.maximum(_throttle(log), 0.0), voltage_of(log))
    u = (
        np.column_stack([4 * f, np.full((len(log), 3), np.nan)])
        if f.shape[1] == 1
        else f @ vehicle.mixer.T
    )
    whose = (
        "the vehicle file's map"
        if known is vehicle.throttle
        else "a map that carries the vehicle file's weight"
    )
    others = [other for other in log.notes if not other.startswith(NOTE)]
    return dc.replace(log, u=u, input="normalised", notes=[*others, f"{NOTE} by {whose}"])


def voltage_of(log: FlightLog) -> np.ndarray | None:
    """Return the battery's voltage (n, 1) [V]; None where it is not logged, or is that of no
    battery in flight.
    """
    if log.voltage is None:
        return None
    usual = float(np.median(log.voltage))
    near = usual > 0 and bool(np.all(np.abs(log.voltage - usual) < BELIEVED * usual))
    return log.voltage[:, None] if near else None


@dc.dataclass(frozen=True)
class LiftFit:
    """Power of its throttle with which the lift of flights goes, within `EXPONENTS`.

    strength: lift over weight at full throttle [1].
    loss: negative logarithm of its likelihood and prior [nat].
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
    return LiftFit(
        exponent, float(np.median([own.scale(exponent) for own in seen])), _loss(seen, exponent)
    )


def _throttle(log: FlightLog) -> np.ndarray:
    if log.throttle is None:
        raise LogError(
            f"{log.name}: must have a column throttle, or throttle1 … throttle4; got none."
        )
    return log.throttle


@dc.dataclass(frozen=True)
class _Lifted:
    """Throttle (m, k) and t (m,) [s] of a flight, the rows `flying` (m,) in which rotors turn, and
    lift there (n,).

    Lift is over gravity, and over what the voltage makes of thrust, where it is known [1].
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
        """Return the mean of the rotors' throttle to the exponent (n,), in the band of the lift
        [1].
        """
        return smoothed(np.mean(self.throttle**exponent, axis=1), self.t, LIFT_BAND)[self.flying]

    def scale(self, exponent: float) -> float:
        """Return the factor of `shape` that fits the lift best."""
        model = self.shape(exponent)
        # Projection of the lift on the model: least squares of one factor.
        return max(float(model @ self.lift / (model @ model)), 1e-6)

    def rest(self, exponent: float) -> np.ndarray:
        """Return what is left of the lift (n,) [1]."""
        return self.lift - self.scale(exponent) * self.shape(exponent)


def _lifted(log: FlightLog, gravity: float, volts: float | None = None) -> _Lifted:
    throttle = np.maximum(_throttle(log), 0.0)
    flying = throttle.mean(axis=1) > LEAST
    if flying.sum() < 20:
        raise LogError(
            f"{log.name}: throttle must be between 0 and 1 and carry the vehicle; it never "
            f"exceeds {LEAST}."
        )
    lift = lift_over_weight(log.t, log.v, log.q, gravity)
    if volts is not None and log.voltage is not None:
        lift = lift / (log.voltage / volts) ** VOLTAGE
    return _Lifted(log.t, throttle, flying, lift[flying])


def _fitted_exponent(flights: Sequence[_Lifted]) -> float:
    """Return the most likely exponent of all flights together [1]."""
    return float(
        optimize.minimize_scalar(lambda p: _loss(flights, p), bounds=EXPONENTS, method="bounded").x
    )


def _loss(flights: Sequence[_Lifted], exponent: float) -> float:
    """Return the negative logarithm of likelihood and prior of an exponent [nat].

    Gaussian rest of the lift, of unknown variance in each flight, and the prior of the exponent.
    """
    variance = [(seen.samples, float(np.mean(seen.rest(exponent) ** 2))) for seen in flights]
    prior = 0.5 * ((exponent - USUAL) / SCATTER) ** 2
    return prior + sum(0.5 * n * np.log(max(v, 1e-12)) for n, v in variance)
