"""Flight logs as tables in any convention that a map can state."""

from pathlib import Path

import numpy as np

from np_drake import attitude
from np_drake.files.file_access import write_text
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.log_map import (
    FRD_TO_FLU,
    GRAVITY,
    NED_TO_ENU,
    Q_BODY,
    Q_WORLD,
    SIZES,
    UNITS,
    LogMap,
    Source,
)

TIME = "t"
Quantities = dict[str, np.ndarray]


def quantities_of(log: FlightLog) -> Quantities:
    """Return the quantities (n, k) of a log, as `convert` of its map returns them."""
    out = {"position": log.p, "velocity": log.v, "attitude": log.q, "rates": log.w}
    if log.a is not None:
        out["acceleration"] = log.a
    out["thrust"], out["torque"] = log.u[:, :1], log.u[:, 1:]
    if log.rotor is not None:
        out["rotor_speed"] = log.rotor
    return out


def default_map(names: list[str], **fields: object) -> LogMap:
    """Return a map of columns `NAME_0`, … of these quantities, in the default conventions."""
    sizes = {name: SIZES[name][0] for name in names}
    sources = {name: Source([f"{name}_{i}" for i in range(size)]) for name, size in sizes.items()}
    return LogMap(time=Source([TIME]), **sources, **fields).check()  # type: ignore[arg-type]


def columns_in(quantities: Quantities, log_map: LogMap) -> Quantities:
    """Return the columns (n, k) that a log in the conventions of this map holds: the inverse of
    `convert`.
    """
    q = quantities["attitude"]
    return {name: _column(name, values, q, log_map) for name, values in quantities.items()}


def write_table(path: Path, t: np.ndarray, columns: Quantities, log_map: LogMap) -> None:
    """Write times [s] and columns as CSV, under the names of the map."""
    names = list(log_map.time.columns)
    time = t / UNITS["time"][log_map.time.unit or "s"]
    parts = [time[:, None]]
    for name, source in log_map.sources():
        names += source.columns
        parts.append(columns[name])
    rows = np.concatenate(parts, axis=1)
    lines = [",".join(names), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    write_text(path, "\n".join(lines) + "\n")


def _column(name: str, values: np.ndarray, q: np.ndarray, log_map: LogMap) -> np.ndarray:
    source = getattr(log_map, name)
    factor = source.scale * UNITS[name].get(source.unit, 1.0)
    world, body = log_map.frames(source)
    if name == "attitude":
        return _attitude(values, source, world, body)
    if name not in (
        "position",
        "velocity",
        "rates",
        "acceleration",
        "angular_acceleration",
        "torque",
    ):
        return values / factor
    if name == "acceleration" and source.kind != "acceleration":
        values = values + [0.0, 0.0, GRAVITY]
    own, axes = Source().axes_of(name), source.axes_of(name)
    own = "world" if name == "acceleration" else own
    if own != axes:
        values = attitude.rotate_back(q, values) if axes == "body" else attitude.rotate(q, values)
    if axes == "world" and world == "ned":
        values = values @ NED_TO_ENU
    if axes == "body" and body == "frd":
        values = values * FRD_TO_FLU
    return values / factor


def _attitude(q: np.ndarray, source: Source, world: str, body: str) -> np.ndarray:
    """Return a quaternion in the conventions of its source; turns between frames are their own
    inverse.
    """
    if world == "ned":
        q = attitude.multiply(np.broadcast_to(Q_WORLD * [1, -1, -1, -1], q.shape), q)
    if body == "frd":
        q = attitude.multiply(q, np.broadcast_to(Q_BODY * [1, -1, -1, -1], q.shape))
    if source.direction == "world_to_body":
        q = q * [1.0, -1.0, -1.0, -1.0]
    return q if source.order == "wxyz" else np.roll(q, -1, axis=1)
