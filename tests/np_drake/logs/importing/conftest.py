"""Simulated flights, and their columns in the conventions of a map, written with rotation matrices
of SciPy.
"""

import dataclasses as dc
import sys
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from np_drake.flight_log import FlightLog
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.log_map import SIZES, UNITS, LogMap, Source
from tests.np_drake.diagnosis import simulated_flights
from tests.np_drake.logs.formats.made_files import writer
from tests.np_drake.logs.importing import autopilot_streams as autopilots

POINTS = {  # of the letters of a frame, in ours
    **{"f": (1, 0, 0), "l": (0, 1, 0), "u": (0, 0, 1), "e": (1, 0, 0), "n": (0, 1, 0)},
    **{"b": (-1, 0, 0), "r": (0, -1, 0), "d": (0, 0, -1), "w": (-1, 0, 0), "s": (0, -1, 0)},
}
GRAVITY = np.array([0.0, 0.0, 9.81])
Quantities = dict[str, np.ndarray]


@pytest.fixture(scope="session")
def fly() -> Callable[..., FlightLog]:
    """Return `fly(*effects, seed, seconds, noise, vigour)`: the log of a simulated flight."""
    return simulated_flights.fly


@pytest.fixture(scope="session")
def excited(fly) -> FlightLog:
    """Return an excited flight that turns about every axis, with usual sensor noise."""
    return fly(seed=3, seconds=12.0, noise=1.0, vigour=(1.6, 1.6, 1.6, 2.0), attitude_noise=0.005)


def quantities_of(log: FlightLog) -> Quantities:
    out = {"position": log.p, "velocity": log.v, "attitude": log.q, "rates": log.w}
    out |= {"thrust": log.u[:, :1], "torque": log.u[:, 1:]}
    return out if log.a is None else out | {"acceleration": log.a}


def plain_map(**fields) -> LogMap:
    """Return a map of all quantities of `quantities_of`, in the default conventions."""
    names = ("position", "velocity", "attitude", "rates", "acceleration", "thrust", "torque")
    sources = {name: Source([f"{name}{i}" for i in range(SIZES[name][0])]) for name in names}
    return dc.replace(LogMap(time=Source(["t"]), **sources), **fields)


def columns_in(log_map: LogMap, x: Quantities) -> Quantities:
    """Return the columns that a logger with the conventions of this map would have written."""
    R_WB = Rotation.from_quat(np.roll(x["attitude"], -1, axis=1)).as_matrix()  # of ours
    out = {}
    for name, value in x.items():
        source = getattr(log_map, name)
        words = (source.world or log_map.world, source.body or log_map.body)
        W, B = (np.array([POINTS[point] for point in word], float).T for word in words)
        B = Rotation.from_euler("z", log_map.board_turn, degrees=True).as_matrix() @ B
        if name == "attitude":
            R = W.T @ R_WB @ B
            R = np.swapaxes(R, 1, 2) if source.direction == "world_to_body" else R
            if len(source.columns) == 3:
                value = Rotation.from_matrix(R).as_euler("ZYX")[:, ::-1]
            else:
                value = Rotation.from_matrix(R).as_quat()
                value = value if source.order == "xyzw" else np.roll(value, 1, axis=1)
        elif SIZES[name] == (3,):
            value, axes = _in_axes(name, value, source, R_WB)
            value = value @ (W if axes == "world" else B)
        out[name] = value / (source.scale * UNITS[name].get(source.unit, 1.0))
    return out


def _in_axes(
    name: str, value: np.ndarray, source: Source, R_WB: np.ndarray
) -> tuple[np.ndarray, str]:
    if name == "acceleration":
        kind = source.kind or "specific_force"
        axes = source.axes or ("body" if kind == "specific_force" else "world")
        value = value + GRAVITY * (kind == "specific_force")
        own = "world"
    else:
        own = "world" if name in ("position", "velocity") else "body"
        axes = source.axes or own
    if axes == own:
        return value, axes
    return np.einsum("nij,nj->ni" if axes == "world" else "nji,nj->ni", R_WB, value), axes


@pytest.fixture(scope="session")
def conventions():
    """Return the module of this file, with `quantities_of`, `plain_map`, `columns_in`."""
    return sys.modules[__name__]


@pytest.fixture(scope="session")
def flown(fly) -> FlightLog:
    """Return a lively flight of 8 s at 100 Hz, with usual sensor noise."""
    return fly(seed=5, seconds=8.0, noise=1.0, vigour=1.5, attitude_noise=0.003)


@pytest.fixture
def import_px4(flown, tmp_path):
    """Return `import_px4(outputs, parameters)`: the import of the flight with these outputs by
    stream.
    """
    pytest.importorskip("pyulog", reason="ULog needs pyulog")

    def go(outputs, parameters=None, change=lambda streams: streams, **options):
        path = tmp_path / "log.ulg"
        writer("ulog").write(
            path, change(autopilots.px4(flown, outputs)), parameters=parameters or {}
        )
        return import_log(path, **options)

    return go


@pytest.fixture
def import_ardupilot(flown, tmp_path):
    """Return `import_ardupilot(outputs, parameters)`: the import of the flight with these
    pulses.
    """

    def go(outputs, parameters=None, change=lambda s: s, first=1, firmware="ArduCopter", **options):
        path = tmp_path / "log.bin"
        streams = change(autopilots.ardupilot(flown, outputs, first))
        told = {"parameters": parameters or {}, "firmware": f"{firmware} V4.5.7"}
        writer("dataflash").write(path, streams, **told)
        return import_log(path, **options)

    return go
