"""`np-drake demo`: the whole story in one run."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diagrams.cli import options
from diagrams.cli.output import make_folder, print_table, progress, say, write_metrics
from np_drake.atomic_file import require_writable

if TYPE_CHECKING:
    from diagrams.tracking.demo import Demo


def demo(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for model, log, figures, replay.")
    ] = Path("out/demo"),
    solver: Annotated[str, typer.Option(help="ipopt | sqp")] = "sqp",
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    seed: options.Seed = 0,
    json: options.Json = None,
) -> None:
    """Fly the training circle, learn, fly circle and lemniscate with nominal MPC, hold and NP-MPC."""
    if json is not None:
        require_writable(json)
    from np_drake.mpc.solvers import require_solver

    require_solver(solver)
    make_folder(out)
    from diagrams.cli.fly import as_config, print_flights, write_flight
    from diagrams.tracking.demo import run_demo

    start = time.perf_counter()
    with progress("demo", 1.0) as advance:
        result = run_demo(out, seed=seed, solver=solver, jobs=jobs, on_progress=advance)
    say(
        f"trained on {result.result.model.summary['samples']} points: {result.result.model.summary['excitation']}"
    )
    print_flights(result.flights)
    _print_reduction(result)
    write_flight(result.training, out)
    for flight in result.flights:
        if flight.config.controller.kind == "np":
            write_flight(flight, out)
    _write_comparison(result, out)
    wall = time.perf_counter() - start
    say(f"seed {seed}, {wall:.0f} s; everything is in {out}/")
    config = as_config(result.flights[-1].config)
    runs = [flight.summary() for flight in result.flights]
    write_metrics(json, "demo", seed=seed, config=config, runs=runs, reduction=result.reduction(), wall=wall)


def _print_reduction(result: "Demo") -> None:
    from diagrams.tracking.tracking import PAPER

    rows = []
    for track, cut in result.reduction().items():
        paper = [1 - n / m for n, m in zip(PAPER["np"][track], PAPER["nominal"][track], strict=True)]
        rows.append((track, *(f"{100 * v:.0f} %" for v in (cut["E_xy"], paper[0], cut["E_z"], paper[1]))))
    header = ["track", "E_xy cut, ours", "paper", "E_z cut, ours", "paper"]
    print_table("NP-MPC against nominal MPC (the paper: its own vehicle, real flights)", header, rows)


def _write_comparison(result: "Demo", out: Path) -> None:
    from diagrams.tracking import figures
    from diagrams.tracking.tracking import TRACKS
    from np_drake.figure_file import save

    for track in TRACKS:
        flights = [f for f in result.flights if f.config.name == track]
        title = f"{track} · seed {flights[0].seed}"
        save(figures.plane_track(flights, title), out / f"{track}_track.png")
        save(figures.errors(flights, title), out / f"{track}_errors.png")
