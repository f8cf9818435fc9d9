"""The sweep of all studies: rows x scenarios x seeds, flown with models that are trained once.

A row is a controller, what it is told and what it was trained on. Model files travel by their
content, trainings and flights are the cases of a campaign. A `Comparison` flies experiments as they
are; other studies say how a case becomes a flight.
"""

import base64
import dataclasses as dc
import hashlib
import tempfile
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import pandas as pd

from diagrams.batch.run import Case, FailedRun, Record, Run, results
from diagrams.evidence.studies.options import DEFAULT_SOLVER, chosen
from diagrams.loop.controller_config import FILTER_MODEL, LEARNED
from diagrams.loop.experiments import load_experiment, scenario_file, settings_of
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.training import train_model
from np_drake.files.file_access import write_bytes
from np_drake.metrics import half_width
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.vehicle import Vehicle, load_vehicle

# experiments that are trained on
PLAIN = "plain_circle"
DITHERED = "training_circle"
Key = tuple[str, str]  # training experiment and configuration
Models = dict[Key, bytes]  # content of the model files


@dc.dataclass(frozen=True, kw_only=True)
class FlownRun(Run):
    """Run that flies the seeds after `seed`, which the training flight draws.

    count: flights a row.
    reality, vehicle: scenario file that is flown in and vehicle that flies, where not the paper's.
    """

    count: int = 5
    solver: str = DEFAULT_SOLVER
    reality: Path | None = None
    vehicle: str = ""

    @property
    def seeds(self) -> list[int]:
        """Seeds of the evaluation flights."""
        return [self.seed + 1 + k for k in range(self.count)]

    @property
    def settings(self) -> dict[str, Any]:
        """Solver and seeds, as `--json` holds them."""
        return {"solver": self.solver, "seeds": self.seeds, "training_seed": self.seed}

    @property
    def world(self) -> dict[str, Any]:
        """Arguments of `configure` and `training_config`; the file's path is absolute, as workers
        may have another folder.
        """
        return {
            "solver": self.solver,
            "reality": self.reality and scenario_file(self.reality).resolve(),
            "vehicle": load_vehicle(self.vehicle) if self.vehicle else None,
        }

    def title(self) -> str:
        """Return the title of a table: flights, seeds, what is trained, training seed, solver."""
        return (
            f"{self.count} flights a row, seeds {self.seeds[0]} … {self.seeds[-1]}, "
            f"trained on seed {self.seed}, {self.solver}"
        )


@dc.dataclass(frozen=True)
class Row:
    """One row of a table: a controller, what it is given, and what its predictor was trained on.

    kind: see `ControllerConfig`.
    known_mass: whether controller and estimator know the payload's mass.
    """

    name: str  # of the row
    kind: str
    known_mass: bool = False
    training: str = ""  # experiment that the predictor is trained on
    configuration: str = ""  # of the predictor; gp, knode: their own name
    weight_swing: float = 0.0  # of the controller on the predicted swing [1/N²]
    weight_rate: float | None = None  # on body rates; None: the frozen weight [s²/rad²]

    @property
    def key(self) -> Key:
        """What the row's model is known by."""
        return self.training, self.configuration


def named(rows: Sequence[Row], name: str) -> Row:
    """Return the row of that name."""
    return next(row for row in rows if row.name == name)


def choose_rows(
    rows: Sequence[Row], only: Collection[str] | None, always: Collection[str] = ("nominal",)
) -> tuple[Row, ...]:
    """Return the rows of these names and those of `always`; all where no name is given.

    Raises: ValueError: on an unknown name.
    """
    names = chosen("--only", only, [row.name for row in rows])
    return tuple(row for row in rows if row.name in {*names, *always})


