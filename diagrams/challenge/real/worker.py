"""Diagnosis of one case in a process of its own, by the np_drake that stands first on the path.

    python worker.py FLIGHTS ANSWER [second]

Only `np_drake` is imported, so that other versions of the package answer on the same flights. FLIGHTS (.npz) holds the
vehicle (JSON) and the arrays of the flights; ANSWER (.json) gets the content of `diagnosis.json`, and the seconds that
the diagnosis took. `second`: halves of the held-out flights may join a second answer.
"""

import dataclasses as dc
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.diagnosis.diagnose import diagnose
from np_drake.flight_log import FlightLog
from np_drake.vehicle import MeasurementNoise, Vehicle

ROLES = ("train", "held_out")


def pack(path: Path, vehicle: Vehicle, train: list[FlightLog], held_out: list[FlightLog]) -> None:
    """Write the flights of a case for `unpack`."""
    content: dict[str, Any] = {}
    told: dict[str, Any] = {"vehicle": dc.asdict(vehicle), "train": [], "held_out": []}
    for role, logs in zip(ROLES, (train, held_out), strict=True):
        for i, log in enumerate(logs):
            fields = {f.name: getattr(log, f.name) for f in dc.fields(log)}
            arrays = {k: v for k, v in fields.items() if isinstance(v, np.ndarray)}
            content |= {f"{role}/{i}/{name}": value for name, value in arrays.items()}
            told[role].append({k: v for k, v in fields.items() if k not in arrays and v is not None})
    np.savez(path, told=np.array(json.dumps(told)), **content)


def unpack(path: Path) -> tuple[Vehicle, list[FlightLog], list[FlightLog]]:
    """Return vehicle and flights; what this version of the package does not know is left out."""
    with np.load(path) as content:
        told = json.loads(str(content["told"]))
        arrays = {name: content[name] for name in content.files if name != "told"}
    values = _known(Vehicle, told["vehicle"])
    values["measurement_noise"] = MeasurementNoise(**_known(MeasurementNoise, values["measurement_noise"]))
    flights: list[list[FlightLog]] = []
    for role in ROLES:
        flights.append([])
        for i, fields in enumerate(told[role]):
            start = f"{role}/{i}/"
            own = {name.removeprefix(start): v for name, v in arrays.items() if name.startswith(start)}
            flights[-1].append(FlightLog(**_known(FlightLog, {**fields, **own})))
    return Vehicle(**values).check(), flights[0], flights[1]


def _known(kind: Any, values: dict[str, Any]) -> dict[str, Any]:
    names = {field.name for field in dc.fields(kind)}
    return {name: value for name, value in values.items() if name in names}


def main(flights: Path, answer: Path, *, second: bool = False) -> None:
    """Diagnose and write the answer; `second`: halves of the held-out flights may join a second answer."""
    vehicle, train, held_out = unpack(flights)
    start, processor = time.perf_counter(), time.process_time()
    found = diagnose(vehicle, train, held_out, adaptive_split=second).as_json()
    found["seconds"] = time.perf_counter() - start
    found["processor_seconds"] = time.process_time() - processor
    found["np_drake"] = str(Path(sys.modules["np_drake"].__file__ or "").parents[1])
    answer.write_text(json.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), second="second" in sys.argv[3:])
