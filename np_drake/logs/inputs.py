"""Inputs of a flight: thrust and torque from throttle or rotor speed, and which is taken."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
import scipy

from np_drake.checks import require
from np_drake.files.number_text import percent
from np_drake.finding import Finding, Kind
from np_drake.flight_log import FlightLog
from np_drake.logs.columns import GRAVITY
from np_drake.logs.errors import LogError
from np_drake.rotor_input import with_rotor_input
from np_drake.training_data.accelerations import LIFT_BAND, lift_over_weight, smoothed
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import (
    THROTTLE_POWER,
    THROTTLE_POWER_SCATTER,
    VOLTAGE,
    PowerMap,
    ThrottleMap,
)

Flights = Sequence[FlightLog]

EXPONENTS = (0.5, 2.5)  # of thrust over throttle: from a linearised to a bare motor [1]
# share by which a voltage may differ from its median within a flight [1]; source: own choice
BELIEVED = 0.3
LEAST = 0.02  # throttle below which a rotor stands [1]


def with_throttle_input(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with u from its throttle, for all rotors together or each, by the map that its
    own flight shows.

    A collective throttle says nothing of torque, which is then NaN.
    Raises: LogError: if its throttle never carries the vehicle.
    """
    return _mapped(log, vehicle, _map_of(vehicle, [log]))


def with_throttle_map(
    vehicle: Vehicle, train: Flights, held_out: Flights, *, before: bool = False
) -> tuple[list[FlightLog], list[FlightLog]]:
    """Return the flights with thrust from throttle by one map, a property of the vehicle.

    It is the vehicle file's, else one of the usual exponent with which the training flights carry
    the vehicle file's weight: scale and exponent are then to be fitted together with all that hangs
    below or drags. Flights with another input are as they were.

    Args:
        before: whether the training flights are from before a change, with nothing below: their
            lift then tells the exponent, and all flights tell how much thrust over throttle
            scatters between those before and between those since.
    Raises: LogError: if a throttle never carries the vehicle.
    """
    fitted = [log for log in train if _has_throttle(log)]
    if not fitted:
        return list(train), list(held_out)
    others = [log for log in held_out if _has_throttle(log)]
    known = _map_of(vehicle, fitted, others, exponent=None if before else THROTTLE_POWER)
    if before and isinstance(known, PowerMap):
        known = _with_scatter(known, (fitted, others), vehicle.gravity)

    def mapped(log: FlightLog) -> FlightLog:
        return _mapped(log, vehicle, known) if _has_throttle(log) else log

    return [mapped(log) for log in train], [mapped(log) for log in held_out]


def hover_exponent(vehicle: Vehicle) -> float:
    """Return the power of throttle with which the thrust of `with_throttle_map` goes at hover
    [1].
    """
    if vehicle.throttle is None:
        return THROTTLE_POWER
    hover = float(vehicle.throttle.throttle(0.25 * vehicle.mass * vehicle.gravity))
    ends = vehicle.throttle.thrust(np.array([0.99, 1.01]) * hover)
    return float(np.log(ends[1] / ends[0]) / np.log(1.01 / 0.99))


def _has_throttle(log: FlightLog) -> bool:
    return log.input == "normalised" and log.throttle is not None


def _map_of(
    vehicle: Vehicle, flights: Flights, others: Flights = (), *, exponent: float | None = None
) -> ThrottleMap | PowerMap:
    """Return the vehicle file's map, else that with which the flights carry its weight.

    With voltage, if they and `others` all know it.
    exponent: [1]; None: that with which their lift goes.
    """
    if vehicle.throttle is not None:
        return vehicle.throttle
    volts = usual_voltage(flights) if usual_voltage(others or flights) else None
    seen = [_lifted(log, vehicle.gravity, volts) for log in flights]
    exponent = _fitted_exponent(seen) if exponent is None else exponent
    hover = float(np.median([flight.scale(exponent) for flight in seen])) ** (-1 / exponent)
    return PowerMap(0.25 * vehicle.mass * vehicle.gravity, hover, exponent, volts)


def _with_scatter(known: PowerMap, groups: Sequence[Flights], gravity: float) -> PowerMap:
    """Return the map with the scatter of thrust between the flights of each group."""
    squares = 0.0
    freedom = 0
    for flights in filter(None, groups):
        thrust = np.log(
            [_lifted(log, gravity, known.volts).scale(known.exponent) for log in flights]
        )
        squares += float(np.sum(np.square(thrust - thrust.mean())))
        freedom += len(flights) - 1
    return dc.replace(known, scatter=squares, freedom=freedom)


