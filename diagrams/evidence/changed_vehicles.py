"""Study `since`: a simulated vehicle is changed between flights, and the diagnosis tells the change
from throttle logs before and since.
"""

import dataclasses as dc
from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any

import numpy as np
from typer import Option

from diagrams.batch.run import Case, FailedRun, Report, Run, failures, results
from diagrams.evidence.simulated_vehicles import ATTEMPTS, Truth, draw_truth, fly_truth
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.result import Diagnosis
from np_drake.effects import (
    AttachedMass,
    BladeFlapping,
    MassError,
    ThrustScale,
    TorqueRatio,
    TranslationalLift,
    WeakRotor,
)
from np_drake.effects.base import Effect
from np_drake.effects.library import effect_of
from np_drake.flight_log import FlightLog
from np_drake.vehicle.vehicle import Calibration

# flights before the change, and flights after it that are fitted
BEFORE = 2
TRAIN = 2
# of thrust over throttle and voltage from flight to flight [1]; source: own choice, cells that warm
SCATTER = 0.01
CLOSE = 0.2  # error of a size over the change that counts as right [1]; own choice
Change = dict[str, dict[str, float]]  # size by effect and parameter [SI]


# Least and largest change of a part of the vehicle, of either sign [1].
SIZES = {"thrust": (0.05, 0.3), "torque over thrust": (0.1, 0.4), "mass": (0.1, 0.25)}
CHANGES = (
    "thrust",
    "torque over thrust",
    "thrust, torque over thrust",  # of propellers of another pitch
    "mass",  # at the centre
    "one rotor",
    "battery",  # of four cells in place of three, or the reverse
    "nothing",
)


def changed(truth: Truth, kind: str, rng: np.random.Generator) -> tuple[Truth, Change]:
    """Return the vehicle after a change of a kind of `CHANGES`, and the change."""
    v = truth.vehicle
    parts = kind.split(", ")
    thrust, torque, mass = (
        1.0 + float(rng.choice([-1.0, 1.0]) * rng.uniform(*of)) if part in parts else 1.0
        for part, of in SIZES.items()
    )
    sizes: dict[str, tuple[str, dict[str, float]]] = {
        "thrust": (ThrustScale.identifier, {"scale": thrust}),
        "torque over thrust": (TorqueRatio.identifier, {"ratio": torque}),
        "mass": (MassError.identifier, {"delta_mass": (mass - 1.0) * v.mass}),
    }
    change: Change = dict(sizes[part] for part in parts if part in sizes)
    gains = list(v.calibration.rotor_gains)
    if kind == "one rotor":
        number = int(rng.integers(4))
        efficiency = float(rng.uniform(0.75, 0.92))
        gains[number] *= efficiency
        change[WeakRotor.identifier] = {"rotor": number + 1.0, "efficiency": efficiency}
    vehicle = dc.replace(
        v,
        mass=mass * v.mass,
        torque_coefficient=torque * v.torque_coefficient,
        max_rotor_thrust=thrust * v.max_rotor_thrust,
        calibration=dc.replace(v.calibration, rotor_gains=gains),
    )
    throttle = dc.replace(truth.throttle, full_thrust=thrust * truth.throttle.full_thrust)
    cells = float(rng.choice([3 / 4, 4 / 3])) if kind == "battery" else 1.0
    return dc.replace(truth, vehicle=vehicle, throttle=throttle, cells=cells), change


FILES = ("described", "rough")
# Of eight cases in turn; thrust twice.
KINDS = (*CHANGES, "thrust")


def with_file(truth: Truth, file: str) -> Truth:
    """Return the vehicle with its file: `described`, from which it differs by drag and its throttle
    alone; or `rough`, of geometry and mass, from which it differs as vehicles do.
    """
    if file == "rough":
        return dc.replace(truth, known=dc.replace(truth.known, command_timing="unknown"))
    vehicle = dc.replace(truth.vehicle, calibration=Calibration())
    return dc.replace(
        truth,
        vehicle=vehicle,
        imu=np.zeros(3),
        flapping=BladeFlapping(0.0),
        lift=TranslationalLift(0.0),
        known=dc.replace(vehicle, throttle=None),
    )


