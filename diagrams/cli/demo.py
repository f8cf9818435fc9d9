"""`np-drake demo`: the whole story in one run."""

import time
from collections.abc import Mapping
from pathlib import Path

from diagrams.cli.fly import flights_table
from diagrams.cli.verb import Jobs, Report, Run, Table, progress, reports, say
from diagrams.evidence.studies.options import DEFAULT_SOLVER, Solver, percent, tabulate
from diagrams.loop.experiments import settings_of
from np_drake.mpc.solvers import require_solver


@reports(
    "demo",
    seed=0,
    out="Folder for model, log, figures, replay.",
    folder=Path("out/demo"),
    markdown=False,
)
def demo(run: Run, solver: Solver = DEFAULT_SOLVER, jobs: Jobs = 2) -> Report:
    """Fly, learn, fly again, diagnose these flights, correct the simulator and compare it with
    them: index.html.
    """
    require_solver(solver)
    from diagrams.demo.demo_page import cause_rows, meeting_rows, write_demo
    from diagrams.demo.story import HELD_OUT, run_demo

    start = time.perf_counter()
    with progress("demo") as advance:
        result = run_demo(run.folder, seed=run.seed, solver=solver, jobs=jobs, on_progress=advance)
    wall = time.perf_counter() - start
    trained = result.trained
    flights = list(result.flights.values())

    def write(folder: Path) -> None:
        say(f"{result.seeds}; {wall:.0f} s. Start with {write_demo(result, folder)}")

    effects = ["effect", "probability", "parameter", "found", "95 % interval", "true"]
    errors = ["controller", "error [cm]", "flight", "nominal simulator", "corrected", "off"]
    causes = "what the diagnosis finds in the flights of the nominal MPC"
    meeting = f"{HELD_OUT}, {result.simulated_seconds:g} s, in flight and in simulators"
    return Report(
        [
            flights_table(flights),
            _reduction_table(result.reduction()),
            (causes, effects, cause_rows(result)),
            (meeting, errors, meeting_rows(result)),
        ],
        config=settings_of(flights[-1].config),
        metrics={
            "runs": [flight.summary() for flight in flights],
            "reduction": result.reduction(),
            "withheld": result.withheld,
            "verdict": list(result.diagnosis.verdict),
            "meeting": result.meeting(),
            "wall": wall,
        },
        lines=[f"fitted to {trained['samples']} samples"],
        write=write,
    )


def _reduction_table(cuts: Mapping[str, dict[str, float]]) -> Table:
    from diagrams.evidence.studies.tracking import PAPER

    lines = []
    for track, cut in cuts.items():
        xy, z = (
            1 - n / m for n, m in zip(PAPER["np"][track], PAPER["nominal"][track], strict=True)
        )
        lines.append({"track": track, **cut, "paper_xy": xy, "paper_z": z})
    columns = (
        ("track", "track"),
        ("E_xy cut, ours", percent("E_xy")),
        ("paper", percent("paper_xy")),
        ("E_z cut, ours", percent("E_z")),
        ("paper", percent("paper_z")),
    )
    return tabulate(
        "NP-MPC against nominal MPC (the paper: its own vehicle, real flights)", lines, columns
    )
