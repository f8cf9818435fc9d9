"""Parsers that read what users bring, each with small good files from which a fuzzer starts."""

import dataclasses as dc
import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.common.yaml import yaml_dump

from diagrams.loop.experiments import load_experiment
from np_drake.files.file_access import kept_json, read_json
from np_drake.lifting.model.lifted_model import load_model
from np_drake.logs.formats.format import Stream
from np_drake.logs.formats.neurobem import FIRST_COLUMNS, read_wrenches
from np_drake.logs.importing.log_map import load_map_file
from np_drake.logs.opening import open_flights
from np_drake.payload_filter.model_file import PayloadFilterModel
from np_drake.references.track_file import read_track
from np_drake.residual_models.motion_model import MotionModel
from np_drake.vehicle import Vehicle, load_vehicle
from tests.np_drake.logs.formats.made_files import noise, writer

TESTS = Path(__file__).parents[1]
EXAMPLES = TESTS.parent / "docs" / "examples"
MODELS = TESTS.parent / "diagrams" / "models"
REFUSED = (ValueError, OSError)  # what a reader may raise; the command line makes one line of it
ROWS = 12  # of a made log [1]


@dc.dataclass(frozen=True)
class Target:
    """Parser of one kind of file.

    suffix: of the file.
    parse: reads the file at a path.
    seeds: makes good files in an empty folder.
    """

    name: str
    suffix: str
    parse: Callable[[Path], Any]
    seeds: Callable[[Path], list[bytes]]


def check(target: Target, path: Path) -> None:
    """Read a file; a reader must return or refuse in words.

    Raises: AssertionError: if it refuses without a word.
    Anything else that a reader must not raise.
    """
    try:
        target.parse(path)
    except REFUSED as error:
        if not str(error).strip():
            raise AssertionError(f"{target.name}: refused without a word: {error!r}") from error


def stream(*columns: str, rows: int = ROWS) -> Stream:
    """Return a made stream at 50 Hz."""
    return noise(columns, 1.0 + np.arange(rows) / 50.0, seed=len(columns))


def _written(
    name: str, file: str, streams: dict[str, Stream], **options: Any
) -> Callable[[Path], list[bytes]]:
    def seeds(folder: Path) -> list[bytes]:
        path = folder / file
        writer(name).write(path, streams, **options)
        return [path.read_bytes()]

    return seeds


def _blackbox(folder: Path) -> list[bytes]:
    """Return a log of Indiflight, with all kinds of frames and events, and two logs in one file."""
    made = writer("blackbox")
    names = {
        "pos": 3,
        "vel": 3,
        "quat": 4,
        "gyroADC": 3,
        "accSmooth": 3,
        "motor": 4,
        "omega": 4,
        "hoverAttitude": 4,
    }
    values = {
        f"{n}[{i}]": 900 + np.arange(ROWS) * (i + 1)
        for n, count in names.items()
        for i in range(count)
    }
    beside = {1: [("S", [3, 1, 0, 1]), ("H", [5, 6]), ("G", [7, 8, 9, 10]), *made.EVENTS.values()]}
    log = made.main_log(
        values, beside=beside, settings={"Firmware revision": "Indiflight 5.0.0 (a) H743"}
    )
    return [log.encode(), log.encode() + log.encode()]


def _bags1(folder: Path) -> list[bytes]:
    """Return ROS 1 bags with plain and packed chunks."""
    path, made = folder / "a.bag", []
    for compression in ("", "BZ2", "LZ4"):
        writer("ros").write(path, ODOMETRY, compression=compression)
        made.append(path.read_bytes())
        path.unlink()
    return made


def _bags2(folder: Path) -> list[bytes]:
    """Return MCAP files with plain and packed chunks."""
    writer("ros").write(folder / "a.mcap", ODOMETRY)
    writer("ros").write(folder / "bag", ODOMETRY, compression="storage")
    return [path.read_bytes() for path in (folder / "a.mcap", folder / "bag" / "bag.mcap")]


def _our_log(folder: Path) -> list[bytes]:
    return [_log_text(rows).encode() for rows in (3, ROWS)]


