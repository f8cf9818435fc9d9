"""Flights with a known effect, written in other conventions and rates: their diagnosis must be that of the original."""

import dataclasses as dc
import itertools
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from diagrams.batch.workers import Workers, results
from diagrams.challenge.generate.logged_input import FINER, SEMANTICS, as_logged, with_input
from diagrams.challenge.generate.sensor_quality import SensorQuality, with_sensor_noise
from diagrams.challenge.generate.trajectories import draw_plan
from diagrams.challenge.generate.vehicles import draw_vehicle, vehicle_file
from diagrams.challenge.imported.written import columns_in, default_map, quantities_of, write_table
from diagrams.challenge.simulators.drake.simulator import fly
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.result import Diagnosis
from np_drake.effects.base import Effect
from np_drake.effects.library import LIBRARY
from np_drake.flight_log import FlightLog
from np_drake.logs.case_folder import VEHICLE, open_case
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.import_sheet import write_sheet
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.log_map import LogMap, Source, load_map
from np_drake.vehicle import Vehicle

FILES = {
    "train_1": "aggressive_multisine",
    "train_2": "waypoints",
    "heldout_1": "lemniscate",
}  # and their plans
SECONDS = 12.0  # of every flight [s]
FRAMES = {"ENU/FLU": ("enu", "flu"), "NED/FRD": ("ned", "frd")}
RATES = (50, 100, 250, 500)  # of the rows [Hz]
INPUTS = ("thrust_only", "rotor_speed", "throttle")  # besides thrust and torque
EFFECTS: dict[str, Callable[[Vehicle], dict[str, float]]] = {  # well visible; own choice
    "linear_drag": lambda v: {"d_x": 0.25 * v.mass, "d_y": 0.2 * v.mass, "d_z": 0.15 * v.mass},
    "thrust_scale": lambda v: {"scale": 0.9},
    "motor_lag": lambda v: {"time_constant": v.rotor_time_constant + 0.04},
    "suspended_payload": lambda v: {
        **{"mass": 0.15 * v.mass, "length": 0.7, "hook_x": 0.0, "hook_y": 0.0, "hook_z": -0.03}
    },
}
Progress = Callable[[int, int], None]
Task = tuple[int, str, int, str, str]  # number, effect, rate, semantics, input


@dc.dataclass(frozen=True)
class RoundTrip:
    """One combination: what was diagnosed of the original and of the imported log.

    names: whether they name the same.   inside: whether every parameter lies within the original's interval.
    """

    effect: str
    input: str
    frames: str
    rate: int
    semantics: str
    original: tuple[str, ...]
    imported: tuple[str, ...]
    names: bool
    inside: bool
    outside: dict[str, tuple[float, float, float]]  # parameter: imported value, original interval

    def row(self) -> dict[str, Any]:
        """Return the combination as JSON."""
        return dc.asdict(self)


def tasks(*, full: bool) -> list[Task]:
    """Return what is flown: by default rates with semantics, and inputs, each under one effect; full: under all."""
    names = tuple(EFFECTS)
    if full:
        product = itertools.product(names, RATES, SEMANTICS)
        found = [(effect, rate, semantics, "command") for effect, rate, semantics in product]
        found += [(effect, 100, "held_after", kind) for effect, kind in itertools.product(names, INPUTS)]
    else:
        found = [
            (names[(a + b) % len(names)], rate, semantics, "command")
            for (a, rate), (b, semantics) in itertools.product(enumerate(RATES), enumerate(SEMANTICS))
        ]
        found += [(names[i], 100, "held_after", kind) for i, kind in enumerate(INPUTS)]
    return [(number, *task) for number, task in enumerate(found)]


def answer_round_trips(
    *,
    seed: int,
    full: bool = False,
    workers: Workers | None = None,
    on_progress: Progress = lambda done, total: None,
) -> list[RoundTrip]:
    """Fly, write, import and diagnose the combinations.

    Those without a result are missing; the records of `workers` say why.
    Raises: FailedRun: if none has a result.
    """
    cases = [{"task": task, "seed": seed} for task in tasks(full=full)]
    records = (workers or Workers()).run(
        answer, cases, config={"part": "round-trip"}, part="round-trip", on_progress=on_progress
    )
    return [_read(row) for result in results(records) for row in result["trips"]]


def _read(row: dict[str, Any]) -> RoundTrip:
    """Return the combination that `row` gave."""
    outside = {name: tuple(values) for name, values in row["outside"].items()}
    names = {name: tuple(row[name]) for name in ("original", "imported")}
    return RoundTrip(**{**row, **names, "outside": outside})


