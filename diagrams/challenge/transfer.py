"""Transfer of the controller from the corrected simulator: vehicles with withheld effects are
flown, diagnosed, and flown again with controllers made in several simulators.
"""

import dataclasses as dc
import functools
import math
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.batch.columns import tabulate
from diagrams.batch.flown import FlownOptions, FlownRun
from diagrams.batch.options import Seeds
from diagrams.batch.run import Report, Run
from diagrams.batch.workers import failures, results
from diagrams.challenge.draw import compatible, draw_effect
from diagrams.gap.corrected import corrected_simulator
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import LostVehicle, fly
from diagrams.loop.reality import RealityConfig
from np_drake.command_delay import LONGEST_DELAY
from np_drake.diagnosis.diagnose import diagnose
from np_drake.effects.effect_entry import EffectEntry
from np_drake.flight_log import FlightLog
from np_drake.lifting.model.lifted_model import LIFTED
from np_drake.lifting.model.model_file import save_model
from np_drake.lifting.training.train import make_config
from np_drake.mpc.solvers import require_solver
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.payload_filter.training import opened_logs, train_payload_filter
from np_drake.residual_models.predictor_training import train_on_flights
from np_drake.training_data.training_segments import Flight
from np_drake.vehicle import Vehicle

# Effects that a controller feels and that a flight of 20 s can hold; sensor errors are left to the
# challenge.
WITHHELD = (
    "suspended_payload",
    "mass_error",
    "thrust_scale",
    "thrust_drift",
    "weak_rotor",
    "center_of_mass_offset",
    "motor_lag",
    "command_delay",
    "linear_drag",
    "quadratic_drag",
    "constant_wind",
)
MOST = 3  # effects of a vehicle [1]
# Flights for the fit and the held-out one, and their scored time [s].
DIAGNOSED = (("training_circle", 20.0), ("lemniscate", 20.0), ("fast_lemniscate", 10.0))
DITHER = [0.08, 0.08, 0.04]  # RMS on every flight that is diagnosed, as on the training circle [m]
FLOWN_WITH = "hold"  # controller that needs no model, so that a vehicle as it came can be flown
SCORED = ("circle", 15.0)  # flight that is scored, and its length after the ramp [s]
LEARNED_ON = ("training_circle", 60.0)  # flight that is trained on in a simulator, and its length
STEP = 0.02  # of the predictors [s]
UNTRAINED = ("nominal", "hold", "observer")
TRAINED = ("np", PAYLOAD_FILTER)  # controllers with a predictor
PLAIN = (*UNTRAINED, "oracle")  # controllers that nobody makes
MADE_IN = NOMINAL, CORRECTED = ("nominal simulator", "corrected simulator")
REAL = tuple(f"np: {kind}, real flights" for kind in TRAINED)
ROWS = (*PLAIN, *MADE_IN, *REAL)
Errors = tuple[float, float]  # level and vertical RMS error [m]


def withheld_reality(seed: int, vehicle: Vehicle) -> RealityConfig:
    """Draw one to `MOST` effects that act at different places and can be told apart."""
    rng = np.random.default_rng([seed, 40])
    count, names = int(rng.integers(1, MOST + 1)), ()
    while not names or (count > 1 and not compatible(names)):
        names = tuple(rng.choice(WITHHELD, count, replace=False).tolist())
    effects = [effect for name in names for effect in draw_effect(name, rng, vehicle, 40.0)]
    entries = [EffectEntry.of(effect) for effect in effects]
    return dc.replace(RealityConfig().nominal(), effects=entries)


def experiment(
    flight: tuple[str, float], reality: RealityConfig, vehicle: Vehicle, *, kind: str, solver: str
) -> FlightConfig:
    """Return an experiment of the package, by its name and length after the ramp [s], in another
    reality under a kind of controller.
    """
    name, seconds = flight
    config = load_experiment(name, vehicle)
    config.controller.solver, config.controller.kind = solver, kind
    return dc.replace(config, reality=reality, duration=seconds).check_and_step()


