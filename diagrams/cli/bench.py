"""`np-drake bench`: speed, as ratios measured in one run."""

import dataclasses as dc
import os
from typing import Annotated

from typer import Option

from diagrams.cli.output import progress, tell
from diagrams.cli.runner import Report, Run, reports
from diagrams.studies.columns import tabulate

RECORDED = {"mpc": "np, K = 22", "mpc_refit": "paper, K = 24"}  # key of --json: recorded problems
TIMES = (
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
ANSWERS = (
    ("problems", "suite"),
    ("solver", "name"),
    ("n", "problems"),
    ("failed", "failures"),
    ("fell back", "fallbacks"),
    ("largest gap", lambda line: f"{line['gap_max']:.1e}"),
    ("largest violation", lambda line: f"{line['violation_max']:.1e}"),
)


@reports("bench", seed=0)
def bench(
    run: Run,
    problems: Annotated[int, Option(min=10, max=100_000, help="Recorded NP-MPC problems.")] = 200,
    seconds: Annotated[
        float, Option(min=1.0, max=3600.0, help="Simulated time of the simulator [s].")
    ] = 40.0,
) -> Report:
    """Time solvers and simulator; peers: CasADi + IPOPT (extra `bench`), acados."""
    if os.environ.get("OMP_NUM_THREADS") != "1":
        tell(
            "OMP_NUM_THREADS is not 1: small matrices run two to three times slower on "
            "several threads."
        )
    from diagrams.studies import bench as measure
    from diagrams.studies.sweep import Row, train_row
    from diagrams.studies.tracking import DITHERED

    with progress("training, recording problems", 1.0) as advance:
        paper, row = (
            run.folder / "paper.safetensors",
            Row("", "np", training=DITHERED, configuration="paper"),
        )
        train_row(row, paper, seed=run.seed, solver="sqp")
        advance(0.5, "recording")
        config, recorded = measure.record_problems(problems, seed=run.seed)
        _, refit = measure.record_problems(problems, seed=run.seed, predictor=str(paper))
        advance(1.0, "")
    mpc = config.controller.mpc
    with run.counting("solvers") as on_progress:
        found = measure.suite(
            config.vehicle,
            mpc,
            recorded=dict(zip(RECORDED.values(), (recorded, refit), strict=True)),
            period=config.controller.period,
            progress=on_progress,
        )
    with progress("simulator", 1.0):
        factor = measure.real_time_factor(seconds=seconds, seed=run.seed)
    lines = [{"suite": suite, **line} for suite, of in found.items() for line in of]
    return Report(
        [
            tabulate(
                "NP-MPC solvers; to …: ratio of medians in this run; gap: median", lines, TIMES
            ),
            tabulate("NP-MPC solvers, answers", lines, ANSWERS),
        ],
        config=dc.asdict(mpc),
        metrics={
            **{
                key: {line["name"]: {"N": mpc.horizon, **line} for line in found[name]}
                for key, name in RECORDED.items()
            },
            "mpc_growth": [
                {"N": n, "K": K, "solver": line["name"], **line}
                for n, K in measure.GROWTH
                for line in found[measure.growth_name(n, K)]
            ],
            "simulator": {"real_time_factor": {"closed_loop": factor}},
        },
        notes=[f"simulator with sensors, predictor and NP-MPC: {factor:.3g} times real time"],
    )
