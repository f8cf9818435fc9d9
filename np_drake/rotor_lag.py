"""Identification of the rotors' lag behind the command from flight logs."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from np_drake import attitude
from np_drake.labels import raw_labels
from np_drake.logs.flight_log import FlightLog
from np_drake.scaling import ratios
from np_drake.vehicle import Vehicle

LONGEST = 0.1  # lag that is looked for, longer at the pace of vehicles that are sampled more slowly [s]
AT_BOUND = 0.01  # share of the longest lag within which there is no minimum, and the flights tell no lag [1]


def learned_rotor_lag(flights: Sequence[tuple[FlightLog, Vehicle]]) -> float:
    """Return the rotors' time constant with which the labels of `flights` change least from row to row [s].

    External wrenches change slowly; the error from rotor lag changes with every command. So the
    steps of the raw label, along the thrust and in roll and pitch, are smallest where the command goes through the
    lag that the rotors have: the sum of the logarithms of their mean squares, so that units do not matter. Where that
    falls up to the longest lag, the commands changed too little to tell one. A lag named in a vehicle file is taken as
    it is, and measured rotor speed has none.      Source: own choice.

    Args: flights: logs with accelerations, and the vehicle of each.
    """
    sought = [(log, v) for log, v in flights if log.input == "command" and v.rotor_time_constant == 0]
    if not sought:
        return 0.0
    longest = LONGEST * max(1.0, *(ratios(v).clock for _, v in sought))
    best = minimize_scalar(
        lambda lag: _restlessness(sought, lag),
        bounds=(0.0, longest),
        method="bounded",
        options={"xatol": 1e-4},
    )
    if best.x > (1.0 - AT_BOUND) * longest or best.fun >= _restlessness(sought, 0.0):
        return 0.0
    return float(best.x)


def _restlessness(flights: Sequence[tuple[FlightLog, Vehicle]], lag: float) -> float:
    """Return the sum over thrust, roll and pitch of the log mean square of a step of the raw label."""
    steps = []
    for log, vehicle in flights:
        raw = raw_labels(log, dc.replace(vehicle, rotor_time_constant=lag))
        along = np.sum(raw[:, :3] * attitude.body_z(log.q), axis=1)
        steps.append(np.diff(np.column_stack([along, raw[:, 3:5]]), axis=0))
    moved = np.concatenate(steps)
    moved = moved[np.isfinite(moved).all(axis=1)]
    return float(np.sum(np.log(np.mean(moved**2, axis=0) + 1e-300))) if len(moved) else 0.0
