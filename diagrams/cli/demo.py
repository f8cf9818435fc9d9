"""`np-drake demo`: the whole story in one run."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from diagrams.cli import options
from diagrams.cli.columns import percent, tabulate
from diagrams.cli.fly import as_config, flights_table, write_flight
from diagrams.cli.output import Table, progress, say
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from diagrams.tracking.demo import Demo

Out = Annotated[Path, Option("--out", metavar="DIR", help="Folder for model, log, figures, replay.")]


@reports("demo", seed=0, out=Out, folder=Path("out/demo"), markdown=False)
def demo(run: Run, solver: options.Solver = options.DEFAULT_SOLVER, jobs: options.Jobs = 2) -> Report:
    """Fly the training circle, learn, fly circle and lemniscate with nominal MPC, hold and NP-MPC."""
    from np_drake.mpc.solvers import require_solver

    require_solver(solver)
    from diagrams.tracking.demo import run_demo

    start = time.perf_counter()
    with progress("demo", 1.0) as advance:
        result = run_demo(run.folder, seed=run.seed, solver=solver, jobs=jobs, on_progress=advance)
    wall, trained = time.perf_counter() - start, result.result.model.summary
    runs = [flight.summary() for flight in result.flights]

    def write(folder: Path) -> None:
        write_flight(result.training, folder)
        for flight in result.flights:
            if flight.config.controller.kind == "np":
                write_flight(flight, folder)
        _write_comparison(result, folder)
        say(f"seed {run.seed}, {wall:.0f} s; everything is in {folder}/")

    return Report(
        [flights_table(result.flights), _reduction_table(result)],
        config=as_config(result.flights[-1].config),
        metrics={"runs": runs, "reduction": result.reduction(), "wall": wall},
        lines=[f"trained on {trained['samples']} points: {trained['excitation']}"],
        write=write,
    )


def _reduction_table(result: "Demo") -> Table:
    from diagrams.tracking.tracking import PAPER

    lines = []
    for track, cut in result.reduction().items():
        xy, z = (1 - n / m for n, m in zip(PAPER["np"][track], PAPER["nominal"][track], strict=True))
        lines.append({"track": track, **cut, "paper_xy": xy, "paper_z": z})
    columns = (
        ("track", "track"),
        ("E_xy cut, ours", percent("E_xy")),
        ("paper", percent("paper_xy")),
        ("E_z cut, ours", percent("E_z")),
        ("paper", percent("paper_z")),
    )
    return tabulate("NP-MPC against nominal MPC (the paper: its own vehicle, real flights)", lines, columns)


def _write_comparison(result: "Demo", out: Path) -> None:
    from diagrams.tracking import figures
    from diagrams.tracking.tracking import TRACKS
    from np_drake.figure_file import save

    for track in TRACKS:
        flights = [f for f in result.flights if f.config.name == track]
        title = f"{track} · seed {flights[0].seed}"
        save(figures.plane_track(flights, title), out / f"{track}_track.png")
        save(figures.errors(flights, title), out / f"{track}_errors.png")
