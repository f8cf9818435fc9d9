"""Motion of the body of which a blackbox log writes other quantities: a part of a quaternion, or
that of a turned IMU.

Betaflight writes x, y and z of a quaternion whose w is not negative. Indiflight learns in flight
how its IMU is turned against the body that hovers (`hoverAttitude`, from the body to the IMU), and
its attitude is that of the body from then on, of the IMU before. As it begins to learn it forgets
how its IMU was turned in the flight before: its attitude jumps, and the axes of what comes before
are not told. Source: Betaflight, blackbox fields; for Indiflight measured on a log: gyro against
attitude before and after.
"""

from collections.abc import Collection, Mapping

import numpy as np

from np_drake import attitude

STREAM = "body"
FULL = 32767.0  # of a component of Betaflight's quaternion that is 1
FORGETS = np.radians(20.0)  # turn between two rows that no vehicle makes; own choice
AXES = range(3)
QUATERNION = [f"quat[{i}]" for i in range(4)]
GYRO, ACCELEROMETER = [f"gyro[{i}]" for i in AXES], [f"acc[{i}]" for i in AXES]
VECTOR_PART = [f"imuQuaternion[{i}]" for i in AXES]
TURNED = [
    f"{name}[{i}]" for name, count in (("hoverAttitude", 4), ("quat", 4)) for i in range(count)
]
IMU = [f"{name}[{i}]" for name in ("gyroADC", "accSmooth") for i in AXES]


def body_columns(names: Collection[str]) -> tuple[str, ...]:
    """Return the columns of the body that follow from those of the main frames; none: all are
    written as they are.
    """
    if set(VECTOR_PART) <= set(names):
        return tuple(QUATERNION)
    return (*QUATERNION, *GYRO, *ACCELEROMETER) if {*TURNED, *IMU} <= set(names) else ()


def needed(names: Collection[str]) -> list[str]:
    """Return the columns of the main frames from which those of the body follow."""
    return VECTOR_PART if set(VECTOR_PART) <= set(names) else [*TURNED, *IMU]


def body_values(main: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the columns of the body (n,).

    Args:
        main: those that are needed (n,), in the units of the file, which remain.
    """
    if VECTOR_PART[0] in main:
        xyz = np.stack([main[name] for name in VECTOR_PART])
        w = np.sqrt(np.maximum(FULL**2 - np.sum(xyz**2, axis=0), 0.0))
        return dict(zip(QUATERNION, (w, *xyz), strict=True))
    turn, logged = (
        np.stack([main[f"{name}[{i}]"] for i in range(4)], axis=1)
        for name in ("hoverAttitude", "quat")
    )
    turn = turn / np.maximum(np.linalg.norm(turn, axis=1, keepdims=True), 1.0)
    final = np.broadcast_to(turn[-1:], turn.shape)
    logged = logged / np.maximum(np.linalg.norm(logged, axis=1, keepdims=True), 1.0)
    of_imu = attitude.multiply(logged, attitude.conjugate(turn))
    found = dict(zip(QUATERNION, attitude.multiply(of_imu, final).T, strict=True))
    for name, columns in (("gyroADC", GYRO), ("accSmooth", ACCELEROMETER)):
        vector = np.stack([main[f"{name}[{i}]"] for i in AXES], axis=1)
        found |= zip(columns, attitude.rotate_back(final, vector).T, strict=True)
    told = _told(of_imu, turn)
    return {name: np.where(told, values, np.nan) for name, values in found.items()}


def _told(of_imu: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return the rows (n,) behind the last at which the IMU's attitude jumps before any turn of it
    is learnt.
    """
    steps = attitude.rotation_vector(attitude.multiply(attitude.conjugate(of_imu[:-1]), of_imu[1:]))
    unlearnt = np.all(turn[1:, 1:] == 0, axis=1)
    jumps = np.flatnonzero(unlearnt & (np.linalg.norm(steps, axis=1) > FORGETS))
    return np.arange(len(of_imu)) > (jumps[-1] if len(jumps) else -1)
