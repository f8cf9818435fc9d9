"""Torque that follows from rotor columns in any order, against the one that turned the vehicle.

A column's thrust is in proportion to squared rotor speed, or to throttle. For each assignment of
the columns to the rotors of the vehicle file, and each pattern of directions, the torque that
follows is correlated with J dw/dt + w x J w, about each axis, in a band below the controller's
noise. Sizes do not count: thrust coefficient and inertia may be guesses. The score of an assignment
is the log likelihood ratio of two Gaussian signals over their independent samples.
"""

import dataclasses as dc
import itertools

import numpy as np
from scipy import signal

from np_drake.flight_log import FlightLog
from np_drake.training_data.segments import white_noise
from np_drake.vehicle import Vehicle

BAND = (
    0.7,
    8.0,
)  # in which torques are compared [Hz]; own choice: above trim and drift, below most noise
DELAYS = (
    0.0,
    0.02,
    0.04,
    0.06,
)  # of thrust behind a commanded throttle that are tried [s]; own choice
LEAST_SECONDS = 3.0  # of a flight whose torque is looked at [s]; own choice

Assignment = tuple[
    tuple[int, ...], tuple[float, ...]
]  # rotor of the file, from 0, and direction, by column


@dc.dataclass(frozen=True)
class Evidence:
    """What one flight tells of its m possible assignments, for d delays of thrust behind a
    throttle.

    correlations: (d, m, 3) with the torque that turned the vehicle, about x, y, z [1].
    scores: (d, m) log likelihood ratio to no relation [nat].
    """

    correlations: np.ndarray
    scores: np.ndarray


def given(vehicle: Vehicle) -> Assignment:
    """Return the assignment of columns that are in the order of the vehicle file."""
    return (0, 1, 2, 3), tuple(float(d) for d in vehicle.rotor_directions)


def assignments(vehicle: Vehicle) -> list[Assignment]:
    """Return all assignments with which a vehicle can be steered: two rotors turn each way, or as
    in its file.
    """
    positions = np.array(vehicle.rotor_positions, float)
    own = given(vehicle)[1]
    patterns = [d for d in itertools.product((1.0, -1.0), repeat=4) if sum(d) == 0 or d == own]
    found = []
    for rotors, d in itertools.product(itertools.permutations(range(4)), patterns):
        x, y, _ = positions[list(rotors)].T
        if (
            abs(np.linalg.det(np.stack([np.ones(4), y, -x, np.array(d) * np.abs(positions).max()])))
            >= 1e-9
        ):
            found.append((rotors, d))
    return found


def evidence(log: FlightLog, vehicle: Vehicle) -> Evidence | None:
    """Return what a flight tells of the order of its rotor columns; None where it has none, or is
    too short or slow.

    Args:
        vehicle: with positions and directions of the rotors, and the inertia.
    """
    columns = (
        log.rotor**2 if log.rotor is not None else log.throttle if is_each(log.throttle) else None
    )
    if columns is None or not _long_and_fast(log):
        return None
    turn, moved = _in_band(log, vehicle, columns, (0.0,) if log.rotor is not None else DELAYS)
    positions = np.array(vehicle.rotor_positions, float)
    rotors, d = (np.array(values) for values in zip(*assignments(vehicle), strict=True))
    arms = np.stack([positions[rotors, 1], -positions[rotors, 0], d], axis=1)  # (m, 3, 4)
    size = np.linalg.norm(turn, axis=0)
    found = []
    for thrust in moved:
        along = np.einsum("mak,ak->ma", arms, turn.T @ thrust)
        own = np.sqrt(np.einsum("mak,kl,mal->ma", arms, thrust.T @ thrust, arms))
        found.append(along / np.maximum(size * own, 1e-300))
    correlations = np.stack(found)
    samples = 2 * (_upper(log) - BAND[0]) * (log.t[-1] - log.t[0])
    left = np.maximum(1 - np.maximum(correlations, 0.0) ** 2, 1e-12)
    return Evidence(correlations, -0.5 * samples * np.log(left).sum(axis=2))


def torque_agreement(log: FlightLog, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray] | None:
    """Return by axis the correlation (3,) of a log's torque with J dw/dt + w x J w, and the size of
    that over it (3,).

    A controller that answers the gyro's noise correlates its torque with the noise of dw/dt. The
    correlation is NaN about an axis that is not excited: the motion's part is less than that noise.
    None where the torque is not known, or the log is too short or too slow.
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
    # White noise has in the band the power that an impulse of its size has.
    impulse = np.outer(signal.unit_impulse(len(log), "mid"), white_noise([log.w]))
    noise, _ = _in_band(dc.replace(log, w=impulse), vehicle, log.u[:, 1:], ())
    excited = np.mean(turn**2, axis=0) > 2 * np.sum(noise**2, axis=0)
    return np.where(excited, best[0], np.nan), best[1]


def is_each(values: np.ndarray | None) -> bool:
    """Return whether there is a column of each of four rotors."""
    return values is not None and values.shape[1] == 4


def _long_and_fast(log: FlightLog) -> bool:
    return log.t[-1] - log.t[0] >= LEAST_SECONDS and 2.5 * BAND[0] * log.step < 0.4


def _upper(log: FlightLog) -> float:
    """Return the upper end of the band [Hz]."""
    return min(BAND[1], 0.4 / log.step)


def _in_band(
    log: FlightLog, vehicle: Vehicle, columns: np.ndarray, delays: tuple[float, ...]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return in the band the torque (m, 3) that turned the vehicle, and the columns (m, k), by
    delay.
    """
    step = log.step
    t = np.arange(log.t[0], log.t[-1], step)

    def even(values: np.ndarray, at: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(at, log.t, column) for column in values.T], axis=1)

    w = even(log.w, t)
    turn = np.gradient(w, step, axis=0) @ vehicle.J.T + np.cross(w, w @ vehicle.J.T)
    sos = signal.butter(2, (BAND[0], _upper(log)), "bandpass", fs=1 / step, output="sos")
    inside = slice(round(0.5 / step), -round(0.5 / step))  # off the filter's ends
    filtered = [
        signal.sosfiltfilt(sos, x, axis=0)[inside]
        for x in (turn, *(even(columns, t - d) for d in delays))
    ]
    return filtered[0], filtered[1:]
