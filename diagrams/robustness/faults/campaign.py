"""Campaign of flights with random faults: one case a flight, and the oracle on the draw of every lost one."""

import dataclasses as dc
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from diagrams.batch.campaign import Case, Record
from diagrams.loop.controllers import NP_MODEL
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import LostVehicle, simulate
from diagrams.robustness.faults.fault import Fault, apply
from diagrams.robustness.faults.kinds import APART, FIRST, KIND, KINDS, draw_faults
from diagrams.robustness.faults.measures import BACK, LOST, measures
from diagrams.robustness.robustness import Sweep, model_digests
from diagrams.tracking.tracking import ROWS as TRACKING_ROWS
from diagrams.tracking.tracking import Row, configure, frozen_weights
from np_drake.residual_models.motion_model import REACTIONS

RAMP, DURATION = 2.0, 6.0  # of a flight, and after its ramp [s]
HEIGHT = 2.4  # of the circle [m]
ORACLE = "oracle"
_FLOWN = ("nominal", "observer", "hold", "gp", "knode", "np", "payload_filter", ORACLE)
ROWS = (
    *(next(row for row in TRACKING_ROWS if row.name == name) for name in _FLOWN[:-1]),
    Row("cascade", "cascade"),
    next(row for row in TRACKING_ROWS if row.name == ORACLE),
)
TRAINED = tuple(row for row in ROWS if row.configuration in REACTIONS)  # the others are packaged
PLACES = tuple(dict.fromkeys(kind.place for kind in KINDS))
Progress = Callable[[int, int], None]


def row_of(name: str) -> Row:
    """Return the row of that name."""
    return next(row for row in ROWS if row.name == name)


def reaching(row: Row) -> tuple[str, ...]:
    """Return the places of faults that can reach the controller of a row; a cascade solves nothing."""
    return tuple(place for place in PLACES if place != "solver" or row.kind != "cascade")


def fault_cases(seeds: Sequence[int], rows: Sequence[Row], models: dict[str, bytes]) -> list[Case]:
    """Return a case a seed: a row and its faults, all drawn from the seed.

    Args: models: content of the model files that were trained, by configuration.
    """
    digests, cases = model_digests(models), []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        row = rows[int(rng.integers(len(rows)))]
        faults = [dc.asdict(fault) for fault in draw_faults(rng, reaching(row))]
        model = digests.get(row.configuration, "")
        cases.append({"row": row.name, "model": model, "faults": faults, "seed": seed})
    return cases


def flight_config(row: Row, *, solver: str, model: str = "") -> FlightConfig:
    """Return the circle of a row, without faults.

    Args: model: file of a row that is trained.
    """
    file = str(NP_MODEL) if row.kind == "np" else model
    config = configure("circle", row, solver=solver, model=file)
    config.reference.ramp, config.reference.height, config.duration = RAMP, HEIGHT, DURATION
    return config.check()


def case_faults(case: Case) -> list[Fault]:
    """Return the faults of a case."""
    return [Fault(**fault) for fault in case["faults"]]


@dc.dataclass(frozen=True)
class Flying:
    """Work of a flight: case -> `measures`.

    models: content of the trained model files by configuration.
    """

    models: dict[str, bytes]
    solver: str

    def __call__(self, case: Case) -> dict:
        """Fly the case and return its measures."""
        row = row_of(case["row"])
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.safetensors"
            if row.configuration in self.models:
                path.write_bytes(self.models[row.configuration])
            return self._flown(case, flight_config(row, solver=self.solver, model=_named(path)))

    def _flown(self, case: Case, config: FlightConfig) -> dict:
        faults = case_faults(case)
        config, acting = apply(config, [KIND[fault.kind].make(fault, config) for fault in faults])
        onset, why = min(fault.onset for fault in faults), ""
        try:
            signals = simulate(config, seed=case["seed"], faults=acting, tolerance=LOST)
        except LostVehicle as error:
            signals, why = error.signals, str(error)
        return measures(signals, onset=onset, why=why)


def _named(path: Path) -> str:
    return str(path) if path.exists() else ""


def lost(record: Record) -> bool:
    """Return whether the vehicle of a flight with a result was lost."""
    return "result" in record and record["result"]["lost_at"] is not None


def oracle_cases(records: Sequence[Record]) -> list[Case]:
    """Return the draw of every lost flight with the oracle in place of its controller."""
    return [
        {**record["case"], "row": ORACLE, "model": ""}
        for record in records
        if lost(record) and record["case"]["row"] != ORACLE
    ]


def run_faults(
    sweep: Sweep,
    *,
    seeds: Sequence[int],
    rows: Sequence[Row] = ROWS,
    on_training: Progress,
    on_progress: Progress,
    on_oracle: Progress,
) -> tuple[list[Record], list[Record], list[Record]]:
    """Train what `rows` need, fly every seed, and fly the oracle on the draws of the lost ones.

    Returns: the records of trainings, flights and oracle flights. Rows whose training failed do not fly.
    """
    wanted = [row for row in rows if row in TRAINED]
    trainings, models, able = sweep.train(wanted, on_training) if wanted else ([], {}, [])
    flying = [row for row in rows if row not in TRAINED or row in able]
    work, config = Flying(models, sweep.solver), campaign_config(sweep.training_seed, sweep.solver)
    flights = sweep.run(work, fault_cases(seeds, flying, models), on_progress, config)
    beside = sweep.run(work, oracle_cases(flights), on_oracle, config)
    return trainings, flights, beside


def campaign_config(training_seed: int, solver: str) -> dict:
    """Return all that the results depend on other than the case itself."""
    base = flight_config(row_of("nominal"), solver=solver)
    return {
        "solver": solver, "training_seed": training_seed, "mpc": frozen_weights(),
        "reality": dc.asdict(base.reality), "reference": dc.asdict(base.reference), "duration": DURATION,
        "first": FIRST, "apart": APART, "lost": LOST, "back": BACK, "kinds": {kind.name: kind.says for kind in KINDS},
    }  # fmt: skip
