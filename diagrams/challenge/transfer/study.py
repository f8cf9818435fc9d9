"""One vehicle: flown, diagnosed, and flown again with controllers made in several simulators."""

import dataclasses as dc
import functools
import math
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from typer import Option

from diagrams.batch.campaign import Case
from diagrams.batch.run import Report, Run, Table, failures, results
from diagrams.challenge.transfer import designs, reality
from diagrams.challenge.transfer.designs import Chosen, Design, Errors, chosen_in, flown, learned
from diagrams.challenge.transfer.reality import (
    diagnosed_flights,
    real_vehicle,
    simulator_settings,
    withheld_reality,
)
from diagrams.gap.corrected import corrected_simulator, drawn
from diagrams.loop.flight import FlightConfig
from diagrams.loop.reality import RealityConfig
from diagrams.studies.columns import tabulate
from diagrams.studies.options import FlownOptions, FlownRun, Seeds
from np_drake.diagnosis.diagnose import diagnose
from np_drake.mpc.solvers import require_solver
from np_drake.vehicle import Vehicle

SAMPLES = 3  # simulators of the posterior, in which together one controller is made [1]
NOMINAL, CORRECTED, SAMPLED = "nominal simulator", "corrected simulator", "posterior samples"
MADE_IN = (NOMINAL, CORRECTED, SAMPLED)  # where a controller is made
ORACLE = "oracle"
PLAIN = ("nominal", "hold", "observer", ORACLE)  # controllers that nobody makes
REAL = tuple(f"np: {kind}, real flights" for kind in designs.TRAINED)
ROWS = (*PLAIN, *MADE_IN, *REAL)
NOMINAL_SEED = 0  # of the noise in the nominal simulator, the same for all vehicles


@dc.dataclass(frozen=True)
class Transfer:
    """Work of a case {"seed"} -> errors of every row on the real vehicle, and as its own simulator
    foretold.

    solver: of the MPC.
    simulator: in which the real vehicle flies; controllers are made in Drake's.
    """

    solver: str
    simulator: str = "drake"

    def __call__(self, case: Case) -> dict:
        """Return {"withheld", "verdict", "errors": {row: [xy, z]}, "foretold": {row: [xy, z]},
        "chosen": {row: name}}.

        All errors in m; infinite, and null in a file, where the vehicle was lost.
        """
        seed, vehicle = case["seed"], Vehicle()
        withheld, real = withheld_reality(seed, vehicle), real_vehicle(self.simulator)
        train, held_out = diagnosed_flights(
            withheld, vehicle, solver=self.solver, seed=seed, real=real
        )
        found = diagnose(vehicle, train, held_out, adaptive_split=False)
        corrected = corrected_simulator(found, vehicle)
        samples = [config.reality for config in _drawn(corrected, seed)]
        fly = functools.partial(flown, solver=self.solver, seed=1000 + seed, real=real)
        with tempfile.TemporaryDirectory() as scratch:
            make = functools.partial(
                chosen_in, vehicle=vehicle, solver=self.solver, seed=20_000 + 10 * seed
            )
            made = {
                NOMINAL: _made_in_nominal(self.solver),
                CORRECTED: make([corrected.reality], folder=_folder(scratch, "corrected")),
                SAMPLED: make(samples, folder=_folder(scratch, "samples")),
            }
            taught = learned(train, vehicle, seed, _folder(scratch, "real"), delay=None)
            all_designs = [*map(Design, PLAIN), *(c.design for c in made.values()), *taught]
            designs_of = dict(zip(ROWS, all_designs, strict=True))
            errors = {
                row: fly(designs_of[row], withheld, vehicle) for row in rows_of(self.simulator)
            }
        return {
            "withheld": [entry.effect for entry in withheld.effects],
            "verdict": list(found.verdict),
            "errors": errors,
            "foretold": {row: choice.foretold for row, choice in made.items()},
            "chosen": {row: choice.design.kind for row, choice in made.items()},
        }


def rows_of(simulator: str) -> tuple[str, ...]:
    """Return the rows; none of an oracle for a vehicle whose own physics no effect of this project
    describes.
    """
    return ROWS if simulator == "drake" else tuple(row for row in ROWS if row != ORACLE)


def _folder(parent: str, name: str) -> Path:
    folder = Path(parent) / name
    folder.mkdir()
    return folder


@functools.cache
def _scratch() -> tempfile.TemporaryDirectory:
    """Return a folder that lives as long as this process."""
    return tempfile.TemporaryDirectory()


@functools.cache
def _made_in_nominal(solver: str) -> Chosen:
    """Return the controller of the nominal simulator, which is the same for all vehicles."""
    folder = _folder(_scratch().name, solver)
    return chosen_in(
        [RealityConfig().nominal()], Vehicle(), solver=solver, seed=NOMINAL_SEED, folder=folder
    )


def _drawn(corrected: FlightConfig, seed: int) -> list[FlightConfig]:
    """Return simulators of the posterior; the corrected one alone where nothing is uncertain."""
    certain = not corrected.reality.effects
    return [corrected] if certain else drawn(corrected, SAMPLES, seed)


def settings(solver: str, simulator: str = "drake") -> dict[str, Any]:
    """Return all that the results depend on other than the seed.
    Raises: ValueError: where the simulator is unknown or not installed.
    """
    return {
        "simulator": simulator_settings(simulator),
        "solver": solver,
        "withheld": reality.WITHHELD,
        "most": reality.MOST,
        "training": reality.TRAINING,
        "held_out": reality.HELD_OUT,
        "dither": reality.DITHER,
        "flown_with": reality.FLOWN_WITH,
        "track": designs.TRACK,
        "scored": designs.SCORED,
        "learned_on": designs.LEARNED_ON,
        "designs": [*designs.UNTRAINED, *designs.TRAINED],
        "samples": SAMPLES,
        "nominal_seed": NOMINAL_SEED,
    }


