"""Study `timing`: run time of one period of every controller, recorded flights replayed with a
clock.

The clock is the process's own processor time, which other programs on the same machine influence
least.
"""

import dataclasses as dc
import time
from typing import Any

import numpy as np

from diagrams.batch.run import Report, Run, Table
from diagrams.loop.controller_config import LEARNED
from diagrams.loop.controllers import make_residual_model
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.studies.options import FlownRun, Only, fixed, tabulate
from diagrams.studies.sweep import Row, choose_rows, configure, model_path, train_rows
from diagrams.studies.tracking import DITHERED, HOVER_ROWS
from np_drake.labels import LabelFilter, labelled
from np_drake.mpc.controller import MpcController
from np_drake.mpc.problem import MpcStatus
from np_drake.mpc.solvers import make_solver
from np_drake.residual_model import Sample

TRACK = "lemniscate"  # experiment that is flown
PERIODS = 250  # of the controller that are replayed [1]
RATES = (50, 100)  # of the control loop [1/s]
# Upper limits on an i5-1135G7 [ms]. Source: Jin et al. 2025
PAPER = {"predict": 5.0, "solve": 10.0}
SOLVERS = ("sqp", "ipopt")  # that are timed
_WARM_UP = 20  # periods that are replayed and not counted [1]
_BLOCK = 20  # periods between two runs of the reference calculation [1]
_REFERENCE_RUNS = 5  # in a row [1]
_WINDOW = np.random.default_rng(0).normal(size=(40, 30))  # samples, columns
ROWS = (
    Row("nominal", "nominal"),
    Row("hold", "hold"),
    Row("observer", "observer"),
    Row("np: paper", "np", training=DITHERED, configuration="paper"),
    *(row for row in HOVER_ROWS if row.kind in LEARNED),
)


def replay(flight: FlightResult, solver: str) -> dict[str, np.ndarray]:
    """Feed the recorded readings to label filter, residual model and MPC, one period after the
    other; a command of the replay has no effect on what comes after.

    Returns: processor times of "predict" and "solve" (n,), and of the "reference" calculation, the
        pseudo-inverse of a window [ms]; "status" of the solver.
    """
    config, s = flight.config.controller, flight.signals
    believed, mpc = config.believed(flight.config.vehicle), config.mpc
    model = make_residual_model(config, believed)
    labels = LabelFilter(labelled(believed, model), config.label, step=config.period)
    controller = MpcController(
        believed, mpc, make_solver(solver, believed, mpc), period=config.period
    )
    ahead, track = mpc.step * np.arange(mpc.horizon + 1), flight.config.motion
    kept, plan = labels.initial_memory(), controller.initial_memory()
    memory = {} if model is None else model.initial_memory()
    scored = int(np.argmax(flight.scored))
    times, status, compared = [], [], []
    for k in range(max(scored - _WARM_UP, 1), len(s["t"])):
        begin, forecast = time.process_time(), None
        if model is not None:
            x, acceleration, u = s["x"][k], s["acceleration"][k], s["u"][k - 1]
            kept, chi = labels.step(kept, x=x, a=acceleration[:3], al=acceleration[3:], u=u)
            memory = model.update(memory, Sample(x, u, chi))
            forecast = model.forecast(memory, horizon=mpc.horizon, stride=config.stride)
        middle = time.process_time()
        flat = track.sample(s["t"][k] + ahead)
        plan = controller.step(plan, x=s["x"][k], flat=flat, forecast=forecast)
        end = time.process_time()
        if k >= scored:
            times.append((middle - begin, end - middle))
            status.append(plan.flags[0])
            if k % _BLOCK == 0:
                for _ in range(_REFERENCE_RUNS):
                    begin = time.process_time()
                    np.linalg.pinv(_WINDOW)
                    compared.append(time.process_time() - begin)
    predict, solve = 1e3 * np.array(times).T
    reference, states = 1e3 * np.array(compared), np.array(status)
    return {"predict": predict, "solve": solve, "reference": reference, "status": states}


def timing_line(row: str, solver: str, spent: dict[str, np.ndarray]) -> dict:
    """Return one line of the table: medians and 95 % quantiles [ms], CPU load by rate [1], ratios
    to the reference [1].
    """
    line: dict[str, Any] = {
        "row": row,
        "solver": solver,
        "periods": len(spent["status"]),
        "failures": int(np.sum(spent["status"] >= MpcStatus.SQP_FALLBACK)),
    }
    values = {name: spent[name] for name in ("predict", "solve")}
    whole = spent["predict"] + spent["solve"]
    values |= {f"load_{rate}": whole * rate / 1e3 for rate in RATES}
    for name, of in values.items():
        line |= {name: float(np.median(of)), f"{name}_p95": float(np.quantile(of, 0.95))}
    base = float(np.median(spent["reference"]))
    ratios = {f"{name}_ratio": line[name] / base for name in ("predict", "solve")}
    return {**line, "reference": base, **ratios}


def printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines that `timing_line` gives."""

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


def run(run: Run, only: Only = None) -> Report:
    """What a period costs. As ratios to a reference calculation in the same run."""
    rows, flight_seed, lines = choose_rows(ROWS, only), run.seed + 1, []
    _, models = train_rows(FlownRun.of(run), rows, config={})
    with run.counting("timing", "controllers") as on_progress:
        for number, row in enumerate(rows, start=1):
            with model_path(models.get(row.key)) as model:
                flown = configure(TRACK, row, solver="sqp", model=model)
                flown.duration = PERIODS * flown.controller.period
                flight = fly(flown, seed=flight_seed)
                lines += [
                    timing_line(row.name, solver, replay(flight, solver)) for solver in SOLVERS
                ]
            on_progress(number, len(rows))
    mpc = dc.asdict(configure(TRACK, rows[0], solver="sqp").controller.mpc)
    title = f"{PERIODS} periods of the {TRACK}, seed {flight_seed}, np trained on seed {run.seed}"
    config = {"track": TRACK, "periods": PERIODS, "mpc": mpc}
    return Report(
        [printed(lines, f"{title}; median / 95 % quantile")],
        config=config | {"training_seed": run.seed, "flight_seed": flight_seed},
        metrics={"table": lines},
        notes=[
            "processor time of one process; ratio: to the pseudo-inverse of a 40 x 30 "
            f"matrix in the same run ({lines[0]['reference']:.3f} ms); paper: lift and refit < "
            f"{PAPER['predict']:g} ms, solve < {PAPER['solve']:g} ms on an i5-1135G7."
        ],
    )
