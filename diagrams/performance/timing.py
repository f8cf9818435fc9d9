"""Run time of one period of every controller: recorded flights, replayed with a clock.

The clock is the process's own processor time, which other programs on the same machine influence
least.
"""

import dataclasses as dc
import time
from collections.abc import Callable

import numpy as np

from diagrams.batch.columns import fixed, tabulate
from diagrams.batch.flown import choose_rows
from diagrams.batch.options import Only
from diagrams.batch.run import Report, Run, Table
from diagrams.loop.controller_config import LEARNED
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.payload.hover_swing import ROWS as HOVER_ROWS
from diagrams.payload.hover_swing import HoverRow, configure_row
from diagrams.performance.control_loop import ControlLoop, replayed
from diagrams.tracking.tracking import train_models
from np_drake.mpc.problem import MpcStatus

TRACK = "lemniscate"  # experiment that is flown
TRAINING = "training_circle"  # experiment that predictors are trained on
RATES = (50, 100)  # of the control loop [1/s]
PAPER = {
    "predict": 5.0,
    "solve": 10.0,
}  # upper limits on an i5-1135G7 [ms]. Source: Jin et al. 2025
SOLVERS = ("sqp", "ipopt")  # that are timed
_WARM_UP = 20  # periods that are replayed and not counted [1]
_BLOCK = 20  # periods between two runs of the reference calculation [1]
_REFERENCE_RUNS = 5  # in a row [1]

ROWS = (
    HoverRow("nominal", "nominal"),
    HoverRow("hold", "hold"),
    HoverRow("observer", "observer"),
    HoverRow("np: paper", "np", training=TRAINING, configuration="paper"),
    *(row for row in HOVER_ROWS if row.kind in LEARNED),
)


@dc.dataclass(frozen=True)
class Spent:
    """Processor times of the replayed periods, (n,) each [ms].

    reference: of the reference calculation.   failures: of the solver.
    """

    predict: np.ndarray
    solve: np.ndarray
    reference: np.ndarray
    failures: int


_WINDOW = np.random.default_rng(0).normal(size=(40, 30))  # samples, columns


def _reference_time() -> float:
    """Return the processor time of a pseudo-inverse of the window, the cost of an unoptimised refit
    [s].
    """
    start = time.process_time()
    np.linalg.pinv(_WINDOW)
    return time.process_time() - start


def timing_config(row: HoverRow, *, periods: int, solver: str, model: str = "") -> FlightConfig:
    """Return the lemniscate from the end of the ramp on.

    Args:
        periods: of the controller that are flown [1].
    """
    config = configure_row(TRACK, row, solver=solver, model=model)
    config.duration = periods * config.controller.period
    return config.check()


def record(row: HoverRow, *, periods: int, model: str, seed: int) -> FlightResult:
    """Fly the flight that is replayed, with SQP.

    Args:
        periods: of the controller that are flown [1].
    """
    return fly(timing_config(row, periods=periods, solver="sqp", model=model), seed=seed)


def replay(flight: FlightResult, solver: str) -> Spent:
    """Feed the recorded readings to label filter, residual model and MPC, one period after the
    other.
    """
    scored = int(np.argmax(flight.scored))
    first = max(scored - _WARM_UP, 1)
    reference: list[float] = []

    def compare(k: int) -> None:
        if k >= scored and k % _BLOCK == 0:
            reference.extend(_reference_time() for _ in range(_REFERENCE_RUNS))

    times, status = replayed(ControlLoop(flight, solver), first, time.process_time, after=compare)
    counted = slice(scored - first, None)
    predict, solve = 1e3 * np.diff(times[counted]).T
    failures = int(np.sum(status[counted] >= MpcStatus.SQP_FALLBACK))
    return Spent(predict, solve, 1e3 * np.array(reference), failures)


def timing_line(row: str, solver: str, spent: Spent) -> dict:
    """Return one line of the table: medians and 95 % quantiles [ms], CPU load by rate [1], ratios
    to the reference [1].
    """
    total, base = spent.predict + spent.solve, float(np.median(spent.reference))
    line: dict = {
        "row": row,
        "solver": solver,
        "periods": len(total),
        "failures": spent.failures,
        "reference": base,
    }
    for name, values in (("predict", spent.predict), ("solve", spent.solve)):
        line[name], line[f"{name}_p95"] = float(np.median(values)), float(np.quantile(values, 0.95))
        line[f"{name}_ratio"] = line[name] / base
    for rate in RATES:
        load = total * rate / 1e3
        line[f"load_{rate}"], line[f"load_{rate}_p95"] = (
            float(np.median(load)),
            float(np.quantile(load, 0.95)),
        )
    return line


def timing_table(
    models: dict[tuple[str, str], str],
    *,
    periods: int,
    seed: int,
    rows: tuple[HoverRow, ...],
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[dict]:
    """Return one line a controller and solver, in one process.

    Args:
        models: files by (training, configuration).
        periods: that are replayed, of each [1].
    """
    lines = []
    for number, row in enumerate(rows):
        flight = record(
            row, periods=periods, model=models.get((row.training, row.configuration), ""), seed=seed
        )
        lines += [timing_line(row.name, solver, replay(flight, solver)) for solver in SOLVERS]
        on_progress(number + 1, len(rows))
    return lines


PERIODS = 250  # of the timing table [1]


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    only: Only = None


def run(run: Run, options: Options) -> Report:
    """What a period costs. As ratios to a reference calculation in the same run."""
    rows, flight_seed = choose_rows(ROWS, options.only), run.seed + 1
    with run.counting("timing", "controllers") as on_progress:
        models = train_models(rows, run.folder, seed=run.seed, solver="sqp")
        lines = timing_table(
            models, periods=PERIODS, seed=flight_seed, rows=rows, on_progress=on_progress
        )
    mpc = dc.asdict(timing_config(rows[0], periods=PERIODS, solver="sqp").controller.mpc)
    title = f"{PERIODS} periods of the {TRACK}, seed {flight_seed}, np trained on seed {run.seed}"
    config = {"track": TRACK, "periods": PERIODS, "mpc": mpc}
    return Report(
        [timing_printed(lines, f"{title}; median / 95 % quantile")],
        config=config | {"training_seed": run.seed, "flight_seed": flight_seed},
        metrics={"table": lines},
        notes=[
            "processor time of one process; ratio: to the pseudo-inverse of a 40 x 30 "
            "matrix in the same run "
            f"({lines[0]['reference']:.3f} ms); paper: lift and refit < {PAPER['predict']:g} ms, "
            f"solve < {PAPER['solve']:g} ms on an i5-1135G7.",
            f"MPC of the first row: {mpc}",
        ],
    )


def timing_printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines that `timing_table` gives."""

    def pair(key: str, digits: int, factor: float = 1.0):
        return lambda line: (
            f"{factor * line[key]:.{digits}f} / {factor * line[f'{key}_p95']:.{digits}f}"
        )

    columns = (
        ("controller", "row"),
        ("solver", "solver"),
        ("predict [ms]", pair("predict", 2)),
        ("ratio", fixed("predict_ratio", 1)),
        ("solve [ms]", pair("solve", 1)),
        ("ratio", fixed("solve_ratio", 0)),
        *((f"load at {rate} Hz [%]", pair(f"load_{rate}", 0, 100)) for rate in RATES),
        ("failed", "failures"),
    )
    return tabulate(title, lines, columns)
