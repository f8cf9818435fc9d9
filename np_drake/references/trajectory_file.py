"""Writing of any reference motion as a trajectory file, for this and other programs."""

from pathlib import Path

import numpy as np

from np_drake.logs.formats.csv_file import write_csv
from np_drake.references.base import Reference
from np_drake.references.track_file import ACCELERATION, FEEDFORWARD, POSITION, TIME, VELOCITY
from np_drake.references.trajectory import LEAST_ROWS
from np_drake.vehicle import Vehicle


def write_trajectory(
    reference: Reference,
    path: str | Path,
    rate: float = 100.0,
    *,
    duration: float | None = None,
    vehicle: Vehicle | None = None,
) -> None:
    """Write a motion from time 0 on as a CSV file, which `reference: {track: FILE.csv}` flies.

    The columns are t, x, y, z, vx, vy, vz, ax, ay, az and feed-forward for other controllers: `feedforward_roll` and
    `feedforward_pitch` [rad], the Euler angles (order yaw, pitch, roll; yaw zero) at which body z points along the
    thrust, and `feedforward_thrust` [N] of a vehicle on which no wrench acts. Numbers are read back bit for bit.

    Args:
        rate: rows a second [Hz].
        duration: [s]; None: until the motion's own `end`.
        vehicle: to which mass and gravity belong; None: the paper's.
    Raises: ValueError: if rate or duration are not positive, or the motion has no end and none is given.
    """
    duration = getattr(reference, "end", np.inf) if duration is None else duration
    if not (0 < rate < np.inf and 0 < duration < np.inf):
        raise ValueError(
            f"write_trajectory: rate [Hz] and duration [s] must be positive and finite; got {rate}, {duration}. "
            "Name the duration of a motion without an end."
        )
    rows = max(LEAST_ROWS, round(duration * rate) + 1)
    t = np.arange(rows) / rate
    flat = reference.sample(t)
    columns = {TIME: t}
    for names, values in zip((POSITION, VELOCITY, ACCELERATION), flat[:3], strict=True):
        columns |= dict(zip(names, values.T, strict=True))
    columns |= dict(zip(FEEDFORWARD, feedforward(flat[2], vehicle or Vehicle()), strict=True))
    write_csv(path, columns)


def feedforward(a: np.ndarray, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return roll, pitch (n,) [rad] and thrust (n,) [N] of a motion with accelerations a (n, 3) [m/s²]."""
    force = vehicle.mass * (a + [0.0, 0.0, vehicle.gravity])
    thrust = np.linalg.norm(force, axis=1)
    x, y, z = (force / np.maximum(thrust, 1e-9)[:, None]).T
    return -np.arcsin(np.clip(y, -1.0, 1.0)), np.arctan2(x, z), thrust
