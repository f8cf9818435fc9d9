"""Identification of how late commands act from flight logs: their delay, and the rotors' lag behind
it.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
import scipy

from np_drake import attitude
from np_drake.command_delay import FINE, LONGEST_DELAY, believed_before
from np_drake.flight_log import FlightLog
from np_drake.labels import raw_labels
from np_drake.rotor_input import with_rotor_lag
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import ratios

LONGEST_LAG = 0.1  # lag that is looked for, longer where the time unit of a vehicle is [s]
# share of the longest lag within which there is no minimum, and the flights tell no lag [1]
AT_BOUND = 0.01


def delays_sought(step: float) -> list[float]:
    """Return the delays of commands that a training tries, at a sampling interval of `step` [s]."""
    return [step * part / FINE for part in range(LONGEST_DELAY * FINE + 1)]


def learned_timing(
    flights: Sequence[tuple[FlightLog, Vehicle]], delays: Sequence[float]
) -> tuple[float, float]:
    """Return the rotors' time constant and the delay of commands before it with which the labels of
    `flights` change least from row to row [s].

    External wrenches change slowly; the error from rotor lag changes with every command. So the
    steps of the raw label, along the thrust and in roll and pitch, are smallest where the command
    goes through the lag that the rotors have: the sum of the logarithms of their mean squares, so
    that units do not matter, as the likelihood of normal steps; a delay other than the first of
    `delays` has the prior odds of `command_delay.believed_before`. Where the sum falls up to the
    longest lag, the commands changed too little to tell one. A lag named in a vehicle file is taken
    as it is, and measured rotor speed has none.      Source: own choice.

    Args:
        flights: logs with accelerations, and the vehicle of each.
        delays: that are tried [s].
    """
    commanded = [(log, v) for log, v in flights if log.input == "command"]
    if not commanded:
        return 0.0, float(delays[0])
    sought = [(log, v) for log, v in commanded if v.rotor_time_constant == 0]
    fits = []
    for delay in delays:
        late = [(delayed(log, delay), v) for log, v in sought or commanded]
        fits.append(_best_lag(late) if sought else (0.0, _restlessness(late)))
    rows = sum(len(log) for log, _ in commanded)
    change = believed_before(len(delays))
    loss = [0.5 * rows * score + change * (i > 0) for i, (_, score) in enumerate(fits)]
    best = int(np.argmin(loss))
    return fits[best][0], float(delays[best])


def delayed(log: FlightLog, delay: float) -> FlightLog:
    """Return the log with the command that acts, without lag, where it acts `delay` [s] late; the
    first acts before.

    Measured rotor speed is never late.

    Args:
        delay: [s].
    """
    if delay == 0.0 or log.input != "command":
        return log
    full, part = divmod(delay / log.step, 1.0)
    k = np.arange(len(log)) - int(full)
    last, before = (np.clip(i, 0, None) for i in (k, k - 1))
    return dc.replace(log, u=(1 - part) * log.u[last] + part * log.u[before])


def _best_lag(sought: Sequence[tuple[FlightLog, Vehicle]]) -> tuple[float, float]:
    """Return the time constant of least restlessness, 0 where there is no minimum [s], and that
    restlessness.
    """
    longest = LONGEST_LAG * max(1.0, *(ratios(v).clock for _, v in sought))
    best = scipy.optimize.minimize_scalar(
        lambda lag: _restlessness(sought, lag),
        bounds=(0.0, longest),
        method="bounded",
        options={"xatol": 1e-4},
    )
    without = _restlessness(sought, 0.0)
    if best.x > (1.0 - AT_BOUND) * longest or best.fun >= without:
        return 0.0, without
    return float(best.x), float(best.fun)


def _restlessness(flights: Sequence[tuple[FlightLog, Vehicle]], lag: float = 0.0) -> float:
    """Return the sum over thrust, roll and pitch of the log mean square of a step of the raw label.

    Args:
        lag: of vehicles whose file names none [s].
    """
    steps = []
    for log, vehicle in flights:
        raw = raw_labels(log, with_rotor_lag(vehicle, lag))
        along = np.sum(raw[:, :3] * attitude.body_z(log.q), axis=1)
        steps.append(np.diff(np.column_stack([along, raw[:, 3:5]]), axis=0))
    moved = np.concatenate(steps)
    moved = moved[np.isfinite(moved).all(axis=1)]
    return float(np.sum(np.log(np.mean(moved**2, axis=0) + 1e-300))) if len(moved) else 0.0