@dc.dataclass(frozen=True)
class Design:
    """Controller that can be flown, of a kind of `ControllerConfig`.

    model: file of its predictor; empty without one.
    delay: of commands that it is told [s]; None: it estimates the delay in flight.
    """

    kind: str
    model: str = ""
    delay: float | None = 0.0

    def flown(self, world: RealityConfig, vehicle: Vehicle, *, solver: str, seed: int) -> Errors:
        """Return its errors in a world; infinite where the vehicle is lost."""
        config = experiment(SCORED, world, vehicle, kind=self.kind, solver=solver)
        controller = config.controller
        controller.predictor, controller.track_delay = self.model, self.delay is None
        controller.command_delay = min(self.delay or 0.0, LONGEST_DELAY * controller.period)
        try:
            metrics = fly(config.check(), seed=seed).metrics()
        except LostVehicle:
            return np.inf, np.inf
        return float(metrics["E_xy"]), float(metrics["E_z"])


def chosen_in(
    world: RealityConfig, vehicle: Vehicle, *, solver: str, seed: int, folder: Path
) -> tuple[Design, Errors]:
    """Train in a world, fly every design there, and return the one of least error in space with the
    errors that are foretold for it; it is told the world's delay.
    """
    config = experiment(LEARNED_ON, world, vehicle, kind=FLOWN_WITH, solver=solver)
    log = dc.replace(fly(config, seed=seed).log(), name=f"{LEARNED_ON[0]}_0")
    designs = [*map(Design, UNTRAINED), *learned([log], vehicle, seed, folder, delay=0.0)]
    found = [
        (
            dc.replace(design, delay=world.dead_time),
            design.flown(world, vehicle, solver=solver, seed=seed),
        )
        for design in designs
    ]
    return min(found, key=lambda pair: float(np.hypot(*pair[1])))


def learned(
    logs: Sequence[FlightLog], vehicle: Vehicle, seed: int, folder: Path, *, delay: float | None
) -> list[Design]:
    """Return the controllers with predictors that are trained on logs, written to a folder."""
    folder.mkdir()
    flights = [Flight(log, vehicle) for log in logs]
    lifted, filters = (folder / f"{kind}.safetensors" for kind in TRAINED)
    save_model(train_on_flights(flights, make_config(LIFTED, seed=seed), step=STEP).model, lifted)
    train_payload_filter(opened_logs(flights), step=STEP).save(filters)
    paths = (str(lifted), str(filters))
    return [Design(kind, path, delay) for kind, path in zip(TRAINED, paths, strict=True)]


@dc.dataclass(frozen=True)
class Transfer:
    """Work of a case {"seed"} -> errors of every row on the real vehicle, and as its own simulator
    foretold.
    """

    solver: str

    def __call__(self, case: Case) -> dict:
        """Return {"withheld", "verdict", "errors": {row: [xy, z]}, "foretold": {row: [xy, z]},
        "chosen": {row: name}}.

        All errors in m; infinite, and null in a file, where the vehicle was lost.
        """
        seed, vehicle, solver = case["seed"], Vehicle(), self.solver
        withheld, logs = withheld_reality(seed, vehicle), []
        for k, flight in enumerate(DIAGNOSED):
            config = experiment(flight, withheld, vehicle, kind=FLOWN_WITH, solver=solver)
            config.reference.dither = DITHER
            log = fly(config, seed=10 * seed + k).log()
            logs.append(dc.replace(log, name=f"{flight[0]}.csv"))
        train, held_out = logs[:-1], logs[-1:]
        found = diagnose(vehicle, train, held_out, adaptive_split=False)
        corrected = corrected_simulator(found, vehicle).reality
        with tempfile.TemporaryDirectory() as scratch:
            own, folder = 20_000 + 10 * seed, Path(scratch)
            made = {
                NOMINAL: _made_in_nominal(solver),
                CORRECTED: chosen_in(
                    corrected, vehicle, solver=solver, seed=own, folder=folder / "corrected"
                ),
            }
            taught = learned(train, vehicle, seed, folder / "real", delay=None)
            designs = [*map(Design, PLAIN), *(design for design, _ in made.values()), *taught]
            errors = {
                row: design.flown(withheld, vehicle, solver=solver, seed=1000 + seed)
                for row, design in zip(ROWS, designs, strict=True)
            }
        return {
            "withheld": [entry.effect for entry in withheld.effects],
            "verdict": list(found.verdict),
            "errors": errors,
            "foretold": {row: foretold for row, (_, foretold) in made.items()},
            "chosen": {row: design.kind for row, (design, _) in made.items()},
        }