def _mapped(log: FlightLog, vehicle: Vehicle, known: ThrottleMap | PowerMap) -> FlightLog:
    """Return the log with thrust, and torque where each rotor has its throttle, by a map."""
    f = known.thrust(np.maximum(np.asarray(log.throttle), 0.0), voltage_of(log))
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
    findings = _replaced(log, Finding(Kind.THROTTLE, "", f"thrust from throttle by {whose}"))
    return dc.replace(log, u=u, input="normalised", throttle_map=known, findings=findings)


def _replaced(log: FlightLog, finding: Finding) -> list[Finding]:
    """Return the findings on a flight with this one in place of those of its kind."""
    return [*(other for other in log.findings if other.kind is not finding.kind), finding]


def voltage_of(log: FlightLog) -> np.ndarray | None:
    """Return the battery's voltage (n, 1) [V]; None where it is not logged, or is that of no
    battery in flight.
    """
    if log.voltage is None:
        return None
    usual = float(np.median(log.voltage))
    return (
        log.voltage[:, None]
        if usual > 0 and np.all(np.abs(log.voltage - usual) < BELIEVED * usual)
        else None
    )


def usual_voltage(flights: Flights) -> float | None:
    """Return the median voltage of the battery in flights [V]; None where one does not know it."""
    known = [volts for volts in map(voltage_of, flights) if volts is not None]
    return float(np.median(np.concatenate(known))) if len(known) == len(flights) > 0 else None


def lift_fit(flights: Flights) -> tuple[float, float, float]:
    """Return the likeliest power of their throttle with which the lift of flights goes, the lift
    over weight at full throttle [1], and the loss [nat].

    Args:
        flights: of one vehicle, with a throttle that carries it.
    Raises: LogError: if it never does.
    """
    seen = [_lifted(log, GRAVITY) for log in flights]
    exponent = _fitted_exponent(seen)
    return (
        exponent,
        float(np.median([flight.scale(exponent) for flight in seen])),
        _loss(seen, exponent),
    )


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


def _lifted(log: FlightLog, gravity: float, volts: float | None = None) -> _Lifted:
    throttle = np.maximum(np.asarray(log.throttle), 0.0)
    flying = throttle.mean(axis=1) > LEAST
    require(
        flying.sum() >= 20,
        f"{log.name}: throttle must be between 0 and 1 and carry the vehicle; it never exceeds "
        f"{LEAST}.",
        LogError,
    )
    lift = lift_over_weight(log.t, log.v, log.q, gravity)
    if volts is not None and log.voltage is not None:
        lift = lift / (log.voltage / volts) ** VOLTAGE
    return _Lifted(log.t, throttle, flying, lift[flying])


def _fitted_exponent(flights: Sequence[_Lifted]) -> float:
    """Return the most likely exponent of all flights together [1]."""
    return float(
        scipy.optimize.minimize_scalar(
            lambda p: _loss(flights, p), bounds=EXPONENTS, method="bounded"
        ).x
    )


def _loss(flights: Sequence[_Lifted], exponent: float) -> float:
    """Return the negative logarithm of likelihood and prior of an exponent [nat].

    Gaussian rest of the lift, of unknown variance in each flight, and the prior of the exponent.
    """
    loss = 0.0
    for seen in flights:
        rest = seen.lift - seen.scale(exponent) * seen.shape(exponent)
        # Independent samples of the lift, which is band-limited.
        count = min(float(len(rest)), 2 * LIFT_BAND * float(seen.t[-1] - seen.t[0]))
        loss += 0.5 * count * np.log(max(float(np.mean(rest**2)), 1e-12))
    return 0.5 * ((exponent - THROTTLE_POWER) / THROTTLE_POWER_SCATTER) ** 2 + loss


GUESS = 0.1  # `thrust_uncertainty` from which a thrust coefficient is a guess [1]; own choice
LEAST_SPEED = 10.0  # speed of a rotor that turns [rad/s]
# of the file's uncertainty beyond which its coefficient is another vehicle's [1]
MOST_DEVIATIONS = 3.0


