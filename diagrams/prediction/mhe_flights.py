"""Moving-horizon estimator on the flights of the paper's estimation table."""

import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.batch.columns import grouped
from diagrams.batch.options import Neurobem
from diagrams.batch.run import Report, Run
from diagrams.batch.workers import every_result
from diagrams.prediction.array_flights import neurobem_folder
from np_drake.estimation.mhe_config import MheConfig
from np_drake.estimation.mhe_tuning import tune
from np_drake.estimation.motion import Motion, motion_from_attitude, motion_from_rates
from np_drake.estimation.moving_horizon import MheRun, run_mhe
from np_drake.estimation.moving_horizon_program import ProgramWindow
from np_drake.estimation.wrench_table import COLUMNS, PUBLISHED, column_rmse
from np_drake.logs.errors import LogError
from np_drake.logs.formats.neurobem import published_vehicle
from np_drake.logs.formats.neurobem_wrenches import (
    TRAINING,
    csv_of,
    read_training,
    read_wrenches,
    table_files,
)
from np_drake.logs.opening import open_flights
from np_drake.training_data.segments import WrenchSequence

PUBLISHED_ROW = "NeuroMHE"  # name of its row
NAIVE_ROW = "persistence"  # name of its row
RATES_ROW = "MHE, arrays"  # R and gravity from the arrays alone
ATTITUDE_ROW = "MHE, attitude"  # as logged in the CSV
_TIMED_ROWS = 400  # steps of the program that are timed and compared on each flight


@dc.dataclass(frozen=True)
class MheTable:
    """Errors of the estimator and run times of its two solvers.

    rows: flight, row, the ten columns, and of our rows `held`.
    step_time: median of the program on MathematicalProgram [s].
    exact_step_time: of the closed form [s].
    disagreement: the largest between the two [N, N·m].
    """

    rows: list[dict]
    step_time: float
    exact_step_time: float
    disagreement: float


def tuned_config(folder: Path) -> MheConfig:
    """Return the weights tuned on the paper's training segment, arrays alone.

    Raises: OSError, LogError: where it cannot be read.
    """
    sequence = read_training(folder)
    return tune(motion_from_rates(sequence, published_vehicle()), sequence.chi)


def mhe_table(run: Run, folder: Path, config: MheConfig, names: Sequence[str] = ()) -> MheTable:
    """Return the errors of every test flight: published, ours, persistence.

    Args:
        names: of the flights; none: all, see `table_files`.
    Raises: OSError, LogError: where a flight cannot be read; FailedRun: where one has no result.
    """
    files = {
        name: path
        for name, path in table_files(folder.resolve()).items()
        if not names or name in names
    }
    for path in files.values():  # before the long work
        _motions(path, read_wrenches(path))
    work, cases = Estimating(files, config), [{"flight": name} for name in files]
    settings = {"neurobem": folder.name, "mhe": dc.asdict(config)}
    flown = every_result(run.cases("real flights", "", work, cases, config=settings))
    return MheTable(
        [row for one in flown for row in one["rows"]],
        float(np.median([one["program"] for one in flown])),
        float(np.median([time for one in flown for time in one["exact"]])),
        max(one["disagreement"] for one in flown),
    )


@dc.dataclass(frozen=True)
class Estimating:
    """Work of a case {"flight": name} -> its rows, the times of both solvers and their
    disagreement.

    files: of the flights, by name, under the same path on every worker.
    """

    files: dict[str, Path]
    config: MheConfig

    def __call__(self, case: Case) -> dict[str, Any]:
        """Estimate the wrench along the flight of the case.

        Raises: OSError, LogError: where it cannot be read.
        """
        name, rows, exact = case["flight"], [], []
        sequence = read_wrenches(self.files[name])
        if name in PUBLISHED:
            rows.append(
                _row(
                    name,
                    PUBLISHED_ROW,
                    dict(zip(COLUMNS, PUBLISHED[name][PUBLISHED_ROW], strict=True)),
                )
            )
        for row, motion in _motions(self.files[name], sequence).items():
            run = run_mhe(motion, self.config)
            exact.append(run.step_time)
            rows.append(_row(name, row, column_rmse(run.wrench - sequence.chi), held=run.held))
        short = motion.first(_TIMED_ROWS)
        check: MheRun = run_mhe(short, self.config, ProgramWindow(self.config, short.step))
        rows.append(_row(name, NAIVE_ROW, column_rmse(np.diff(sequence.chi, axis=0))))
        differ = float(np.abs(check.wrench - run.wrench[: len(check.wrench)]).max())
        return {"rows": rows, "exact": exact, "program": check.step_time, "disagreement": differ}


def _row(flight: str, row: str, columns: dict[str, float], **rest: int) -> dict:
    return {"flight": flight, "row": row, **columns, **rest}


def _motions(file: Path, sequence: WrenchSequence) -> dict[str, Motion]:
    """Return motions by the name of the row; with the logged attitude where the flight's CSV is
    there.
    """
    vehicle = published_vehicle()
    motions = {RATES_ROW: motion_from_rates(sequence, vehicle)}
    path = csv_of(file)
    if path is not None:
        (log,), _ = open_flights(path)
        if len(log) != len(sequence) or np.abs(log.w - sequence.zeta[:, 3:]).max() > 1e-3:
            raise LogError(f"{path}: must hold the same rows as {file.name}.")
        motions[ATTITUDE_ROW] = motion_from_attitude(sequence, vehicle, log.q)
    return motions


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    neurobem: Neurobem = None


def run(run: Run, options: Options) -> Report:
    """A moving-horizon estimator on real flights. Those of the paper's estimation table."""
    folder = neurobem_folder("mhe", options.neurobem)
    with run.progress("tuning the weights") as advance:
        config = tuned_config(folder)
        advance(1.0)
    table = mhe_table(run, folder, config)
    of_flight = {
        flight: [
            (line["row"], *(f"{line[name]:.3f}" for name in COLUMNS))
            for line in table.rows
            if line["flight"] == flight
        ]
        for flight in dict.fromkeys(line["flight"] for line in table.rows)
    }
    title = "Wrench from the motion on real flights, RMSE [N, N·m]; NeuroMHE as published"
    times = {"program": table.step_time, "closed_form": table.exact_step_time}
    return Report(
        [grouped(title, ["", *COLUMNS], of_flight)],
        config={"training": TRAINING, "mhe": dc.asdict(config)},
        metrics={"table": table.rows, "step_time": times, "disagreement": table.disagreement},
        lines=[
            f"no random draw; tuned on the training segment: {config}",
            f"median time of a step: {1e3 * table.step_time:.3g} ms on MathematicalProgram, "
            f"{1e3 * table.exact_step_time:.2g} ms in closed form; they differ by "
            f"{table.disagreement:.1g} at most",
        ],
    )
