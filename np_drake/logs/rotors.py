"""Order and directions of the rotors behind a log's four columns, by their torque against J dw/dt.

A column's thrust is in proportion to squared rotor speed, or to throttle. For each assignment of
the columns to the rotors of the vehicle file, and each pattern of directions, the torque that
follows is correlated with J dw/dt + w x J w, about each axis, in a band below the controller's
noise. Sizes do not count: thrust coefficient and inertia may be guesses. The score of an assignment
is the log likelihood ratio of two Gaussian signals over their independent samples. All flights
whose columns are in one order tell it together. What is flown after a motor failed does not count.
"""

import dataclasses as dc
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy

from np_drake import attitude
from np_drake.estimation.noise import white_noise
from np_drake.finding import Finding, Kind
from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.logs.importing.laws import stretches
from np_drake.logs.importing.signals import Signal
from np_drake.vehicle import Vehicle
from np_drake.vehicle.rotor_layout import NEAR, RotorLayout, RotorName, places, rotor_names

# in which torques are compared [Hz]; own choice: above trim and drift, below most noise
BAND = 0.7, 8.0
# of thrust behind a commanded throttle that are tried [s]; own choice
DELAYS = 0.0, 0.02, 0.04, 0.06
LEAST_SECONDS = 3.0  # of a flight whose torque is looked at [s]; own choice
# Size of w x J w over that of all that turns the vehicle, from which it spins [1]; own choice: a
# half. There the inertia counts, which may be a guess.
SPINS = 0.5
ABOUT = 1.5  # time about a spin without control [s]; source: a period of the lowest frequency

EACH = ("rotor", "throttle", "balance")  # fields of a log with a column for each rotor

Flights = Sequence[FlightLog]
Assignment = tuple[tuple[int, ...], tuple[float, ...]]  # rotor of the file, direction; by column
# Of one flight, of its m possible assignments, for d delays of thrust behind a throttle:
# correlations (d, m, 3) with the torque that turned the vehicle [1], and scores (d, m), log
# likelihood ratios to no relation [nat].
Evidence = tuple[np.ndarray, np.ndarray]


def given(vehicle: Vehicle) -> Assignment:
    """Return the assignment of columns that are in the order of the vehicle file."""
    return (0, 1, 2, 3), tuple(vehicle.rotor_directions)


def assignments(vehicle: Vehicle) -> list[Assignment]:
    """Return all assignments with which a vehicle can be steered: two rotors turn each way, or as
    in its file.
    """
    positions = vehicle.rotor_positions_B
    stated = given(vehicle)[1]
    patterns = [d for d in itertools.product((1.0, -1.0), repeat=4) if sum(d) == 0 or d == stated]
    steerable = []
    for rotors, d in itertools.product(itertools.permutations(range(4)), patterns):
        x, y, _ = positions[list(rotors)].T
        if (
            abs(np.linalg.det(np.stack([np.ones(4), y, -x, np.array(d) * np.abs(positions).max()])))
            >= 1e-9
        ):
            steerable.append((rotors, d))
    return steerable


def evidence(log: FlightLog, vehicle: Vehicle) -> Evidence | None:
    """Return what a flight tells of the order of its rotor columns; None where it has none, or is
    too short or slow.

    Args:
        vehicle: with positions and directions of the rotors, and the inertia.
    """
    log = _without_spins(log, vehicle)
    columns = (
        log.rotor**2 if log.rotor is not None else log.throttle if is_each(log.throttle) else None
    )
    if columns is None or not _long_and_fast(log):
        return None
    turn, _, *moved = _in_band(log, vehicle, columns, (0.0,) if log.rotor is not None else DELAYS)
    positions = vehicle.rotor_positions_B
    rotors, d = (np.array(values) for values in zip(*assignments(vehicle), strict=True))
    arms = np.stack([positions[rotors, 1], -positions[rotors, 0], d], axis=1)  # (m, 3, 4)
    size = np.linalg.norm(turn, axis=0)
    by_delay = []
    for thrust in moved:
        along = np.einsum("mak,ak->ma", arms, turn.T @ thrust)
        norm = np.sqrt(np.einsum("mak,kl,mal->ma", arms, thrust.T @ thrust, arms))
        by_delay.append(along / np.maximum(size * norm, 1e-300))
    correlations = np.stack(by_delay)
    samples = 2 * (_upper(log) - BAND[0]) * (log.t[-1] - log.t[0])
    unexplained = np.maximum(1 - np.maximum(correlations, 0.0) ** 2, 1e-12)
    return correlations, -0.5 * samples * np.log(unexplained).sum(axis=2)


