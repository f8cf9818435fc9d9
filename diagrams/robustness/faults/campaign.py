"""Campaign of flights with random faults: one case a flight, and the oracle on the draw of every lost one."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from diagrams.batch.campaign import Case, Record
from diagrams.loop.controller_config import NP_MODEL
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import LostVehicle, simulate
from diagrams.robustness.faults.fault import Fault, apply
from diagrams.robustness.faults.kinds import APART, FIRST, KIND, KINDS, draw_faults
from diagrams.robustness.robustness import Sweep
from diagrams.tracking.model_files import digest_of, model_path
from diagrams.tracking.tracking import ROWS as TRACKING_ROWS
from diagrams.tracking.tracking import Row, configure, frozen_weights, named
from np_drake import attitude
from np_drake.mpc.problem import MpcStatus
from np_drake.residual_models.motion_model import REACTIONS
from np_drake.rigid_body import Q

RAMP, DURATION = 2.0, 6.0  # of a flight, and after its ramp [s]
HEIGHT = 2.4  # of the circle [m]
LOST = 2.0  # distance from the reference beyond which a vehicle counts as lost: the circle's diameter; own choice [m]
BACK = 0.3  # distance within which it has recovered; every controller is nearer before a fault; own choice [m]
ENDED = "the simulation ended"  # of the line of a flight whose integrator gave up
ORACLE = "oracle"
_FLOWN = ("nominal", "observer", "hold", "gp", "knode", "np", "payload_filter")
ROWS = (*(named(TRACKING_ROWS, name) for name in _FLOWN), Row("cascade", "cascade"), named(TRACKING_ROWS, ORACLE))
TRAINED = tuple(row for row in ROWS if row.configuration in REACTIONS)  # the others are packaged
PLACES = tuple(dict.fromkeys(kind.place for kind in KINDS))


def reaching(row: Row) -> tuple[str, ...]:
    """Return the places of faults that can reach the controller of a row; a cascade solves nothing."""
    return tuple(place for place in PLACES if place != "solver" or row.kind != "cascade")


def fault_cases(seeds: Sequence[int], rows: Sequence[Row], models: dict[str, bytes]) -> list[Case]:
    """Return a case a seed: a row and its faults, all drawn from the seed.

    Args:
        seeds: of the flights.
        rows: that can fly.
        models: content of the model files that were trained, by configuration.
    """
    cases = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        row = rows[int(rng.integers(len(rows)))]
        faults = [dc.asdict(fault) for fault in draw_faults(rng, reaching(row))]
        model = digest_of(models.get(row.configuration))
        cases.append({"row": row.name, "model": model, "faults": faults, "seed": seed})
    return cases


def flight_config(row: Row, *, solver: str, model: str = "") -> FlightConfig:
    """Return the circle of a row, without faults.

    Args:
        row: of the table.
        solver: of its controller.
        model: file of a row that is trained.
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
        row = named(ROWS, case["row"])
        with model_path(self.models.get(row.configuration)) as model:
            return self._flown(case, flight_config(row, solver=self.solver, model=model))

    def _flown(self, case: Case, config: FlightConfig) -> dict:
        faults = case_faults(case)
        config, acting = apply(config, [KIND[fault.kind].make(fault, config) for fault in faults])
        onset, why = min(fault.onset for fault in faults), ""
        try:
            signals = simulate(config, seed=case["seed"], faults=acting, tolerance=LOST)
        except LostVehicle as error:
            signals, why = error.signals, str(error)
        return measures(signals, onset=onset, why=why)


def measures(signals: dict[str, np.ndarray], *, onset: float, why: str = "") -> dict:
    """Return the measures of a flight.

    Args:
        signals: in the form of `Recorder.read`.
        onset: of the first fault [s].
        why: the simulator's line, where it ended the flight.
    Returns: lost_at [s] or None, `lost`: the line; gave_up: whether the integrator ended it; nan_commands: periods with
        a command that is not finite; recovery: time from the onset to the last moment farther than `BACK` from the
        reference [s], 0 where it never was, None where it is not back at the end; before: largest error before the
        onset [m]; peak: largest after it [m]; tilt: largest [rad]; fallbacks: periods without a new plan.
    """
    t, x = signals["t"], signals["x_true"]
    error = np.linalg.norm(x[:, :3] - signals["p_ref"], axis=1)
    far, after = ~(error < LOST), t >= onset  # NaN is far
    lost = bool(why) or bool(far.any())
    away = np.flatnonzero(after & ~(error < BACK))
    recovery: float | None = float(t[away[-1]] - onset) if len(away) else 0.0
    if lost or (len(away) and away[-1] == len(t) - 1):
        recovery = None
    return {
        "lost_at": float(t[np.argmax(far)] if far.any() else t[-1]) if lost else None,
        "lost": why,
        "gave_up": ENDED in why,
        "nan_commands": int(np.sum(~np.isfinite(signals["u"]).all(axis=1))),
        "recovery": recovery,
        "before": float(error[~after].max(initial=0.0)),
        "peak": float(error[after].max(initial=0.0)),
        "tilt": float(np.arccos(np.clip(attitude.body_z(x[:, Q])[:, 2], -1.0, 1.0)).max()),
        "fallbacks": int(np.sum(signals["status"][:, 0] >= MpcStatus.SHIFTED_PLAN)),
    }


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


def run_faults(sweep: Sweep, rows: Sequence[Row]) -> tuple[list[Record], list[Record], list[Record]]:
    """Train what `rows` need, fly every seed, and fly the oracle on the draws of the lost ones.

    Args:
        sweep: seeds, workers and progress.
        rows: of the table.
    Returns: the records of trainings, flights and oracle flights. Rows whose training failed do not fly.
    """
    trainings, models, able = sweep.train([row for row in rows if row in TRAINED])
    flying = [row for row in rows if row not in TRAINED or row in able]
    work, config = Flying(models, sweep.solver), campaign_config(sweep.seed, sweep.solver)
    flights = sweep.cases("faults", "flights", work, fault_cases(sweep.seeds, flying, models), config=config)
    lost_ones = oracle_cases(flights)
    beside = sweep.cases("oracle", "flights on the draws of lost ones", work, lost_ones, config=config)
    return trainings, flights, beside


def campaign_config(training_seed: int, solver: str) -> dict:
    """Return all that the results depend on other than the case itself.

    Args:
        training_seed: of training flight and training.
        solver: of every controller.
    """
    base = flight_config(named(ROWS, "nominal"), solver=solver)
    return {
        "solver": solver, "training_seed": training_seed, "mpc": frozen_weights(),
        "reality": dc.asdict(base.reality), "reference": dc.asdict(base.reference), "duration": DURATION,
        "first": FIRST, "apart": APART, "lost": LOST, "back": BACK, "kinds": {kind.name: kind.says for kind in KINDS},
    }  # fmt: skip
