"""Logs in other conventions than their map declares: each must be named rightly or refused, none diagnosed."""

import dataclasses as dc
import itertools
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.workers import Workers, results
from diagrams.challenge.generate.magnitudes import companion_drag
from diagrams.challenge.generate.sensor_quality import SensorQuality, draw_sensor_quality, with_sensor_noise
from diagrams.challenge.generate.trajectories import draw_plan
from diagrams.challenge.generate.vehicles import draw_vehicle
from diagrams.challenge.imported.written import columns_in, default_map, quantities_of, write_table
from diagrams.challenge.simulators.drake.simulator import fly
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.constant_wind import ConstantWind
from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.logs.importing.conventions import Change, WrongConventions, changed
from np_drake.logs.importing.convert import convert
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.log_map import LogMap

ERRORS: dict[str, Change] = {  # by name: how the log is written, where its map declares the defaults
    "world NED": (("world", "ned"),),
    "body FRD": (("body", "frd"),),
    "consistent NED/FRD": (("world", "ned"), ("body", "frd")),
    "quaternion xyzw": (("attitude.order", "xyzw"),),
    "quaternion world to body": (("attitude.direction", "world_to_body"),),
    "rates in deg/s": (("rates.unit", "deg/s"),),
    "rates in FRD": (("rates.body", "frd"),),
    "accelerometer in g": (("acceleration.unit", "g"),),
    "accelerometer without gravity": (("acceleration.kind", "acceleration"), ("acceleration.axes", "body")),
    "accelerometer negative": (("acceleration.scale", -1.0),),
    "thrust negative": (("thrust.scale", -1.0),),
    "velocity in body axes": (("velocity.axes", "body"),),
    "position in mm": (("position.unit", "mm"),),
    "position and velocity in NED": (("position.world", "ned"), ("velocity.world", "ned")),
    "time in ms": (("time.unit", "ms"),),
}
KINDS = ("aggressive_multisine", "lemniscate", "circle", "waypoints", "sprints")
FLIGHTS, ATTEMPTS = 10, 6  # flights that the logs are of, and draws of one until its vehicle is not lost
SECONDS, RATE = 15.0, 100.0  # of a flight [s], of its rows [Hz]
SAME = 1e-4  # of the size of a quantity, by which it may differ where the conventions are the right ones [1]
OUTCOMES = ("named rightly", "named among others", "named otherwise", "refused without a name", "accepted")
Progress = Callable[[int, int], None]


@dc.dataclass(frozen=True)
class WrongLog:
    """One log: the errors it was written with, what an import answered, and that of the right map.

    outcome: of `OUTCOMES`.   control: whether the log was accepted with the map in its own conventions.
    """

    errors: tuple[str, ...]
    kind: str
    outcome: str
    answer: str
    control: bool

    def row(self) -> dict[str, Any]:
        """Return the log as JSON."""
        return dc.asdict(self)


def errors_of(logs: int, seed: int) -> list[tuple[str, ...]]:
    """Return the errors of so many logs: every single one, then pairs by chance, none twice."""
    pairs = list(_pairs())
    order = np.random.default_rng([seed, 0]).permutation(len(pairs))
    return [*((name,) for name in ERRORS), *(pairs[i] for i in order)][:logs]


def _pairs() -> Iterator[tuple[str, str]]:
    """Yield the pairs of errors that do not touch the same option, or the same frame."""
    for pair in itertools.combinations(ERRORS, 2):
        options = [
            {option.rpartition(".")[2] + option.partition(".")[0] for option, _ in ERRORS[n]} for n in pair
        ]
        frames = [{option.rpartition(".")[2] for option, _ in ERRORS[n]} & {"world", "body"} for n in pair]
        if not (options[0] & options[1] or frames[0] & frames[1]):
            yield pair


def answer_conventions(
    logs: int,
    *,
    seed: int,
    workers: Workers | None = None,
    on_progress: Progress = lambda done, total: None,
) -> list[WrongLog]:
    """Fly, write and import so many logs.

    Logs of a flight without a result are missing; the records of `workers` say why.
    Raises: FailedRun: if no flight has a result.
    """
    errors = errors_of(logs, seed)
    cases = [
        {"index": index, "errors": errors[index::FLIGHTS], "seed": seed}
        for index in range(min(FLIGHTS, logs))
    ]
    records = (workers or Workers()).run(
        answer, cases, config={"part": "conventions"}, part="conventions", on_progress=on_progress
    )
    rows = [row for result in results(records) for row in result["logs"]]
    found = [WrongLog(**row | {"errors": tuple(row["errors"])}) for row in rows]
    return sorted(found, key=lambda log: errors.index(log.errors))