def _log_text(rows: int) -> str:
    names = ["t", "px", "py", "pz", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz"]
    names += ["thrust", "tau_x", "tau_y", "tau_z"]
    lines = [",".join(names)]
    for k in range(rows):
        values = [0.02 * k, 0.1 * k, 0, 1, 1, 0, 0, 0, 5, 0, 0, 0, 0, 0, 9.81, 0, 0, 0]
        lines.append(",".join(map(repr, values)))
    return "\n".join([*lines, ""])


def _parquet(folder: Path) -> list[bytes]:
    from pyarrow import csv, parquet

    source, path = folder / "log.csv", folder / "log.parquet"
    source.write_text(_log_text(ROWS))
    parquet.write_table(csv.read_csv(source), path)
    return [path.read_bytes()]


def _neurobem(folder: Path) -> list[bytes]:
    return [FIRST_COLUMNS.encode() + b",x\n0,1,2\n"]


def _array(folder: Path) -> list[bytes]:
    np.save(folder / "a.npy", np.zeros((5, 40)))
    return [(folder / "a.npy").read_bytes()]


def _vehicle(folder: Path) -> list[bytes]:
    content = yaml_dump(dc.asdict(Vehicle())).encode()
    return [content, b"mass: 1.0\ninertia: [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.02]]\n"]


def _examples(pattern: str) -> Callable[[Path], list[bytes]]:
    def seeds(folder: Path) -> list[bytes]:
        found = sorted(
            path for root in (EXAMPLES, TESTS.parent / "diagrams") for path in root.rglob(pattern)
        )
        return [path.read_bytes() for path in found if path.stat().st_size < 20_000] or [b"{}"]

    return seeds


def _models(folder: Path) -> list[bytes]:
    found = sorted(MODELS.glob("*.safetensors"))
    return [path.read_bytes() for path in found]


def _json(folder: Path) -> list[bytes]:
    answer = {"readings": {"noise": {}}, "refit": None}
    return [json.dumps(answer).encode(), b"[1, 2.5e3, null, true]", b'{"a": {"b": [{}]}}']


def _map(folder: Path) -> list[bytes]:
    return [b"columns:\n  t: {name: time, unit: s}\n  p: {names: [x, y, z], unit: m}\nframe: ENU\n"]


def _track(folder: Path) -> list[bytes]:
    return [b"x,y,z\n0,0,1\n1,0,1\n1,1,1\n", b"t,x,y,z\n0,0,0,1\n1,0,0,2\n2,0,0,1\n"]


ODOMETRY = {"/rpm": stream(*(f"data[{i}]" for i in range(4)))}
COPTER = {"ATT": stream("Roll", "Pitch", "Yaw"), "IMU.0": stream("GyrX", "GyrY", "GyrZ")}
PX4 = {
    "vehicle_attitude": stream("q[0]", "q[1]", "q[2]", "q[3]"),
    "vehicle_local_position": stream("x", "y", "z"),
}

TARGETS = {
    target.name: target
    for target in (
        Target("log", ".csv", open_flights, _our_log),
        Target(
            "log_gzip",
            ".csv.gz",
            open_flights,
            lambda f: [gzip.compress(b, mtime=0) for b in _our_log(f)],
        ),
        Target("parquet", ".parquet", open_flights, _parquet),
        Target("neurobem", ".csv", open_flights, _neurobem),
        Target("array", ".npy", read_wrenches, _array),
        Target(
            "table",
            ".csv",
            open_flights,
            _written("table", "a.csv", {"table": stream("x", "y", "yaw")}),
        ),
        Target(
            "neural_fly",
            ".csv",
            open_flights,
            _written("neural_fly", "a.csv", {"flight": stream("p[0]", "q[0]")}),
        ),
        Target("ulog", ".ulg", open_flights, _written("ulog", "a.ulg", PX4)),
        Target("dataflash", ".bin", open_flights, _written("dataflash", "a.bin", COPTER)),
        Target(
            "crazyflie",
            "",
            open_flights,
            _written("crazyflie", "log00", {"estPose": stream("stateEstimate.x")}),
        ),
        Target("blackbox", ".bbl", open_flights, _blackbox),
        Target("ros1", ".bag", open_flights, _bags1),
        Target("ros2", ".mcap", open_flights, _bags2),
        Target("sqlite", ".db3", open_flights, _written("ros", "a.db3", ODOMETRY)),
        Target("log_map", ".yaml", load_map_file, _map),
        Target("vehicle", ".yaml", load_vehicle, _vehicle),
        Target("scenario", ".yaml", lambda path: load_experiment(str(path)), _examples("*.yaml")),
        Target("track", ".csv", lambda path: read_track(path, speed=1.0, ramp=1.0), _track),
        Target("lifted_model", ".safetensors", load_model, _models),
        Target("pendulum_model", ".safetensors", PayloadFilterModel.load, _models),
        Target("motion_model", ".safetensors", MotionModel.load, _models),
        Target("json", ".json", read_json, _json),
        Target("record", ".json", kept_json, _json),
    )
}