def table(results: Sequence[dict]) -> list[dict]:
    """Return a line for every row: quartiles of E_xy and median of E_z over the vehicles [m], and
    how many it lost.

    A lost vehicle counts as infinitely far off. chosen: how often each design was chosen.
    """
    lines = []
    for row in filter(results[0]["errors"].__contains__, ROWS):
        errors = np.array([_errors(r["errors"][row]) for r in results])
        lower, median, upper = np.quantile(
            errors[:, 0], [0.25, 0.5, 0.75], method="nearest"
        ).tolist()
        names = Counter(r["chosen"][row] for r in results if row in r["chosen"])
        line = {"row": row, "lower": lower, "median": median, "upper": upper}
        chosen = ", ".join(f"{name} {count}" for name, count in names.most_common())
        lost, E_z = int(np.isinf(errors[:, 0]).sum()), float(np.median(errors[:, 1]))
        lines.append(line | {"E_z": E_z, "lost": lost, "chosen": chosen})
    return lines


def gained(results: Sequence[dict]) -> dict[str, float]:
    """Return medians over the vehicles of what a diagnosis gains, of E_xy and of the error in space
    [1].

    fall: from the controller of the nominal simulator to that of the corrected one.
    over_real: the latter over the better of the predictors that were trained on real flights.
    foretold: |E_sim - E_real| / E_real.
    """
    found = {}
    for key, size in SIZES.items():
        found[f"fall of {key}"] = _median(
            1.0 - _ratio(size, r, CORRECTED, NOMINAL) for r in results
        )
        found[f"{key} over real flights"] = _median(
            max(_ratio(size, r, CORRECTED, row) for row in REAL) for r in results
        )
        for row in MADE_IN:
            found[f"{key} foretold by: {row}"] = _median(_off(size, r, row) for r in results)
    return found


Size = Callable[[Errors], float]
SIZES: dict[str, Size] = {
    "E_xy": lambda errors: errors[0],
    "E": lambda errors: float(np.hypot(*errors)),
}


def _errors(stored: Sequence[float | None]) -> Errors:
    """Return level and vertical error, infinite where the vehicle was lost [m]."""
    xy, z = (np.inf if value is None else value for value in stored)
    return xy, z


def _ratio(size: Size, result: dict, row: str, other: str) -> float:
    """Return the error of a row over that of another; NaN where both were lost."""
    a, b = (size(_errors(result["errors"][name])) for name in (row, other))
    return np.nan if np.isinf(a) and np.isinf(b) else a / b


def _off(size: Size, result: dict, row: str) -> float:
    """Return how far a simulator's error is from the real one; infinite where only one of them lost
    the vehicle.
    """
    sim, real = (size(_errors(result[kind][row])) for kind in ("foretold", "errors"))
    if np.isinf(sim) or np.isinf(real):
        return 0.0 if np.isinf(sim) and np.isinf(real) else np.inf
    return abs(sim - real) / real


def _median(values: Iterable[float]) -> float:
    known = [value for value in values if not np.isnan(value)]
    return float(np.quantile(known, 0.5, method="nearest")) if known else np.nan


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    seeds: Seeds = 40
    simulator: Annotated[
        str, Option(metavar="NAME", help="In which the real vehicle flies: drake | rotorpy.")
    ] = "drake"


def run(run: Run, options: Options) -> Report:
    """Vehicles with withheld effects: diagnosed, then flown by controllers of several simulators.

    A seed is a vehicle. It flies three times under `hold` and is diagnosed. In the nominal
    simulator, in the corrected one, and in draws from its posterior, predictors are trained, and of
    all controllers the one that flies the circle best there is flown on the vehicle. With rotorpy
    the vehicle has that simulator's rigid body, rotors, drag, lift and motor lag, and there is no
    oracle. --out DIR: cases to resume from.
    """
    run = FlownRun.of(run, options)
    require_solver(run.solver)
    config = settings(run.solver, options.simulator)
    cases = [{"seed": seed} for seed in run.seeds]
    flown = Transfer(run.solver, options.simulator)
    records = run.cases("closing", "vehicles", flown, cases, config=config)
    found = results(records)
    lines, gains = table(found), gained(found)
    seeds = f"seeds {run.seeds[0]} … {run.seeds[-1]}"
    return Report(
        _printed(
            lines, gains, f"{len(found)} vehicles in {options.simulator}, {seeds}, {run.solver}"
        ),
        config=config | {"seeds": run.seeds},
        metrics={"table": lines, "gains": gains, "runs": records},
        notes=failures(records),
    )


def _printed(lines: Sequence[dict], gains: dict[str, float], title: str) -> list[Table]:
    """Return the table of rows [cm], and that of the gains."""

    def centimetres(key: str):
        return lambda line: f"{100 * line[key]:.2f}" if math.isfinite(line[key]) else "lost"

    columns = (
        ("controller", "row"),
        ("E_xy, median [cm]", centimetres("median")),
        ("quarter", centimetres("lower")),
        ("three quarters", centimetres("upper")),
        ("E_z [cm]", centimetres("E_z")),
        ("lost", "lost"),
        ("chosen", "chosen"),
    )
    rows = [(name, f"{value:.3g}") for name, value in gains.items()]
    return [
        tabulate(title, lines, columns),
        ("medians over the vehicles", ["gain", "value [1]"], rows),
    ]