def configure(
    track: str,
    row: Row,
    *,
    solver: str,
    model: str = "",
    vehicle: Vehicle | None = None,
    reality: Path | None = None,
) -> FlightConfig:
    """Return the experiment `track` with the controller of `row`.

    Args:
        vehicle: to which it is scaled; None: the paper's.
        reality: scenario file that it is flown in, see `load_experiment`.
    """
    config = load_experiment(track, vehicle, reality)
    controller = config.controller
    controller.kind = row.kind
    controller.solver = solver
    controller.predictor = model if row.kind in LEARNED else ""
    controller.mpc.weight_swing = row.weight_swing
    if row.weight_rate is not None:
        controller.mpc.weight_rate = [row.weight_rate] * 3
    if row.known_mass:
        controller.extra_mass = config.reality.hung.mass
    return config.check()


def training_config(
    experiment: str, *, solver: str, vehicle: Vehicle | None = None, reality: Path | None = None
) -> FlightConfig:
    """Return the flight that a predictor learns from, under the nominal MPC: 60 s of any vehicle;
    arguments as of `configure`.
    """
    config = load_experiment(experiment, vehicle, reality)
    config.duration = load_experiment(experiment).duration
    config.controller.kind = "nominal"
    config.controller.solver = solver
    return config


def train_row(row: Row, path: Path, *, seed: int, **how) -> None:
    """Train the model of a row and write its file; further arguments of `training_config`."""
    flight = fly(training_config(row.training, **how), seed=seed)
    train_model(flight, path, row.configuration, seed=seed)


@cache  # a case of thousands asks for it
def digest_of(content: bytes | None) -> str:
    """Return the digest of a model file, by which a case names it; empty without one."""
    return "" if content is None else hashlib.sha256(content).hexdigest()[:16]


def _trained(case: Case, **how) -> dict:
    """Return {"file": model file in base 64} of a case {"model": configuration, "training":
    experiment}; further arguments of `train_row`.
    """
    row = Row("", "", training=case["training"], configuration=case["model"])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        train_row(row, path, **how)
        return {"file": base64.b64encode(path.read_bytes()).decode()}


RowWork = Callable[[Case, Row, str], dict]  # of a case, its row and the path of its model


def _with_model(case: Case, flight: RowWork, rows: Sequence[Row], models: Models) -> dict:
    """Return what `flight(case, row, path of its model)` returns; the path is empty without one."""
    row = named(rows, case["row"])
    if row.key not in models:
        return flight(case, row, "")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        path.write_bytes(models[row.key])
        return flight(case, row, str(path))


def fly_rows(
    run: FlownRun,
    title: str,
    rows: Sequence[Row],
    scenarios: Sequence[dict],
    flight: RowWork,
    *,
    config: dict,
) -> tuple[list[Record], list[Record]]:
    """Train what `rows` need, write the model files into the folder of the run, then fly every row
    in every scenario, which names its seed.

    A case names its model by the digest of its file, so that no result of another one is taken for
    it. Rows whose training failed do not fly.

    Args:
        flight: work of a case, its row and the path of its model.
        config: all that the flights depend on other than the case, `run` and the trainings.
    Returns: the records of the trainings and of the flights.
    """
    keys = list(dict.fromkeys(row.key for row in rows if row.training))
    config = {
        **config,
        "solver": run.solver,
        "training_seed": run.seed,
        "trainings": {
            name: settings_of(training_config(name, **run.world)) for name in (PLAIN, DITHERED)
        },
    }
    # whose bank `payload_filter` takes
    prior = {"prior": digest_of(FILTER_MODEL.read_bytes())}
    cases = [
        {"model": configuration, "training": training}
        | (prior if configuration == PAYLOAD_FILTER else {})
        for training, configuration in keys
    ]
    train = partial(_trained, seed=run.seed, **run.world)
    trainings = run.cases("training", "models", train, cases, config=config)
    models = {
        key: base64.b64decode(record["result"]["file"])
        for key, record in zip(keys, trainings, strict=True)
        if "result" in record
    }
    for (training, configuration), content in models.items():
        write_bytes(run.folder / f"{configuration}_{training}.safetensors", content)
    flights = [
        {"row": row.name, "model": digest_of(models.get(row.key)), **scenario}
        for row in rows
        if not row.training or row.key in models
        for scenario in scenarios
    ]
    work = partial(_with_model, flight=flight, rows=rows, models=models)
    return trainings, run.cases(title, "flights", work, flights, config=config)


