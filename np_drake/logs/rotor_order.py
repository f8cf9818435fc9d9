"""Order and directions of the rotors behind a log's four columns, by the sign of their torque against J dw/dt.

A column's thrust is in proportion to squared rotor speed, or to throttle. For each assignment of the columns to the
rotors of the vehicle file, and each pattern of directions, the torque that follows is correlated with the one that
turned the vehicle, about each axis, in a band below the controller's noise. Sizes do not count: thrust coefficient and
inertia may be guesses. The score of an assignment is the log likelihood ratio of two Gaussian signals over their
independent samples.
"""

import dataclasses as dc
import itertools

import numpy as np
from scipy import signal

from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.rotor_layout import CORNERS
from np_drake.vehicle import Vehicle

BAND = (0.7, 8.0)  # in which torques are compared [Hz]; own choice: above trim and drift, below most noise
DELAYS = (0.0, 0.02, 0.04, 0.06)  # of thrust behind a commanded throttle that are tried [s]; own choice
LEAST_SECONDS = 3.0  # of a flight whose order is looked for [s]; own choice
# Correlation about roll and pitch from which an order is found [1]; own choice: flights with the right file have 0.4
# to 0.9, other orders below 0.3.
FOUND = 0.3
TURNS = 0.2  # correlation about yaw from which directions are found [1]; own choice: its torque is the smallest
SURE = 10.0  # log likelihood ratio from which an order is preferred to another [nat]; own choice: 1 in 22,000
NAMED = CORNERS | {(1, 0): "front", (0, 1): "left", (-1, 0): "rear", (0, -1): "right"}
NOTE = "rotor columns"


@dc.dataclass(frozen=True)
class RotorOrder:
    """Assignment of a log's columns to the rotors of a vehicle file.

    rotors: (4,) of the file, counted from 0, by column.   directions: (4,) by column.
    correlations: (3,) of its torque with the one that turned the vehicle, about x, y, z [1].
    score: log likelihood ratio to no relation [nat].
    """

    rotors: tuple[int, ...]
    directions: tuple[float, ...]
    correlations: tuple[float, float, float]
    score: float

    def follows(self, vehicle: Vehicle) -> bool:
        """Return whether the columns turn as the rotors of the file do to which they belong."""
        return self.directions == tuple(vehicle.rotor_directions[i] for i in self.rotors)


def rotor_orders(log: FlightLog, vehicle: Vehicle) -> tuple[RotorOrder, list[RotorOrder]] | None:
    """Return the order of the vehicle file as this log has it, and all orders, the likeliest first.

    None where the log has no rotor speed and no throttle of each rotor, or is too short or too slow.

    Args:
        log: of one flight.
        vehicle: with positions and directions of the rotors, and the inertia.
    """
    columns = _columns(log)
    if columns is None or not _long_and_fast(log):
        return None
    delays = (0.0,) if log.rotor is not None else DELAYS
    samples = 2 * (_upper(log) - BAND[0]) * (log.t[-1] - log.t[0])
    turn, moved = _in_band(log, vehicle, columns, delays)
    best: list[RotorOrder] = []
    own = None
    for thrust in moved:
        orders = _scored(turn, thrust, vehicle, samples)
        if not best or orders[0].score > best[0].score:
            best = orders
            given = tuple(float(d) for d in vehicle.rotor_directions)
            own = next(o for o in orders if o.rotors == (0, 1, 2, 3) and o.directions == given)
    return None if own is None else (own, best)