def answer(case: dict[str, Any]) -> dict[str, Any]:
    """Return {"trips": as JSON} of the case {"task", "seed"}."""
    (number, effect, rate, semantics, kind), seed = case["task"], case["seed"]
    rng = np.random.default_rng([seed, 2, number])
    drawn = draw_vehicle(rng, SensorQuality().stated_noise())
    vehicle = dc.replace(drawn, command_timing="unknown")
    acting = LIBRARY[effect].of(EFFECTS[effect](vehicle))
    finer = 1 if semantics.startswith("held") else FINER
    logs = {name: _flown(vehicle, acting, plan, rate * finer, rng) for name, plan in FILES.items()}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "original"
        folder.mkdir()
        for name, log in logs.items():
            write_log(_input(log, vehicle, kind), folder / f"{name}.csv")
        original = _diagnosed(folder, vehicle)
        trips = []
        for frames in FRAMES:
            folder = Path(scratch) / frames.replace("/", "_")
            folder.mkdir()
            for name, log in logs.items():
                thin = as_logged(_input(log, vehicle, kind), semantics, finer)
                _import(thin, frames, semantics, folder, name)
            trips.append(
                _compared(original, _diagnosed(folder, vehicle), effect, kind, frames, rate, semantics)
            )
    return {"trips": [trip.row() for trip in trips]}


def _flown(vehicle: Vehicle, effect: Effect, plan: str, rate: int, rng: np.random.Generator) -> FlightLog:
    """Return one flight with ideal sensors, without rotor speed and angular acceleration."""
    drawn = draw_plan(rng, vehicle, SECONDS, plan)
    exact = fly(vehicle, drawn, [effect], t=np.arange(round(SECONDS * rate)) / rate)
    noisy = with_sensor_noise(exact, vehicle, SensorQuality(), rng)
    return dc.replace(noisy, al=None)


def _input(log: FlightLog, vehicle: Vehicle, kind: str) -> FlightLog:
    """Return the log with one kind of input; rotor speed is there where it is the input alone."""
    if kind == "command":
        return dc.replace(log, rotor=None)
    return with_input(log, vehicle, "normalised" if kind == "throttle" else kind)


def _import(log: FlightLog, frames: str, semantics: str, folder: Path, name: str) -> None:
    """Write a log in these conventions, import it through a map in YAML, and write what comes of it."""
    columns = quantities_of(log)
    world, body = FRAMES[frames]
    names = [n for n in columns if n not in ("thrust", "torque")]
    names += {"command": ["thrust", "torque"], "thrust_only": ["thrust"]}.get(log.input, [])
    log_map = default_map(names, world=world, body=body, command=semantics)
    if log.throttle is not None:
        columns["throttle"] = log.throttle
        log_map.throttle = Source([f"throttle_{i}" for i in range(4)])
    with tempfile.TemporaryDirectory() as scratch:
        table, text = Path(scratch) / f"{name}.csv", Path(scratch) / "map.yaml"
        write_table(table, log.t, columns_in(columns, log_map), log_map)
        text.write_text(yaml.safe_dump(_short(log_map)), encoding="utf-8")
        found = import_log(table, load_map(text))
    (flight,) = found.flights
    write_log(flight, folder / f"{name}.csv")
    write_sheet(found.sheet, folder / f"{name}.csv")


def _short(log_map: LogMap) -> dict[str, Any]:
    """Return the fields of a map that are not the defaults."""
    out = {n: getattr(log_map, n) for n in ("world", "body", "command")}
    out["time"] = {"columns": log_map.time.columns}
    return out | {name: {"columns": source.columns} for name, source in log_map.sources()}


def _diagnosed(folder: Path, vehicle: Vehicle) -> Diagnosis:
    (folder / VEHICLE).write_text(vehicle_file(vehicle), encoding="utf-8")
    return diagnose(*open_case(folder))


def _compared(
    original: Diagnosis, imported: Diagnosis, effect: str, kind: str, frames: str, rate: int, semantics: str
) -> RoundTrip:
    outside = {}
    now = {cause.identifier: cause for cause in imported.causes}
    for cause in original.causes:
        if cause.identifier not in now:
            continue
        for name, estimate in cause.parameters.items():
            value = now[cause.identifier].parameters[name].value
            if not estimate.ci95[0] <= value <= estimate.ci95[1]:
                outside[f"{cause.identifier}.{name}"] = (value, *estimate.ci95)
    return RoundTrip(
        effect,
        kind,
        frames,
        rate,
        semantics,
        original.verdict,
        imported.verdict,
        names=set(original.verdict) == set(imported.verdict),
        inside=not outside,
        outside=outside,
    )


def count(trips: Sequence[RoundTrip]) -> tuple[int, int]:
    """Return how many combinations give the same names, and how many the same parameters besides."""
    return sum(t.names for t in trips), sum(t.names and t.inside for t in trips)