def with_hover_thrust(
    vehicle: Vehicle, train: Flights, held_out: Flights = ()
) -> tuple[Vehicle, list[FlightLog], list[FlightLog]]:
    """Return vehicle and flights with the thrust coefficient with which rotor speed carries the
    training flights.

    The torque coefficient keeps its ratio to it. Mass and thrust scale then take each other's
    place: neither can be told. All stays where the file's coefficient is no guess, or no flight has
    rotor speed as its input.
    """
    guess = (vehicle.uncertainty("thrust") or 0.0) >= GUESS
    squares, lift = _speed_and_lift([log for log in train if guess and _by_speed(log)], vehicle)
    coefficient = float(squares @ lift / (squares @ squares)) if len(squares) else 0.0
    factor = coefficient / vehicle.thrust_coefficient
    # Not above zero: upside down, as the laws of the log say.
    if factor <= 0 or abs(factor - 1) < 1e-9:
        return vehicle, list(train), list(held_out)
    fitted = dc.replace(
        vehicle,
        thrust_coefficient=factor * vehicle.thrust_coefficient,
        torque_coefficient=factor * vehicle.torque_coefficient,
    ).check()
    finding = _of_coefficient(vehicle, fitted.thrust_coefficient)

    def noted(log: FlightLog) -> FlightLog:
        if not _by_speed(log):
            return log
        return dc.replace(with_rotor_input(log, fitted), findings=_replaced(log, finding))

    return fitted, [noted(log) for log in train], [noted(log) for log in held_out]


def _by_speed(log: FlightLog) -> bool:
    return log.input == "rotor_speed" and log.rotor is not None


def _of_coefficient(vehicle: Vehicle, coefficient: float) -> Finding:
    """Return what was taken in the place of the file's guess, and whether it is beyond its
    uncertainty.
    """
    spread = vehicle.thrust_uncertainty or 0.0
    given = f"{vehicle.thrust_coefficient:.4g} ± {percent(spread)} N/(rad/s)², a guess in the file"
    times = coefficient / vehicle.thrust_coefficient
    if abs(np.log(times)) > MOST_DEVIATIONS * spread:
        text = (
            f"rotor speed carries {vehicle.mass:.4g} kg with {times:.2g} times that of "
            f"{vehicle.name!r}, {given}; check vehicle and mass"
        )
        return Finding(Kind.COEFFICIENT, "thrust coefficient of another vehicle", text)
    text = (
        f"thrust coefficient {coefficient:.4g}, with which rotor speed carries "
        f"{vehicle.mass:.4g} kg, in the place of {given}"
    )
    return Finding(Kind.COEFFICIENT, "", text)


def _speed_and_lift(logs: Flights, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """Return the sum of squared rotor speeds (n,) and the lift (n,) [N] in the rows in which rotors
    turn.
    """
    squares = [np.empty(0)]
    lifts = [np.empty(0)]
    for log in logs:
        turning = log.rotor.mean(axis=1) > LEAST_SPEED  # type: ignore[union-attr]
        lift = lift_over_weight(log.t, log.v, log.q, vehicle.gravity)
        squares.append(np.sum(log.rotor**2, axis=1)[turning])  # type: ignore[operator]
        lifts.append(vehicle.mass * vehicle.gravity * lift[turning])
    return np.concatenate(squares), np.concatenate(lifts)


WORDS = {  # of inputs, the best known first
    "command": "the command",
    "rotor_speed": "rotor speed",
    "thrust_only": "thrust alone",
    "normalised": "throttle",
}


def inputs_of(log: FlightLog) -> list[str]:
    """Return the inputs that a log has, the best known first: a whole command, rotor speed, thrust,
    throttle.
    """
    thrust = np.isfinite(log.u[:, 0]).any()
    torque = np.isfinite(log.u[:, 1:]).any()
    present = {
        "command": thrust and torque,
        "rotor_speed": log.rotor is not None,
        "thrust_only": thrust,
        "normalised": log.throttle is not None,
    }
    return [kind for kind in WORDS if present[kind]]


def chosen_input(log: FlightLog, vehicle: Vehicle) -> str:
    """Return the input that drives the model of a vehicle: that of its file where the log has it,
    else the best known.
    """
    known = inputs_of(log)
    return vehicle.input if vehicle.input in known else known[0]


def with_vehicle_input(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with its command, or with thrust and torque from rotor speed or throttle, as
    the vehicle asks.

    Args:
        log: of one flight, as logged, its rotors in the order of the vehicle file.
        vehicle: that turns rotor speed or throttle into thrust and torque.
    Raises: LogError: if a throttle never carries the vehicle.
    """
    chosen = chosen_input(log, vehicle)
    wanted = vehicle.input
    if wanted not in (chosen, "command"):
        text = (
            f"thrust and torque from {WORDS[chosen]}, though vehicle {vehicle.name!r} says input: "
            f"{wanted}"
        )
        finding = Finding(Kind.INPUT, f"no {WORDS[wanted]}", text)
        log = dc.replace(log, findings=[*log.findings, finding])
    if chosen == "rotor_speed":
        return with_rotor_input(log, vehicle)
    if chosen == "normalised":
        return with_throttle_input(log, vehicle)
    hidden = [False, *[chosen == "thrust_only"] * 3]
    return dc.replace(log, u=np.where(hidden, np.nan, log.u), input=chosen)
