"""`np-drake reproduce closing`: what a diagnosis gains a controller that was made in a simulator."""

import math
from collections.abc import Sequence
from typing import Annotated

from typer import Option

from diagrams.cli.columns import tabulate
from diagrams.cli.output import Table, counted, progress
from diagrams.cli.reproduce.campaign import Campaign, campaign
from diagrams.cli.reproduce.sweep import CASES, OutOfCases, Scheduler, cost, require_result
from diagrams.cli.runner import Report


@campaign(seeds=40, out=OutOfCases)
def closing(
    run: Campaign,
    scheduler: Scheduler = "",
    simulator: Annotated[
        str, Option(metavar="NAME", help="In which the real vehicle flies: drake | rotorpy.")
    ] = "drake",
) -> Report:
    """Vehicles with withheld effects: diagnosed, then flown by controllers of several simulators.

    A seed is a vehicle. It flies three times under `hold` and is diagnosed. In the nominal simulator, in the corrected
    one, and in draws from its posterior, predictors are trained, and of all controllers the one that flies the circle
    best there is flown on the vehicle. With rotorpy the vehicle has that simulator's rigid body, rotors, drag, lift and
    motor lag, and there is no oracle. --out DIR: cases to resume from.
    """
    from diagrams.batch.campaign import run_campaign
    from diagrams.challenge.closing import study
    from np_drake.mpc.solvers import require_solver

    require_solver(run.solver)
    config = study.settings(run.solver, simulator)
    with progress("closing", 1.0) as advance:
        records = run_campaign(
            study.Closing(run.solver, simulator),
            [{"seed": seed} for seed in run.seeds],
            config=config,
            folder=run.folder / CASES if run.out else None,
            jobs=run.jobs,
            scheduler=scheduler,
            on_progress=counted(advance, "vehicles"),
        )
    require_result(records)
    results = [record["result"] for record in records if "result" in record]
    lines = study.table(results)
    gains = study.gained(results)
    failed = [f"seed {r['case']['seed']}: {r['error']}" for r in records if "error" in r]
    seeds = f"seeds {run.seeds[0]} … {run.seeds[-1]}"
    return Report(
        closing_printed(lines, gains, f"{len(results)} vehicles in {simulator}, {seeds}, {run.solver}"),
        config=config | {"seeds": run.seeds},
        metrics={"table": lines, "gains": gains, "runs": records},
        notes=[*failed, cost(records)],
    )


def closing_printed(lines: Sequence[dict], gains: dict[str, float], title: str) -> list[Table]:
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
    return [tabulate(title, lines, columns), ("medians over the vehicles", ["gain", "value [1]"], rows)]