def torque_agreement(log: FlightLog, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray] | None:
    """Return by axis the correlation (3,) of a log's torque with J dw/dt + w x J w, and the size of
    that over it (3,).

    A controller that answers the gyro's noise correlates its torque with the noise of dw/dt. The
    correlation is NaN about an axis that is not excited: the motion's part is less than that noise.
    None where the torque is not known, or the log is too short or too slow.
    """
    if not np.isfinite(log.u).all() or not _long_and_fast(log):
        return None
    turn, _, *moved = _in_band(
        log, vehicle, log.u[:, 1:], (0.0,) if log.input == "rotor_speed" else DELAYS
    )
    size = np.linalg.norm(turn, axis=0)
    best = (np.full(3, -np.inf), np.ones(3))
    for torque in moved:
        norm = np.maximum(np.linalg.norm(torque, axis=0), 1e-300)
        correlation = np.sum(turn * torque, axis=0) / np.maximum(size * norm, 1e-300)
        if correlation.sum() > best[0].sum():
            best = correlation, size / norm
    # White noise has in the band the power that an impulse of its size has.
    impulse = np.outer(scipy.signal.unit_impulse(len(log), "mid"), white_noise([log.w]))
    noise, _ = _in_band(dc.replace(log, w=impulse), vehicle, log.u[:, 1:], ())
    excited = np.mean(turn**2, axis=0) > 2 * np.sum(noise**2, axis=0)
    return np.where(excited, best[0], np.nan), best[1]


def named_rotors(logs: Flights, vehicle: Vehicle) -> list[RotorName]:
    """Return what the rotors of a vehicle are called, also in logs that are in its order."""
    return rotor_names(vehicle.rotor_positions, [log.motors for log in logs if not log.layout])


OFF_ENDS = 0.5  # of what is filtered, at its ends [s]; own choice


def is_each(values: np.ndarray | None) -> bool:
    """Return whether there is a column of each of four rotors."""
    return values is not None and values.shape[1] == 4


def _long_and_fast(log: FlightLog) -> bool:
    return len(log) > 1 and log.t[-1] - log.t[0] >= LEAST_SECONDS and 2.5 * BAND[0] * log.step < 0.4


