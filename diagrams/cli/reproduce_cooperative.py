"""`np-drake reproduce cooperative`: several vehicles on one payload, each blind to all the others."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diagrams.cli import options
from diagrams.cli.output import (
    Table,
    make_folder,
    progress,
    require_files,
    require_folder,
    say,
    show,
    write_metrics,
)

if TYPE_CHECKING:
    from diagrams.cooperative_result import CooperativeResult

FLEETS = (2, 3, 4)


def cooperative(
    vehicles: Annotated[
        list[int] | None, typer.Option(help="Fleet sizes, once each; default: 2, 3 and 4.")
    ] = None,
    solver: options.Solver = "sqp",
    only: Annotated[list[str] | None, typer.Option(help="Only rows of these names.")] = None,
    seed: options.Seed = 1000,
    out: options.Out = None,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Several vehicles on one payload. Each has its own predictor and MPC; --out DIR: paths and replay pages."""
    require_files(json, markdown)
    if out is not None:
        require_folder(out)
    from diagrams.cli.fly import as_config
    from diagrams.cooperative_result import ROWS, configure, run_cooperative

    if unknown := set(only or ()) - set(ROWS):
        names = ", ".join(sorted(unknown))
        raise ValueError(f"--only: must name rows of the table ({'; '.join(ROWS)}); got {names}.")
    fleets = sorted(set(vehicles or FLEETS))
    with progress("cooperative", 1.0) as advance:
        summaries, flights = run_cooperative(
            fleets,
            seed=seed,
            solver=solver,
            rows=[row for row in ROWS if not only or row in only],
            on_progress=lambda t, total: advance(t / total, f"{t:.0f} of {total:.0f} s"),
        )
    config = configure("np", fleets[0], solver=solver)
    write_metrics(
        json, "reproduce", seed=seed, config={**as_config(config), "vehicles": fleets}, table=summaries
    )
    if out is not None:
        _write(flights, make_folder(out))
    payload = config.reality.payload
    notes = [
        f"payload {payload.mass} kg on cables of {payload.length} m; neighbours {config.spacing} m apart; "
        f"{config.distance} m in {config.transport} s; fault at {config.settle} s, predictor 0",
        "RMSE and largest distance of all vehicles, and of the payload, from where the formation's reference has them",
        "processor seconds a simulated second; median and p95 of the solves by the clock on the wall:",
        *costs(summaries),
    ]
    show(markdown, printed(summaries, f"one flight a row, seed {seed}, {solver}"), notes=notes)


def printed(summaries: list[dict], title: str) -> Table:
    """Title, header and rows of the summaries of `run_cooperative`; errors in cm, failed solves of both phases."""
    header = ["n", "controller", "phase", "RMSE", "E_xy / E_z", "largest", "payload", "largest", "failed"]
    rows: list[tuple] = []
    for line in summaries:
        head = (str(line["vehicles"]), line["row"])
        if "lost" in line:
            rows.append((*head, "lost", *6 * ("–",)))
            continue
        for phase in ("hover", "transport"):
            m = {key: f"{100 * value:.2f}" for key, value in line["metrics"][phase].items()}
            cells = (m["position_rmse"], f"{m['E_xy']} / {m['E_z']}", m["excursion"])
            failed = str(line["metrics"]["solve_failures"])
            rows.append((*head, phase, *cells, m["payload_rmse"], m["payload_excursion"], failed))
    return title + "; errors in cm", header, rows


def costs(summaries: list[dict]) -> list[str]:
    """A line a flight: what it costs, how near vehicles came and what the cables carried."""
    lines = []
    for line in summaries:
        head = f"{line['vehicles']} vehicles, {line['row']}: "
        if "lost" in line:
            lines.append(head + line["lost"])
            continue
        m = line["metrics"]
        solve, tension = m["solve_ms"], m["tension"]
        lines.append(
            f"{head}{m['processor_time']:.2f} s/s; solve {solve['median']:.1f} ms, p95 {solve['p95']:.1f} ms; "
            f"closest {m['closest']:.2f} m; cables {tension['min']:.2f} to {tension['max']:.2f} N"
        )
    return lines


def _write(flights: "list[CooperativeResult]", folder: Path) -> None:
    """Paths and replay page of every flight, named by fleet and controller."""
    from diagrams.cooperative_figures import paths
    from diagrams.cooperative_replay import write_cooperative_replay
    from np_drake.figure_file import save

    for flight in flights:
        config = flight.config
        fault = "" if config.fault == "none" else f"_{config.fault}"
        stem = f"{config.name}_{config.vehicles}_{config.controller.kind}{fault}"
        title = (
            f"{config.vehicles} vehicles · {config.controller.kind}{fault.replace('_', ', predictor 0: ')}"
        )
        save(paths(flight, f"{title} · seed {flight.seed}"), folder / f"{stem}_paths.png")
        write_cooperative_replay(flight, folder / f"{stem}_replay.html")
    say(f"paths, replay: {folder}/cooperative_*")