def flown(
    seed: int, kind: str, file: str, seconds: float
) -> tuple[Truth, Change, list[FlightLog], list[FlightLog]]:
    """Return a vehicle that its controller flies before and since a change of this kind, the
    change, and logs of the flights before and since, of `seconds` [s] each.

    Raises: FailedRun: if no draw can be flown.
    """
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng((seed, attempt))
        truth = with_file(draw_truth(rng, "throttle"), file)
        later, change = changed(truth, kind, rng)
        try:
            before = _scattered(truth, rng, BEFORE, seconds, "before")
            since = _scattered(later, rng, TRAIN + 1, seconds, "since")
        except (FailedRun, ValueError):
            continue
        return truth, change, before, since
    raise FailedRun(f"since: no vehicle of seed {seed} could be flown.")


def _scattered(
    truth: Truth, rng: np.random.Generator, count: int, seconds: float, name: str
) -> list[FlightLog]:
    """Return logs of flights whose thrust over throttle scatters."""
    logs = []
    for number in range(count):
        full = truth.throttle.full_thrust * (1.0 + SCATTER * rng.normal())
        charged = dc.replace(truth, throttle=dc.replace(truth.throttle, full_thrust=full))
        (log,) = fly_truth(charged, rng, 1, seconds)
        logs.append(dc.replace(log, name=f"{name}{number + 1}"))
    return logs


# Small changes: the parameter whose smallest visible size the flights state, over that size [1].
FACTORS = (0.5, 1.0, 2.0)
SMALL: dict[type[Effect], tuple[str, float]] = {
    WeakRotor: ("efficiency", -1.0),
    AttachedMass: ("mass", 1.0),
    MassError: ("delta_mass", 1.0),
}


def small_changes(case: Case, *, seconds: float) -> dict[str, Any]:
    """Fly a case {"seed", "factor"} before and since changes of this factor over the smallest that
    its flights say they would show, and return by effect {"named", "alone", "causes"}.

    Raises: FailedRun: if no vehicle of this seed can be flown.
    """
    truth, _, before, since = flown(case["seed"], "nothing", FILES[0], seconds)

    def diagnosis_of(logs: Sequence[FlightLog]) -> Diagnosis:
        return diagnose(
            logs[:TRAIN], logs[TRAIN:], truth.known, before=before, adaptive_split=False
        )

    nothing = diagnosis_of(since)
    result = {"nothing": verdict(nothing, {})}
    rng = np.random.default_rng((case["seed"], 1))
    for effect, (name, sign) in SMALL.items():
        least = nothing.visible.get(f"{effect.identifier}.{name}")
        if least is None:  # these flights show no such change of any size
            continue
        (p,) = (p for p in effect.parameters if p.name == name)
        values = {name: p.neutral + sign * case["factor"] * least}
        if any(p.name == "rotor" for p in effect.parameters):
            values["rotor"] = float(rng.integers(1, 5))
        later = dc.replace(truth, changes=(effect(**values),))
        logs = _scattered(later, rng, TRAIN + 1, seconds, "since")
        result[effect.identifier] = verdict(diagnosis_of(logs), {effect.identifier: values})
    return result


