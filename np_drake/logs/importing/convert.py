"""Conversion of the columns of a log to SI units and our frames (W z up, B z along the thrust), row
by row.
"""

from collections.abc import Mapping

import numpy as np

from np_drake import attitude
from np_drake.logs.importing.log_map import UNITS, LogMap, Source

GRAVITY = 9.81  # [m/s²]
NED_TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD_TO_FLU = np.array([1.0, -1.0, -1.0])
Q_WORLD = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])  # of NED_TO_ENU
Q_BODY = np.array([0.0, 1.0, 0.0, 0.0])  # of FRD_TO_FLU
Values = Mapping[str, np.ndarray]


def convert(raw: Values, log_map: LogMap) -> dict[str, np.ndarray]:
    """Return quantities (n, k) in SI units and our frames.

    position, velocity: in W [m, m/s].
    attitude: (n, 4) w, x, y, z, body to W.
    rates, angular_acceleration, torque: in B [rad/s, rad/s², N·m].
    acceleration: dv/dt in W without gravity [m/s²].
    thrust [N] or, with unit `weight`, over the weight [1].
    rotor_speed [rad/s].
    throttle: 0 … 1; unit `us`: of 1000 … 2000 µs.

    Args:
        raw: (n, k) columns of a log at common times, by quantity.
    """
    q = convert_quantity("attitude", raw["attitude"], log_map) if "attitude" in raw else None
    out = {} if q is None else {"attitude": q}
    return out | {
        name: convert_quantity(name, values, log_map, q)
        for name, values in raw.items()
        if name != "attitude"
    }


def convert_quantity(
    name: str, values: np.ndarray, log_map: LogMap, q: np.ndarray | None = None
) -> np.ndarray:
    """Return one quantity (n, k) as `convert` does.

    Args:
        values: (n, k) of the log.
        q: (n, 4) attitude at its times, where it has to be turned between W and B.
    """
    source = getattr(log_map, name)
    scaled = values * (source.scale * UNITS[name].get(source.unit, 1.0) / (source.pole_pairs or 1))
    if source.signs:
        scaled = scaled * source.signs
    if name in ("throttle", "hover_throttle") and (source.ends or source.unit == "us"):
        low, high = np.reshape(source.ends or (1000.0, 2000.0), (-1, 2)).T
        return (values * source.scale - low) / (high - low)
    if name == "attitude":
        return _attitude(scaled, source, log_map)
    return _turned(name, scaled, q, log_map) if name in _TURNED else scaled


_TURNED = (
    "position",
    "velocity",
    "rates",
    "commanded_rates",
    "acceleration",
    "angular_acceleration",
    "torque",
)


def _attitude(values: np.ndarray, source: Source, log_map: LogMap) -> np.ndarray:
    """Return w, x, y, z from body to W, of unit norm where the log's norm is not zero."""
    if values.shape[1] == 3:
        q = from_roll_pitch_yaw(values)
    else:
        q = values if source.order == "wxyz" else np.roll(values, 1, axis=1)
        q = q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1e-9)
    if source.direction == "world_to_body":
        q = q * [1.0, -1.0, -1.0, -1.0]
    world, body = log_map.frames(source)
    if world == "ned":
        q = attitude.multiply(np.broadcast_to(Q_WORLD, q.shape), q)
    if body == "frd":
        q = attitude.multiply(q, np.broadcast_to(Q_BODY, q.shape))
    return q


def _turned(name: str, values: np.ndarray, q: np.ndarray | None, log_map: LogMap) -> np.ndarray:
    """Return a vector in the axes of its quantity: W for position, velocity and acceleration, B for
    the others.
    """
    source = getattr(log_map, name)
    world, body = log_map.frames(source)
    axes = source.axes_of(name)
    if axes == "world" and world == "ned":
        values = values @ NED_TO_ENU.T
    if axes == "body" and body == "frd":
        values = values * FRD_TO_FLU
    if source.is_turned(name) and q is not None:
        values = attitude.rotate(q, values) if axes == "body" else attitude.rotate_back(q, values)
    if name == "acceleration" and source.kind != "acceleration":
        values = values - [0.0, 0.0, GRAVITY]
    return values


def from_roll_pitch_yaw(angles: np.ndarray) -> np.ndarray:
    """Return quaternions (n, 4) of roll, pitch, yaw (n, 3) [rad]: turns about z, then y, then x, in
    body axes.
    """
    x, y, z = (
        attitude.from_rotation_vector(a[:, None] * axis)
        for a, axis in zip(angles.T, np.eye(3), strict=True)
    )
    return attitude.multiply(z, attitude.multiply(y, x))
