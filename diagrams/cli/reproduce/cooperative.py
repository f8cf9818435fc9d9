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
    from diagrams.cooperative.result import CooperativeResult

FLEETS = (2, 3, 4)
PHASES = ("hover", "transport")
COLUMNS = ("position_rmse", "E_xy", "E_z", "excursion", "payload_rmse", "payload_excursion")


def cooperative(
    vehicles: Annotated[
        list[int] | None, typer.Option(help="Fleet sizes, once each; default: 2, 3 and 4.")
    ] = None,
    solver: options.Solver = "sqp",
    only: Annotated[list[str] | None, typer.Option(help="Only rows of these names.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Flights a row, of seeds seed, seed + 1, …")] = 3,
    seed: options.Seed = 1000,
    out: options.Out = None,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Several vehicles on one payload. Each has its own predictor and MPC; --out DIR: paths, replays of one seed."""
    require_files(json, markdown)
    if out is not None:
        require_folder(out)
    from diagrams.cli.fly import as_config
    from diagrams.cooperative.result import ROWS, configure, run_cooperative
    from diagrams.cooperative.table import cooperative_table as cooperative_lines

    if unknown := set(only or ()) - set(ROWS):
        names = ", ".join(sorted(unknown))
        raise ValueError(f"--only: must name rows of the table ({'; '.join(ROWS)}); got {names}.")
    fleets, drawn = sorted(set(vehicles or FLEETS)), [seed + k for k in range(seeds)]
    with progress("cooperative", 1.0) as advance:
        summaries, flights = run_cooperative(
            fleets,
            seeds=drawn,
            solver=solver,
            rows=[row for row in ROWS if not only or row in only],
            on_progress=lambda t, total: advance(t / total, f"{t:.0f} of {total:.0f} s"),
        )
    config, lines = configure("np", fleets[0], solver=solver), cooperative_lines(summaries)
    settings = {**as_config(config), "vehicles": fleets, "seeds": drawn}
    write_metrics(json, "reproduce", seed=seed, config=settings, table=lines, runs=summaries)
    if out is not None:
        _write(flights, make_folder(out))
    payload = config.reality.payload
    notes = [
        f"payload {payload.mass} kg on cables of {payload.length} m; neighbours {config.spacing} m apart; "
        f"{config.distance} m in {config.transport} s; fault at {config.settle} s, predictor 0",
        "RMSE and largest distance of all vehicles, and of the payload, from where the formation's reference has them",
        "processor seconds a simulated second; median and p95 of the solves by the clock on the wall:",
        *costs(lines),
    ]
    title = f"{seeds} flights a row, seeds {drawn[0]} … {drawn[-1]}, {solver}; ± 95 % interval of the mean"
    show(markdown, printed(lines, title), notes=notes)


def printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of `cooperative_table`; errors in cm, failed solves of both phases and all flights."""
    header = ["n", "controller", "phase", "RMSE", "E_xy / E_z", "largest", "payload", "largest", "failed"]
    rows: list[tuple] = []
    for line in lines:
        head = (str(line["vehicles"]), line["row"])
        if line["lost"]:
            rows.append((*head, "lost", *6 * ("–",)))
            continue
        for phase in PHASES:
            m = {key: _cell(line[phase], key) for key in COLUMNS}
            cells = (m["position_rmse"], f"{m['E_xy']} / {m['E_z']}", m["excursion"])
            failed = str(line["solve_failures"])
            rows.append((*head, phase, *cells, m["payload_rmse"], m["payload_excursion"], failed))
    return title + "; errors in cm", header, rows


def _cell(figures: dict, key: str) -> str:
    """Mean and interval in cm; without an interval for a single flight."""
    spread = 100 * figures[f"{key}_ci95"]
    return f"{100 * figures[key]:.2f}" + (f" ± {spread:.2f}" if spread == spread else "")


def costs(lines: list[dict]) -> list[str]:
    """A line a row: what it costs, how near vehicles came and what the cables carried."""
    said = []
    for line in lines:
        head = f"{line['vehicles']} vehicles, {line['row']}: "
        if line["lost"]:
            said.append(head + "; ".join(line["lost"]))
            continue
        solve, tension = line["solve_ms"], line["tension"]
        said.append(
            f"{head}{line['processor_time']:.2f} s/s; solve {solve['median']:.1f} ms, p95 {solve['p95']:.1f} ms; "
            f"closest {line['closest']:.2f} m; cables {tension['min']:.2f} to {tension['max']:.2f} N; "
            f"vehicle 0 off by {_cell(line['hover'], 'first_rmse')} cm in hover, "
            f"{_cell(line['transport'], 'first_rmse')} cm in transport"
        )
    return said


def _write(flights: "list[CooperativeResult]", folder: Path) -> None:
    """Paths and replay page of every flight, named by fleet and controller."""
    from diagrams.cooperative.figures import paths
    from diagrams.cooperative.replay_page import write_cooperative_replay
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
