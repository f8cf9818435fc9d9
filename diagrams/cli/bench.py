"""`np-drake bench`: speed, as ratios measured in one run."""

import dataclasses as dc
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from diagrams.cli import options
from diagrams.cli.output import (
    counted,
    print_table,
    progress,
    require_files,
    say,
    write_markdown,
    write_metrics,
)

if TYPE_CHECKING:
    from np_drake.mpc.benchmark import SolverReport


def bench(
    problems: Annotated[int, typer.Option(min=10, help="Recorded NP-MPC problems.")] = 200,
    seconds: Annotated[
        float, typer.Option(min=1.0, help="Simulated time of the simulator's figures [s].")
    ] = 40.0,
    predictor: Annotated[
        bool, typer.Option("--predictor", help="Only the predictors, against the pseudo-inverse.")
    ] = False,
    seed: options.Seed = 0,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Time solvers, predictor, simulator and training; CasADi + IPOPT (extra `bench`) is the peer."""
    require_files(json, markdown)
    if os.environ.get("OMP_NUM_THREADS") != "1":
        say("OMP_NUM_THREADS is not 1: small matrices run two to three times slower on several threads.")
    from diagrams.performance import bench as measure

    if predictor:
        lines, table = _against_the_pseudo_inverse(seed)
        print_table(*table)
        write_markdown(markdown, table)
        write_metrics(json, "bench", seed=seed, config={}, predictor={"against_pseudo_inverse": lines})
        return
    with tempfile.TemporaryDirectory() as folder:
        _run(
            measure, Path(folder), problems=problems, seconds=seconds, seed=seed, json=json, markdown=markdown
        )


def _run(
    measure: Any,
    folder: Path,
    *,
    problems: int,
    seconds: float,
    seed: int,
    json: Path | None,
    markdown: Path | None,
) -> None:
    from np_drake.mpc.benchmark import suite

    with progress("training, recording problems", 1.0) as advance:
        walls = measure.time_training(folder, seed=seed)
        advance(0.5, "recording")
        config, recorded = measure.record_problems(problems, seed=seed)
        paper = str(measure.model_file(folder, "paper"))
        _, refit = measure.record_problems(problems, seed=seed, predictor=paper)
        advance(1.0, "")
    with progress("solvers", 1.0) as advance:
        reports = suite(
            config.vehicle,
            config.controller.mpc,
            recorded={"default, K = 12": recorded, "paper, K = 24": refit},
            period=config.controller.period,
            progress=counted(advance),
        )
    solvers = _solver_table(reports)
    print_table(*solvers)
    write_markdown(markdown, solvers)
    content = _other_figures(measure, config, folder, walls, seconds=seconds, seed=seed)
    mpc = {
        name: {r.name: {"N": config.controller.mpc.horizon, **dc.asdict(r)} for r in reports[name]}
        for name in ("default, K = 12", "paper, K = 24")
    }
    growth = [
        {"N": int(name.split("=")[1]), "solver": r.name, **dc.asdict(r)}
        for name, rows in reports.items()
        if name.startswith("N =")
        for r in rows
    ]
    write_metrics(
        json,
        "bench",
        seed=seed,
        config=dc.asdict(config.controller.mpc),
        mpc=mpc["default, K = 12"],
        mpc_refit=mpc["paper, K = 24"],
        mpc_growth=growth,
        mpc_starts={name: [dc.asdict(r) for r in rows] for name, rows in reports.items() if "start" in name},
        **content,
    )


def _solver_table(reports: "dict[str, list[SolverReport]]") -> tuple[str, list[str], list[tuple]]:
    rows = [
        (
            name,
            r.name,
            r.problems,
            r.median_ms,
            r.p95_ms,
            r.max_ms,
            r.ratio_to_casadi,
            r.failures,
            r.fallbacks,
            f"{r.gap_median:.1e}",
        )
        for name, solvers in reports.items()
        for r in solvers
    ]
    header = ["problems", "solver", "n", "median [ms]", "p95", "max", "ratio", "failed", "fell back", "gap"]
    return "NP-MPC solvers; ratio: to CasADi + IPOPT in this run", header, rows


def _against_the_pseudo_inverse(seed: int) -> tuple[list[dict], tuple[str, list[str], list[tuple]]]:
    """Lines of `--json`, and the table."""
    from diagrams.performance.predictor_bench import predictor_timings

    with progress("predictors", 1.0):
        timings = predictor_timings(seed)
    rows = [(t.name, t.median_ms, t.p95_ms, t.ratio) for t in timings]
    title = "one sample: refit, lift and 20 steps; ratio: to the pseudo-inverse of 40 samples in this run"
    return [dc.asdict(t) for t in timings], (title, ["", "median [ms]", "p95", "ratio"], rows)


def _other_figures(
    measure: Any, config: Any, folder: Path, walls: dict[str, float], *, seconds: float, seed: int
) -> dict[str, Any]:
    """Predictor, simulator and training, printed and as `--json` has them."""
    span = {"horizon": config.controller.mpc.horizon, "stride": config.controller.stride}
    with progress("predictor, simulator", 1.0):
        update = {
            name: measure.time_predictor(measure.load_predictor(measure.model_file(folder, name)), **span)
            for name in ("default", "paper")
        }
        factors = measure.real_time_factors(seconds=seconds, seed=seed)
    rows: list[tuple[str, float, str]] = []
    for name, value in update.items():
        rows += [(f"predictor `{name}`: lift, refit, forecast", value["median"], "ms (median)")]
    rows += [(f"simulator: {name}", value, "x real time") for name, value in factors.items()]
    rows += [(f"training `{name}`, 3000 points", value, "s") for name, value in walls.items()]
    print_table("the rest", ["what", "figure", "unit"], rows)
    lines, table = _against_the_pseudo_inverse(seed)
    print_table(*table)
    return {
        "predictor": {
            "update_ms": update["default"],
            "update_ms_paper": update["paper"],
            "against_pseudo_inverse": lines,
        },
        "simulator": {"real_time_factor": factors},
        "training": {"wall": walls["default"], "wall_paper": walls["paper"]},
    }