def _without_spins(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the longest part of a flight in which the vehicle does not spin, as with a failed
    motor.
    """
    if not _long_and_fast(log):
        return log
    turn, twist = _in_band(log, vehicle, log.w, ())
    rows = round(ABOUT / log.step)
    sizes = [scipy.ndimage.uniform_filter1d(np.sum(x**2, axis=1), rows) for x in (twist, turn)]
    spins = scipy.ndimage.maximum_filter1d(sizes[0] > SPINS**2 * sizes[1], 2 * rows + 1)
    if not spins.any():
        return log
    parts = [*stretches(~spins).tolist(), [0, 0]]
    first, after = max(parts, key=lambda part: part[1] - part[0])
    start, stop = np.searchsorted(log.t, log.t[0] + OFF_ENDS + log.step * np.array([first, after]))
    return log.rows(int(start), int(stop))


def _upper(log: FlightLog) -> float:
    """Return the upper end of the band [Hz]."""
    return min(BAND[1], 0.4 / log.step)


def _in_band(
    log: FlightLog, vehicle: Vehicle, columns: np.ndarray, delays: tuple[float, ...]
) -> list[np.ndarray]:
    """Return in the band the torque (m, 3) that turned the vehicle, w x J w of it, and the columns
    (m, k), by delay.
    """
    step = log.step
    t = np.arange(log.t[0], log.t[-1], step)
    w = Signal(log.t, log.w).linear(t)
    even = Signal(log.t, columns)
    twist = np.cross(w, w @ vehicle.J.T)
    turn = np.gradient(w, step, axis=0) @ vehicle.J.T + twist
    sos = scipy.signal.butter(2, (BAND[0], _upper(log)), "bandpass", fs=1 / step, output="sos")
    inside = slice(round(OFF_ENDS / step), -round(OFF_ENDS / step))
    return [
        scipy.signal.sosfiltfilt(sos, x, axis=0)[inside]
        for x in (turn, twist, *(even.linear(t - d) for d in delays))
    ]


# Correlation about roll and pitch from which an order is found [1]; own choice: flights with the
# right file have 0.4 to 0.9, other orders below 0.3.
RECOGNISED = 0.3
# correlation about yaw from which directions are found [1]; own choice: its torque is the smallest
TURNS = 0.2
# log likelihood ratio from which an order is preferred to another [nat]; own choice: 1 in 22,000
SURE = 10.0
COLUMNS = "rotor columns are"  # begins what is found of their order
Seen = Mapping[RotorLayout | None, Sequence[Evidence]]


@dc.dataclass(frozen=True)
class RotorOrder:
    """Assignment of a log's columns to the rotors of a vehicle file.

    rotors: (4,) of the file, counted from 0, by column.   directions: (4,) by column.
    correlations: (3,) of its torque with the one that turned the vehicle, about x, y, z, the mean
        of the flights by what they tell of the likeliest order [1].
    score: log likelihood ratio to no relation, of all flights [nat].
    """

    rotors: tuple[int, ...]
    directions: tuple[float, ...]
    correlations: tuple[float, ...]
    score: float


def rotor_orders(
    seen: Sequence[Evidence], vehicle: Vehicle
) -> tuple[RotorOrder, list[RotorOrder]] | None:
    """Return the order of the vehicle file as flights have it together, and all orders, the
    likeliest first.

    Args:
        seen: of flights whose columns are in one order; None where there is none.
    """
    if not seen:
        return None
    total = np.sum(np.stack(np.broadcast_arrays(*(scores for _, scores in seen))), axis=0)
    delay, likeliest = np.unravel_index(np.argmax(total), total.shape)

    def row(values: np.ndarray) -> np.ndarray:
        return values[min(int(delay), len(values) - 1)]

    weights = [max(float(row(scores)[likeliest]), 1e-12) for _, scores in seen]
    correlations = np.average([row(of_flight) for of_flight, _ in seen], axis=0, weights=weights)
    known = assignments(vehicle)
    orders = [
        RotorOrder(*each, tuple(r.tolist()), float(score))
        for each, r, score in zip(known, correlations, total[delay], strict=True)
    ]
    return orders[known.index(given(vehicle))], sorted(orders, key=lambda order: -order.score)


def tell_directions(logs: Flights, vehicle: Vehicle) -> bool:
    """Return whether flights tell which way the propellers turn, or have no columns of rotors."""
    by_layout = (rotor_orders(stated, vehicle) for stated in torques_seen(logs, vehicle).values())
    return all(
        abs(stated.score - other.score) >= SURE
        for stated, orders in filter(None, by_layout)
        for other in orders
        if other.rotors == stated.rotors
        and other.directions == tuple(-d for d in stated.directions)
    )


def torques_seen(logs: Flights, vehicle: Vehicle) -> Seen:
    """Return what flights tell of the order of their columns, by the layout that they state."""
    by_layout: dict[RotorLayout | None, list[Evidence]] = {}
    for log in logs:
        try:
            of_flight = evidence(_in_stated_order(log, vehicle), vehicle)
        except LogError:
            continue  # said where that log is put in order
        if of_flight is not None:
            by_layout.setdefault(log.layout, []).append(of_flight)
    return by_layout


def in_vehicle_order(
    flights: Flights, vehicle: Vehicle, seen: Seen | None = None
) -> list[FlightLog]:
    """Return the flights of a log with their rotor columns in the order of the vehicle file, and a
    note where not so.

    What the log states of its rotors counts first, and what turns the vehicle last. The order that
    all flights together tell is taken.

    Args:
        flights: of one log, with a layout where its autopilot states one.
        seen: of all flights of the vehicle, these among them (`torques_seen`); default: of these.
    Raises: LogError: where the stated rotors are not those of the vehicle, or the torque tells that
        the rotors of the
    file turn or lie otherwise, in no order of the columns.
    """
    seen = torques_seen(flights, vehicle) if seen is None else seen
    out = []
    for log in flights:
        in_stated_order = _in_stated_order(log, vehicle)
        orders = rotor_orders(seen.get(log.layout, ()), vehicle)
        out.append(
            in_stated_order if orders is None else _ordered(log, in_stated_order, vehicle, *orders)
        )
    return out


def _ordered(
    given_log: FlightLog,
    log: FlightLog,
    vehicle: Vehicle,
    stated_order: RotorOrder,
    orders: Sequence[RotorOrder],
) -> FlightLog:
    """Return a log, in its stated order, in that of the vehicle file, and a note where these
    differ.
    """
    best = orders[0]
    if not _better(best, stated_order):
        return log
    likely = [o for o in orders if best.score - o.score < SURE]
    # Of the columns, those in which the rotors turn as in the vehicle file.
    as_built = [o for o in likely if o.directions == _directions(o, vehicle)]
    turns = [turn for o in likely if (turn := board_turn(o, vehicle))]
    if len(as_built) == 1:
        best = as_built[0]
    columns = _stated_order(given_log, vehicle)
    logged = dc.replace(
        best,
        rotors=tuple(best.rotors[columns.index(i)] for i in range(4)),
        directions=tuple(best.directions[columns.index(i)] for i in range(4)),
    )
    seen = (
        f"{_described(logged, vehicle)} (torque about x, y, z correlates by "
        f"{_figures(best)}, not {_figures(stated_order)})"
    )
    if len(as_built) > 1:
        where = (
            f"{COLUMNS} hardly in the order of vehicle {vehicle.name!r}; no flight tells in which"
        )
        return _with_finding(log, Finding(Kind.ROTOR_ORDER, where, seen))
    if not as_built and turns:
        text = (
            f"the board is turned by {turns[0]} deg about z against the rotors of vehicle "
            f"{vehicle.name!r} and was turned back, as board_turn: {turns[0]} in a map does; in "
            f"its axes these are {seen}"
        )
        log = _with_finding(log, Finding(Kind.INPUT, "", text))
        return _with_board_turned(log, turns[0])
    if not as_built:
        remedy = "Correct the vehicle file."
        if tuple(-d for d in best.directions) == _directions(best, vehicle):
            remedy = (
                f"The propellers turn the other way: write rotor_directions: "
                f"{[int(-d) for d in vehicle.rotor_directions]} in the vehicle file, or give "
                f"--props (in or out) to `identify` or `vehicle new`."
            )
        raise LogError(
            f"{log.name}: rotor_positions and rotor_directions of vehicle {vehicle.name!r} "
            f"must be in the order of the "
            f"log's columns; by what turns the vehicle these are {seen}. {remedy}"
        )
    turned = np.argsort(best.rotors).tolist()
    if turns:
        seen = f"{seen}, or the board is turned: board_turn: {turns[0]} in a map"
    if given_log.layout is not None:
        text = (
            f"{COLUMNS} not in the order that {given_log.layout.source} states, but turn the "
            f"vehicle as {seen}"
        )
        log = dc.replace(log, findings=given_log.findings)
        return _reordered(log, turned, Finding(Kind.ROTOR_ORDER, "", text))
    where = f"{COLUMNS} not in the order of vehicle {vehicle.name!r} and were put into it"
    return _reordered(log, turned, Finding(Kind.ROTOR_ORDER, where, seen))


def _with_finding(log: FlightLog, finding: Finding) -> FlightLog:
    return dc.replace(log, findings=[*log.findings, finding])


def _directions(order: RotorOrder, vehicle: Vehicle) -> tuple[float, ...]:
    """Return the directions that the vehicle file has of an order's rotors."""
    return tuple(vehicle.rotor_directions[i] for i in order.rotors)


def board_turn(order: RotorOrder, vehicle: Vehicle) -> int:
    """Return by which right angle about z a board is turned whose torques are those of an order,
    with its columns as in the vehicle file [deg]; 0: by none.
    """
    places = vehicle.rotor_positions_B[:, :2] @ [1.0, 1.0j]  # x + i y
    if order.directions != given(vehicle)[1]:
        return 0
    seen = places[list(order.rotors)]
    most = NEAR * np.abs(places).mean()
    fits = (
        angle
        for angle, by in {90: -1.0j, -90: 1.0j, 180: -1.0}.items()
        if np.abs(by * places - seen).max() < most
    )
    return next(fits, 0)


def _with_board_turned(log: FlightLog, angle: float) -> FlightLog:
    """Return the log in the axes of a body against which its board is turned about z [deg]."""
    turn = attitude.from_rotation_vector(np.array([0.0, 0.0, np.radians(angle)]))
    names = [name for name in ("w", "al", "commanded_rates") if getattr(log, name) is not None]
    vectors: dict[str, Any] = {name: attitude.rotate(turn, getattr(log, name)) for name in names}
    return dc.replace(
        log,
        q=attitude.multiply(log.q, attitude.conjugate(turn)),
        u=np.column_stack([log.u[:, :1], attitude.rotate(turn, log.u[:, 1:])]),
        **vectors,
    )


def _stated_order(log: FlightLog, vehicle: Vehicle) -> list[int]:
    """Return the column of every rotor of the vehicle file, by the layout that a log's autopilot
    states, if any.

    Raises: LogError: if the stated rotors are not those of the vehicle.
    """
    if log.layout is None or not any(is_each(getattr(log, name)) for name in EACH):
        return list(range(4))
    try:
        return log.layout.order_of(vehicle.rotor_positions, vehicle.rotor_directions)
    except ValueError as error:
        raise LogError(f"{log.name}, vehicle {vehicle.name!r}: {error}") from None


def _in_stated_order(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with its rotor columns in the order of the vehicle file, by the layout that
    its autopilot states.

    Raises: LogError: if the stated rotors are not those of the vehicle.
    """
    if log.layout is None:
        return log
    try:
        order = _stated_order(log, vehicle)
    except LogError as error:
        if not is_each(log.balance):
            raise
        # Their collective thrust is told all the same.
        finding = Finding(Kind.INPUT, "the balance of the rotors is not used", str(error))
        return _with_finding(dc.replace(log, balance=None, layout=None, motors=()), finding)
    layout = log.layout
    log = dc.replace(log, layout=None)
    if order == list(range(4)):
        return log
    taken = ", ".join(log.motors[i] if log.motors else f"{i + 1} of the log" for i in order)
    text = f"rotors 1, 2, 3, 4 of the vehicle file are {taken} ({layout.source})"
    return _reordered(log, order, Finding(Kind.INPUT, "", text))


def _reordered(log: FlightLog, order: list[int], finding: Finding) -> FlightLog:
    columns = {name: getattr(log, name)[:, order] for name in EACH if is_each(getattr(log, name))}
    motors = tuple(log.motors[i] for i in order) if log.motors else ()
    return _with_finding(dc.replace(log, **columns, motors=motors), finding)


def _better(best: RotorOrder, stated: RotorOrder) -> bool:
    """Return whether an order is found, and far likelier than the file's."""
    if best.score - stated.score < SURE:
        return False
    if best.rotors == stated.rotors:
        return best.correlations[2] > TURNS + max(stated.correlations[2], 0.0)
    return min(best.correlations[:2]) > RECOGNISED


def _described(order: RotorOrder, vehicle: Vehicle) -> str:
    """Return the columns in words: where each rotor lies, and which way it turns, seen from
    above.
    """
    names = places(vehicle.rotor_positions)
    return ", ".join(
        f"{names[i]} ({'cw' if d > 0 else 'ccw'})"
        for i, d in zip(order.rotors, order.directions, strict=True)
    )


def _figures(order: RotorOrder) -> str:
    return ", ".join(f"{r:.2f}" for r in order.correlations)
