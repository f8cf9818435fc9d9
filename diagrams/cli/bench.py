"""`np-drake bench`: speed, as ratios measured in one run."""

import dataclasses as dc
import os
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from diagrams.batch.columns import tabulate
from diagrams.cli.output import Table, progress, tell
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from diagrams.performance.solver_bench import SolverReport

RECORDED = {"mpc": "np, K = 22", "mpc_refit": "paper, K = 24"}  # key of --json: recorded problems


@reports("bench", seed=0)
def bench(
    run: Run,
    problems: Annotated[int, Option(min=10, max=100_000, help="Recorded NP-MPC problems.")] = 200,
    seconds: Annotated[
        float, Option(min=1.0, max=3600.0, help="Simulated time of the simulator [s].")
    ] = 40.0,
    predictor: Annotated[
        bool, Option("--predictor", help="Only the predictors, against the pseudo-inverse.")
    ] = False,
) -> Report:
    """Time solvers, predictor, simulator and training; peers: CasADi + IPOPT (extra `bench`),
    acados.
    """
    if os.environ.get("OMP_NUM_THREADS") != "1":
        tell(
            "OMP_NUM_THREADS is not 1: small matrices run two to three times slower on "
            "several threads."
        )
    if predictor:
        lines, table = _against_the_pseudo_inverse(run.seed)
        return Report([table], config={}, metrics={"predictor": {"against_pseudo_inverse": lines}})
    from diagrams.performance import bench as measure
    from diagrams.performance.solver_bench import GROWTH, growth_name, suite

    with progress("training, recording problems", 1.0) as advance:
        walls = measure.time_training(run.folder, seed=run.seed)
        advance(0.5, "recording")
        config, recorded = measure.record_problems(problems, seed=run.seed)
        paper = str(measure.model_file(run.folder, "paper"))
        _, refit = measure.record_problems(problems, seed=run.seed, predictor=paper)
        advance(1.0, "")
    mpc = config.controller.mpc
    with run.counting("solvers") as on_progress:
        found = suite(
            config.vehicle,
            mpc,
            recorded=dict(zip(RECORDED.values(), (recorded, refit), strict=True)),
            period=config.controller.period,
            progress=on_progress,
        )
    content, tables = _others(measure, config, run, walls, seconds)
    growth = [
        {"N": n, "K": K, "solver": r.name, **dc.asdict(r)}
        for n, K in GROWTH
        for r in found[growth_name(n, K)]
    ]
    starts = {name: [dc.asdict(r) for r in rows] for name, rows in found.items() if "start" in name}
    timed = {
        key: {r.name: {"N": mpc.horizon, **dc.asdict(r)} for r in found[name]}
        for key, name in RECORDED.items()
    }
    return Report(
        [*_solver_tables(found), *tables],
        config=dc.asdict(mpc),
        metrics={**timed, "mpc_growth": growth, "mpc_starts": starts, **content},
    )


def _solver_tables(found: "dict[str, list[SolverReport]]") -> list[Table]:
    """Return the table of times and that of answers."""
    lines = [{"suite": suite, **dc.asdict(r)} for suite, solvers in found.items() for r in solvers]
    times = (
        ("problems", "suite"),
        ("solver", "name"),
        ("median [ms]", "median_ms"),
        ("p95", "p95_ms"),
        ("p99", "p99_ms"),
        ("max", "max_ms"),
        ("to casadi", "ratio_to_casadi"),
        ("to acados", "ratio_to_acados"),
        ("gap", lambda line: f"{line['gap_median']:.1e}"),
    )
    answers = (
        ("problems", "suite"),
        ("solver", "name"),
        ("n", "problems"),
        ("feedback [ms]", "feedback_ms"),
        ("failed", "failures"),
        ("fell back", "fallbacks"),
        ("largest gap", lambda line: f"{line['gap_max']:.1e}"),
        ("largest violation", lambda line: f"{line['violation_max']:.1e}"),
    )
    return [
        tabulate("NP-MPC solvers; to …: ratio of medians in this run; gap: median", lines, times),
        tabulate(
            "NP-MPC solvers, answers; feedback: phase after the measurement, median", lines, answers
        ),
    ]


def _against_the_pseudo_inverse(seed: int) -> tuple[list[dict], Table]:
    """Return the lines of `--json`, and the table."""
    from diagrams.performance.predictor_bench import predictor_timings

    with progress("predictors", 1.0):
        lines = [dc.asdict(timing) for timing in predictor_timings(seed)]
    title = (
        "one sample: refit, lift and 20 steps; ratio: to the pseudo-inverse of 40 samples "
        "in this run"
    )
    columns = (("", "name"), ("median [ms]", "median_ms"), ("p95", "p95_ms"), ("ratio", "ratio"))
    return lines, tabulate(title, lines, columns)


def _others(
    measure: Any, config: Any, run: Run, walls: dict[str, float], seconds: float
) -> tuple[dict[str, Any], list[Table]]:
    """Time predictor and simulator; return these and training, for `--json` and as tables."""
    from np_drake.residual_models.neural_predictor import NeuralPredictor

    span = {"horizon": config.controller.mpc.horizon, "stride": config.controller.stride}
    with progress("predictor, simulator", 1.0):
        update = {
            name: measure.time_predictor(
                NeuralPredictor.load(measure.model_file(run.folder, name)), **span
            )
            for name in ("lifted", "paper")
        }
        factors = measure.real_time_factors(seconds=seconds, seed=run.seed)
    rows: list[tuple] = [
        *(
            (f"predictor `{n}`: lift, refit, forecast", v["median"], "ms (median)")
            for n, v in update.items()
        ),
        *((f"simulator: {name}", value, "x real time") for name, value in factors.items()),
        *((f"training `{name}`, 3000 points", value, "s") for name, value in walls.items()),
    ]
    lines, table = _against_the_pseudo_inverse(run.seed)
    times = {"update_ms": update["lifted"], "update_ms_paper": update["paper"]}
    content = {
        "predictor": {**times, "against_pseudo_inverse": lines},
        "simulator": {"real_time_factor": factors},
        "training": {"wall": walls["lifted"], "wall_paper": walls["paper"]},
    }
    return content, [("the rest", ["what", "value", "unit"], rows), table]