def small_rows(results: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return a row for every effect and factor: cases, named alone, another alone, several."""
    rows = []
    for effect in ("nothing", *(kind.identifier for kind in SMALL)):
        for factor in FACTORS:
            cases = [r[effect] for r in results if r["factor"] == factor and effect in r]
            several = sum(len(case["causes"]) > 1 for case in cases)
            other = sum(len(case["causes"]) == 1 and not case["named"] for case in cases)
            counts = (len(cases), sum(case["named"] for case in cases), other, several)
            rows.append((effect, f"{factor:g}", *map(str, counts)))
    return rows


def diagnosed(case: Case, *, seconds: float) -> dict[str, Any]:
    """Fly a case {"seed", "kind", "file"} and return what changed and what the diagnosis says.

    Raises: FailedRun: if no vehicle of this seed can be flown.
    """
    truth, change, before, since = flown(**case, seconds=seconds)
    return {
        "mass": truth.vehicle.mass,
        "true": change,
        **verdict(diagnose(since[:TRAIN], since[TRAIN:], truth.known, before=before), change),
    }


def verdict(diagnosis: Diagnosis, change: Change) -> dict[str, Any]:
    """Return whether the causes since before are those that changed, and their sizes right: within
    their intervals or `CLOSE`.
    """
    causes = {c.identifier: c for c in diagnosis.causes if c.changed}
    named = set(causes) == set(change)
    sizes = [
        (causes[effect].parameters[p.name], values[p.name], p.neutral)
        for effect, values in change.items()
        for p in (effect_of(effect).parameters if named else ())
    ]
    right = named and all(
        abs(one.value - true) <= CLOSE * abs(true - neutral) or one.ci95[0] <= true <= one.ci95[1]
        for one, true, neutral in sizes
    )
    return {
        "named": named,
        "right": right,
        "causes": {
            name: {p: (e.value, *e.ci95) for p, e in c.parameters.items()}
            for name, c in causes.items()
        },
    }


def table_rows(results: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return a row for every kind of change: cases, and by vehicle file right names and sizes."""
    rows = []
    for kind in (*CHANGES, "all"):
        alike = [r for r in results if kind in (r["kind"], "all")]
        by_file = [[r for r in alike if r["file"] == file] for file in FILES]
        counts = [sum(r[key] for r in of) for of in by_file for key in ("named", "right")]
        rows.append((kind, str(len(by_file[0])), *map(str, counts)))
    return rows


def run(
    run: Run,
    pairs: Annotated[int, Option(min=1, max=1000, help="Vehicles; the change in turn.")] = 24,
    seconds: Annotated[float, Option(min=10.0, max=600.0, help="Length of a flight [s].")] = 12.0,
    small: Annotated[
        bool, Option("--small", help="Changes about the smallest that the flights would show.")
    ] = False,
) -> Report:
    """Simulated vehicles changed between flights, diagnosed from throttle logs. --out DIR: cases to
    resume from.
    """
    seeds = f"seeds {run.seed} … {run.seed + pairs - 1}"
    config: dict[str, Any] = {"pairs": pairs, "seconds": seconds, "small": small}
    if small:
        work = partial(small_changes, seconds=seconds)
        drawn = [
            {"seed": run.seed + number, "factor": factor}
            for number in range(pairs)
            for factor in FACTORS
        ]
        records = run.cases("diagnosing", "vehicles", work, drawn, config=config)
        results(records)
        judged = [{**r["case"], **r["result"]} for r in records if "result" in r]
        columns = ["changed", "over smallest", "cases", "named alone", "another", "several"]
        title = f"small changes since flights before; flights of {seconds:g} s, {seeds}"
        return Report(
            [(title, columns, small_rows(judged))],
            config=config,
            metrics={"runs": records},
            notes=failures(records),
        )
    cases = [
        {"seed": run.seed + number, "kind": KINDS[number % len(KINDS)], "file": file}
        for number in range(pairs)
        for file in FILES
    ]
    work = partial(diagnosed, seconds=seconds)
    records = run.cases("diagnosing", "vehicles", work, cases, config={"seconds": seconds})
    results(records)
    judged = [{**r["case"], **r["result"]} for r in records if "result" in r]
    title = (
        f"changes since flights before; {BEFORE} + {TRAIN} + 1 flights of {seconds:g} s, {seeds}"
    )
    columns = [f"{file}: {what}" for file in FILES for what in ("named", "size right too")]
    return Report(
        [(title, ["changed", "vehicles", *columns], table_rows(judged))],
        config=config,
        metrics={"runs": records},
        notes=failures(records),
    )