def in_vehicle_order(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with its rotor columns in the order of the vehicle file, and a note where they were in another.

    What the log states of its rotors counts first, and what turns the vehicle last.

    Args:
        log: of one flight, with a layout where its autopilot states one.
        vehicle: whose order the columns should have.
    Raises: LogError: where the stated rotors are not those of the vehicle, or the torque tells that the rotors of the
    file turn or lie otherwise, in no order of the columns.
    """
    given, log = log, _in_stated_order(log, vehicle)
    found = rotor_orders(log, vehicle)
    if found is None:
        return log
    own, orders = found
    best = orders[0]
    if not _better(best, own):
        return log
    likely = [o for o in orders if best.score - o.score < SURE]
    as_built = [o for o in likely if o.follows(vehicle)]  # columns in another order, of the vehicle as in its file
    best = as_built[0] if len(as_built) == 1 else best
    stated = _stated_order(given, vehicle)
    logged = dc.replace(
        best,
        rotors=tuple(best.rotors[stated.index(i)] for i in range(4)),
        directions=tuple(best.directions[stated.index(i)] for i in range(4)),
    )
    seen = f"{_described(logged, vehicle)} (torque about x, y, z correlates by {_figures(best)}, not {_figures(own)})"
    if len(as_built) > 1:
        note = f"{NOTE} are hardly in the order of vehicle {vehicle.name!r}; this flight does not tell in which: {seen}"
        return dc.replace(log, notes=[*log.notes, note])
    if not as_built:
        raise LogError(
            f"{log.name}: rotor_positions and rotor_directions of vehicle {vehicle.name!r} must be in the order of the "
            f"log's columns; by what turns the vehicle these are {seen}. Correct the vehicle file."
        )
    turned = np.argsort(best.rotors).tolist()
    if given.layout is not None:
        note = f"{NOTE} are not in the order that {given.layout.source} states, but turn the vehicle as {seen}"
        return _reordered(dc.replace(log, notes=given.notes), turned, note)
    note = f"{NOTE} are not in the order of vehicle {vehicle.name!r} and were put into it: {seen}"
    return _reordered(log, turned, note)


def _stated_order(log: FlightLog, vehicle: Vehicle) -> list[int]:
    """Return the column of every rotor of the vehicle file, by the layout that a log's autopilot states, if any.

    Raises: LogError: if the stated rotors are not those of the vehicle.
    """
    if log.layout is None or not (_each(log.rotor) or _each(log.throttle)):
        return list(range(4))
    try:
        return log.layout.order_of(vehicle.rotor_positions, vehicle.rotor_directions)
    except ValueError as error:
        raise LogError(f"{log.name}, vehicle {vehicle.name!r}: {error}") from None


def _in_stated_order(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with its rotor columns in the order of the vehicle file, by the layout that its autopilot states.

    Raises: LogError: if the stated rotors are not those of the vehicle.
    """
    if log.layout is None:
        return log
    order, layout, log = _stated_order(log, vehicle), log.layout, dc.replace(log, layout=None)
    if order == list(range(4)):
        return log
    taken = ", ".join(str(number + 1) for number in order)
    return _reordered(log, order, f"rotors 1, 2, 3, 4 of the vehicle file are {taken} of the log ({layout.source})")


def _reordered(log: FlightLog, order: list[int], note: str) -> FlightLog:
    columns = {name: getattr(log, name)[:, order] for name in ("rotor", "throttle") if _each(getattr(log, name))}
    return dc.replace(log, **columns, notes=[*log.notes, note])


def torque_agreement(log: FlightLog, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray] | None:
    """Return by axis the correlation (3,) of a log's torque with J dw/dt + w x J w, and the size of that over it (3,).

    None where the torque is not known, or the log is too short or too slow.

    Args:
        log: of one flight.
        vehicle: with the inertia.
    """
    if not np.isfinite(log.u).all() or not _long_and_fast(log):
        return None
    delays = (0.0,) if log.input == "rotor_speed" else DELAYS
    turn, moved = _in_band(log, vehicle, log.u[:, 1:], delays)
    size = np.linalg.norm(turn, axis=0)
    best = (np.full(3, -np.inf), np.ones(3))
    for torque in moved:
        own = np.maximum(np.linalg.norm(torque, axis=0), 1e-300)
        correlation = np.sum(turn * torque, axis=0) / np.maximum(size * own, 1e-300)
        if correlation.sum() > best[0].sum():
            best = correlation, size / own
    return best


def _better(best: RotorOrder, own: RotorOrder) -> bool:
    """Return whether an order is found, and far likelier than the file's."""
    if best.score - own.score < SURE:
        return False
    if best.rotors == own.rotors:
        return best.correlations[2] > TURNS + max(own.correlations[2], 0.0)
    return min(best.correlations[:2]) > FOUND


def _columns(log: FlightLog) -> np.ndarray | None:
    """Return what the thrust of each rotor is in proportion to, (n, 4)."""
    if log.rotor is not None:
        return log.rotor**2
    return log.throttle if _each(log.throttle) else None


def _each(values: np.ndarray | None) -> bool:
    return values is not None and values.shape[1] == 4


def _long_and_fast(log: FlightLog) -> bool:
    return log.t[-1] - log.t[0] >= LEAST_SECONDS and 2.5 * BAND[0] * log.step < 0.4


def _upper(log: FlightLog) -> float:
    """Return the upper end of the band [Hz]."""
    return min(BAND[1], 0.4 / log.step)


def _in_band(
    log: FlightLog, vehicle: Vehicle, columns: np.ndarray, delays: tuple[float, ...]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return in the band the torque (m, 3) that turned the vehicle, and the columns (m, k), by delay."""
    step = log.step
    t = np.arange(log.t[0], log.t[-1], step)

    def even(values: np.ndarray, at: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(at, log.t, column) for column in values.T], axis=1)

    w = even(log.w, t)
    turn = np.gradient(w, step, axis=0) @ vehicle.J.T + np.cross(w, w @ vehicle.J.T)
    sos = signal.butter(2, (BAND[0], _upper(log)), "bandpass", fs=1 / step, output="sos")
    inside = slice(round(0.5 / step), -round(0.5 / step))  # off the filter's ends
    filtered = [signal.sosfiltfilt(sos, x, axis=0)[inside] for x in (turn, *(even(columns, t - d) for d in delays))]
    return filtered[0], filtered[1:]


def _scored(turn: np.ndarray, thrust: np.ndarray, vehicle: Vehicle, samples: float) -> list[RotorOrder]:
    """Return all orders, the likeliest first."""
    positions = np.array(vehicle.rotor_positions, float)
    size = np.linalg.norm(turn, axis=0)
    cross, square = turn.T @ thrust, thrust.T @ thrust  # (3, 4), (4, 4)

    def correlation(axis: int, arm: np.ndarray) -> float:
        return float(cross[axis] @ arm / max(size[axis] * np.sqrt(arm @ square @ arm), 1e-300))

    given = tuple(float(d) for d in vehicle.rotor_directions)
    patterns = [d for d in itertools.product((1.0, -1.0), repeat=4) if sum(d) == 0 or d == given]
    yaw = {d: correlation(2, np.array(d)) for d in patterns}
    found = []
    for rotors in itertools.permutations(range(4)):
        x, y, _ = positions[list(rotors)].T
        level = correlation(0, y), correlation(1, -x)
        for d in patterns:
            if abs(np.linalg.det(np.stack([np.ones(4), y, -x, np.array(d) * np.abs(positions).max()]))) < 1e-9:
                continue
            each = (*level, yaw[d])
            score = -0.5 * samples * sum(np.log(max(1 - max(r, 0.0) ** 2, 1e-12)) for r in each)
            found.append(RotorOrder(rotors, d, each, float(score)))
    return sorted(found, key=lambda order: -order.score)


def _described(order: RotorOrder, vehicle: Vehicle) -> str:
    """Return the columns in words: where each rotor lies, and which way it turns, seen from above."""
    positions = np.array(vehicle.rotor_positions, float)[list(order.rotors), :2]
    sign = np.sign(np.where(np.abs(positions) < 0.1 * np.abs(positions).max(), 0.0, positions)).astype(int)
    names = [NAMED.get((x, y), f"rotor {i + 1}") for (x, y), i in zip(sign, order.rotors, strict=True)]
    turns = ["cw" if d > 0 else "ccw" for d in order.directions]
    return ", ".join(f"{name} ({turn})" for name, turn in zip(names, turns, strict=True))


def _figures(order: RotorOrder) -> str:
    return ", ".join(f"{r:.2f}" for r in order.correlations)