@dc.dataclass(frozen=True)
class Comparison:
    """Rows that fly the same experiments with the same seeds.

    measures: of a flight, as far as JSON knows them; `metrics` are those of its table, and what is
        drawn alone stands under `drawn`.
    lost: metrics of a lost vehicle; without any its case has failed.
    """

    name: str
    experiments: tuple[str, ...]
    measures: Callable[[FlightResult], dict]
    lost: dict[str, float] = dc.field(default_factory=dict)

    def fly(self, run: FlownRun, rows: Sequence[Row]) -> list[dict]:
        """Return the results of all flights: {"row", "experiment", "seed"}, and the measures or
        why the vehicle was "lost".
        """
        first = {e: settings_of(configure(e, rows[0], **run.world)) for e in self.experiments}
        scenarios = [
            {"experiment": e, "seed": seed} for e in self.experiments for seed in run.seeds
        ]
        work = partial(self.flown, **run.world)
        _, records = fly_rows(run, self.name, rows, scenarios, work, config={"flown": first})
        return [{"metrics": self.lost, **result} for result in results(records)]

    def flown(self, case: Case, row: Row, model: str, **world: Any) -> dict:
        """Return the result of a case; a lost vehicle is one: another try would lose it too."""
        experiment = case["experiment"]
        head = {"row": row.name, "experiment": experiment, "seed": case["seed"]}
        try:
            flight = fly(configure(experiment, row, model=model, **world), seed=case["seed"])
        except FailedRun as error:
            if not self.lost:
                raise
            return {**head, "controller": row.kind, "lost": str(error)}
        return {**head, **self.measures(flight)}

    def controllers(self, run: FlownRun, rows: Sequence[Row], model: str) -> dict[str, dict]:
        """Return the controller of each row as `--json` holds it; `model` stands for its file."""
        experiment = self.experiments[0]
        files = {row: row.training and model.format(row.training) for row in rows}
        return {
            row.name: dc.asdict(configure(experiment, row, model=file, **run.world).controller)
            for row, file in files.items()
        }


def summaries(
    runs: Sequence[dict], keys: Sequence[str], cuts: Sequence[str]
) -> Iterator[tuple[pd.DataFrame, dict]]:
    """Yield the metrics of the flights of a row in an experiment, one a line, and their summary:
    means with 95 % intervals, what `cuts` fall short of the nominal row's, failed solves.
    """
    flights = pd.DataFrame([{**run, **run["metrics"]} for run in runs])
    groups = dict(list(flights.groupby(["row", "experiment"], sort=False)))
    for (row, experiment), group in groups.items():
        line: dict[str, Any] = {"row": row, **means(group, keys)}
        if (base := groups.get(("nominal", experiment))) is not None:
            line |= {f"{key}_cut": 1.0 - line[key] / base[key].mean() for key in cuts}
        yield group, line | {"solve_failures": group["solve_failures"].sum()}


def tidy(records: Sequence[Record]) -> pd.DataFrame:
    """Return a line for every flight: its case, its result, and `error` where it has none."""
    return pd.DataFrame(
        [{**r["case"], **r.get("result", {}), "error": r.get("error", "")} for r in records]
    )


def means(flights: pd.DataFrame, keys: Sequence[str]) -> dict[str, float]:
    """Return the mean of each column and, as `…_ci95`, half of its 95 % interval (Student)."""
    line: dict[str, float] = {}
    for key in keys:
        values = flights[key].to_numpy(float)
        line |= {key: values.mean(), f"{key}_ci95": half_width(values)}
    return line
