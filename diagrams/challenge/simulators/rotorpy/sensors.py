"""Systematic errors of sensors, written for the simulator `rotorpy` from their equations alone."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from diagrams.challenge.simulators.rotorpy.library_effects import ActiveEffect, Values
from np_drake.flight_log import FlightLog

Error = Callable[[FlightLog, Rotation, Values], None]


def _xyz(c: Values) -> list[float]:
    return [c["x"], c["y"], c["z"]]


def _accelerometer(log: FlightLog, R_WB: Rotation, c: Values) -> None:
    assert log.a is not None
    log.a = log.a + R_WB.apply(_xyz(c))


def _gyro(log: FlightLog, R_WB: Rotation, c: Values) -> None:
    log.w = log.w + _xyz(c)


def _velocity(log: FlightLog, R_WB: Rotation, c: Values) -> None:
    log.v = log.v + R_WB.apply(_xyz(c))


def _attitude(log: FlightLog, R_WB: Rotation, c: Values) -> None:
    """Askew by yaw, then pitch, then roll about the axes as turned; every quaternion keeps its sign."""
    askew = R_WB * Rotation.from_euler("ZYX", [c["yaw"], c["pitch"], c["roll"]])
    q = askew.as_quat()[:, [3, 0, 1, 2]]
    log.q = q * np.where(np.sum(q * log.q, axis=1, keepdims=True) < 0, -1.0, 1.0)


ERRORS: dict[str, Error] = {
    "accelerometer_bias": _accelerometer,
    "gyro_bias": _gyro,
    "velocity_bias": _velocity,
    "attitude_bias": _attitude,
}


def with_sensor_errors(log: FlightLog, acting: Sequence[ActiveEffect]) -> FlightLog:
    """Return the log (changed in place) as sensors with their errors give it; every error acts on the truth."""
    R_WB = Rotation.from_quat(log.q[:, [1, 2, 3, 0]])
    for effect in acting:
        if effect.name in ERRORS:
            ERRORS[effect.name](log, R_WB, effect.values)
    return log