def flight(index: int, seed: int) -> tuple[str, FlightLog]:
    """Return the kind and the log of a moving flight with drag, wind and an off-centre mass of usual size.

    Raises: FailedRun: if the vehicle is lost in every draw.
    """
    for attempt in range(ATTEMPTS - 1):
        try:
            return _draw_flight(index, np.random.default_rng([seed, 1, index, attempt]))
        except FailedRun:
            continue
    return _draw_flight(index, np.random.default_rng([seed, 1, index, ATTEMPTS - 1]))


def _draw_flight(index: int, rng: np.random.Generator) -> tuple[str, FlightLog]:
    quality = "real" if index % 2 else "clean"
    vehicle = draw_vehicle(rng, SensorQuality(quality).stated_noise())
    kind = KINDS[index % len(KINDS)]
    plan = draw_plan(rng, vehicle, SECONDS, kind)
    effects = [
        companion_drag(rng, vehicle),
        ConstantWind(**{k: 0.4 * v for k, v in ConstantWind.draw(rng, vehicle, SECONDS).items()}),
        CenterOfMassOffset(**CenterOfMassOffset.draw(rng, vehicle, SECONDS)),
    ]
    sensors = draw_sensor_quality(quality, rng, 500.0)
    log = fly(
        vehicle,
        plan,
        effects,
        t=np.arange(round(SECONDS * RATE)) / RATE,
        background=sensors.background(vehicle),
    )
    return kind, with_sensor_noise(log, vehicle, sensors, rng)


def answer(case: dict[str, Any]) -> dict[str, Any]:
    """Return {"logs": as JSON} of the flight {"index", "errors": of every log, "seed"}."""
    kind, log = flight(case["index"], case["seed"])
    return {"logs": [_answer_one(tuple(errors), kind, log).row() for errors in case["errors"]]}


def _answer_one(errors: tuple[str, ...], kind: str, log: FlightLog) -> WrongLog:
    truth = {name: x for name, x in quantities_of(log).items() if name != "rotor_speed"}
    declared = default_map(list(truth), command="held_after")
    own = changed(declared, tuple(itertools.chain(*(ERRORS[name] for name in errors))))
    columns = columns_in(truth, own)
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "flight.csv"
        write_table(path, log.t, columns, own)
        outcome, answer = _outcome(path, declared, own, columns)
        return WrongLog(errors, kind, outcome, answer, _accepts(path, own))


def _outcome(path: Path, declared: LogMap, own: LogMap, columns: dict[str, np.ndarray]) -> tuple[str, str]:
    try:
        import_log(path, declared)
    except WrongConventions as error:
        if not error.verdict.changes:
            return "refused without a name", str(error)
        named = [error.verdict.changes, *error.verdict.rivals[:2]]
        right = [_same(changed(declared, change), own, columns) for change in named]
        outcome = "named rightly" if right[0] else "named among others" if any(right) else "named otherwise"
        return outcome, str(error).replace(str(path), path.name)
    except LogError as error:
        return "refused without a name", str(error).replace(str(path), path.name)
    return "accepted", ""


def _same(found: LogMap, own: LogMap, columns: dict[str, np.ndarray]) -> bool:
    """Return whether two maps read the same quantities from these columns, of which a quaternion's sign is free."""
    if (found.time.unit or "s") != (own.time.unit or "s"):
        return False
    a, b = convert(columns, found), convert(columns, own)
    a["attitude"] = a["attitude"] * np.sign(np.sum(a["attitude"] * b["attitude"], axis=1, keepdims=True))
    return all(np.allclose(a[n], b[n], rtol=0, atol=SAME * max(1.0, float(np.abs(b[n]).max()))) for n in b)


def _accepts(path: Path, log_map: LogMap) -> bool:
    try:
        import_log(path, log_map)
    except LogError:
        return False
    return True