@functools.cache
def _made_in_nominal(solver: str) -> tuple[Design, Errors]:
    """Return the controller of the nominal simulator, the same for all vehicles; its folder lives
    as long as this process.
    """
    folder = Path(_scratch().name) / solver
    world = RealityConfig().nominal()
    return chosen_in(world, Vehicle(), solver=solver, seed=0, folder=folder)


@functools.cache
def _scratch() -> tempfile.TemporaryDirectory:
    return tempfile.TemporaryDirectory()


def settings(solver: str) -> dict[str, Any]:
    """Return all that the results depend on other than the seed."""
    return {
        "solver": solver,
        "withheld": WITHHELD,
        "most": MOST,
        "diagnosed": DIAGNOSED,
        "dither": DITHER,
        "flown_with": FLOWN_WITH,
        "scored": SCORED,
        "learned_on": LEARNED_ON,
        "designs": [*UNTRAINED, *TRAINED],
    }


def table(found: Sequence[dict]) -> list[dict]:
    """Return a line for every row: quartiles of E_xy and median of E_z over the vehicles [m], and
    how many it lost, which count as infinitely far off. chosen: how often each design was.
    """
    lines = []
    for row in ROWS:
        errors = np.array([_errors(r["errors"][row]) for r in found])
        lower, median, upper = np.quantile(errors[:, 0], [0.25, 0.5, 0.75], method="nearest")
        names = Counter(r["chosen"][row] for r in found if row in r["chosen"])
        lines.append(
            {
                "row": row,
                "lower": float(lower),
                "median": float(median),
                "upper": float(upper),
                "E_z": float(np.median(errors[:, 1])),
                "lost": int(np.isinf(errors[:, 0]).sum()),
                "chosen": ", ".join(f"{name} {count}" for name, count in names.most_common()),
            }
        )
    return lines


def gained(found: Sequence[dict]) -> dict[str, float]:
    """Return medians over the vehicles of what a diagnosis gains in E_xy [1].

    fall: from the controller of the nominal simulator to that of the corrected one.
    over_real: the latter over the better of the predictors that were trained on real flights.
    foretold: |E_sim - E_real| / E_real.
    """
    xy = {row: np.array([_errors(r["errors"][row])[0] for r in found]) for row in ROWS}
    with np.errstate(invalid="ignore"):  # both lost the vehicle: unknown
        ratios = {
            "fall of E_xy": 1.0 - xy[CORRECTED] / xy[NOMINAL],
            "E_xy over real flights": xy[CORRECTED] / np.minimum(*(xy[row] for row in REAL)),
        }
        for row in MADE_IN:
            foretold = np.array([_errors(r["foretold"][row])[0] for r in found])
            off = np.abs(foretold - xy[row]) / np.where(np.isinf(xy[row]), 1.0, xy[row])
            ratios[f"E_xy foretold by: {row}"] = np.where(foretold == xy[row], 0.0, off)
    known = {name: values[~np.isnan(values)] for name, values in ratios.items()}
    return {n: float(np.quantile(v, 0.5, method="nearest")) for n, v in known.items() if len(v)}


def _errors(stored: Sequence[float | None]) -> Errors:
    """Return level and vertical error, infinite where the vehicle was lost [m]."""
    xy, z = (np.inf if value is None else value for value in stored)
    return xy, z


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    seeds: Seeds = 40


def run(run: Run, options: Options) -> Report:
    """Vehicles with withheld effects: diagnosed, then flown by controllers of several simulators.

    A seed is a vehicle. It flies three times under `hold` and is diagnosed. In the nominal and in
    the corrected simulator predictors are trained, and of all controllers the one that flies the
    circle best there is flown on the vehicle. --out DIR: cases to resume from.
    """
    run = FlownRun.of(run, options)
    require_solver(run.solver)
    config, cases = settings(run.solver), [{"seed": seed} for seed in run.seeds]
    records = run.cases("closing", "vehicles", Transfer(run.solver), cases, config=config)
    found = results(records)
    lines, gains = table(found), gained(found)

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
    title = f"{len(found)} vehicles, seeds {run.seeds[0]} … {run.seeds[-1]}, {run.solver}"
    rows = [(name, f"{value:.3g}") for name, value in gains.items()]
    told = ("medians over the vehicles", ["gain", "value [1]"], rows)
    return Report(
        [tabulate(title, lines, columns), told],
        config=config | {"seeds": run.seeds},
        metrics={"table": lines, "gains": gains, "runs": records},
        notes=failures(records),
    )
