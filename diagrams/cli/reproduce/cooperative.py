"""`np-drake reproduce cooperative`: several vehicles on one payload, each blind to all the others."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from diagrams.cli import options
from diagrams.cli.columns import MISSING, spread
from diagrams.cli.output import Table, say
from diagrams.cli.reproduce.campaign import require_rows
from diagrams.cli.runner import Report, Run, counting, reports

if TYPE_CHECKING:
    from diagrams.cooperative.result import CooperativeResult

FLEETS = (2, 3, 4)
PHASES = ("hover", "transport")
COLUMNS = ("position_rmse", "E_xy", "E_z", "excursion", "payload_rmse", "payload_excursion")


@reports("reproduce", seed=1000, out=options.OutOfCases, many=True)
def cooperative(
    run: Run,
    vehicles: Annotated[list[int] | None, Option(help="Fleet sizes, once each; default: 2, 3 and 4.")] = None,
    solver: options.Solver = options.DEFAULT_SOLVER,
    only: Annotated[list[str] | None, Option(help="Only rows of these names.")] = None,
    seeds: Annotated[int, Option(min=1, max=10_000, help="Flights a row, of seeds seed, seed + 1, …")] = 3,
) -> Report:
    """Several vehicles on one payload. Each has its own predictor and MPC; --out DIR: paths, replays of one seed."""
    from diagrams.cli.fly import as_config
    from diagrams.cooperative.result import ROWS, configure, run_cooperative
    from diagrams.cooperative.table import cooperative_table

    require_rows(only or (), ROWS)
    fleets, drawn = sorted(set(vehicles or FLEETS)), [run.seed + k for k in range(seeds)]
    with counting("cooperative", "flights") as on_progress:
        summaries, flights = run_cooperative(
            fleets,
            seeds=drawn,
            solver=solver,
            rows=[row for row in ROWS if not only or row in only],
            workers=run.workers,
            on_progress=on_progress,
        )
    config, lines = configure("payload_filter", fleets[0], solver=solver), cooperative_table(summaries)
    payload = config.reality.payload
    title = f"{seeds} flights a row, seeds {drawn[0]} … {drawn[-1]}, {solver}; ± 95 % interval of the mean"
    return Report(
        [printed(lines, title)],
        config={**as_config(config), "vehicles": fleets, "seeds": drawn},
        metrics={"table": lines, "runs": summaries},
        notes=[
            f"payload {payload.mass} kg on cables of {payload.length} m; neighbours {config.spacing} m apart; "
            f"{config.distance} m in {config.transport} s; fault at {config.settle} s, predictor 0",
            "RMSE and largest distance of all vehicles, and of the payload, from "
            "where the formation's reference has them",
            "processor seconds a simulated second; median and p95 of the solves by the clock on the wall:",
            *costs(lines),
        ],
        write=lambda folder: _write(flights, folder),
    )


def printed(lines: list[dict], title: str) -> Table:
    """Return the table of `cooperative_table`; errors in cm, failed solves of both phases and all flights."""
    header = ["n", "controller", "phase", "RMSE", "E_xy / E_z", "largest", "payload", "largest", "failed"]
    rows: list[tuple] = []
    for line in lines:
        head = (str(line["vehicles"]), line["row"])
        if line["lost"]:
            rows.append((*head, "lost", *6 * (MISSING,)))
            continue
        for phase in PHASES:
            rmse, xy, z, *others = (spread(key)(line[phase]) for key in COLUMNS)
            rows.append((*head, phase, rmse, f"{xy} / {z}", *others, str(line["solve_failures"])))
    return title + "; errors in cm", header, rows


def costs(lines: list[dict]) -> list[str]:
    """Return a line for every row: its cost, how near vehicles came and what the cables carried."""
    said = []
    for line in lines:
        head = f"{line['vehicles']} vehicles, {line['row']}: "
        if line["lost"]:
            said.append(head + "; ".join(line["lost"]))
            continue
        solve, tension, first = line["solve_ms"], line["tension"], spread("first_rmse")
        said.append(
            f"{head}{line['processor_time']:.2f} s/s; solve {solve['median']:.1f} ms, p95 {solve['p95']:.1f} ms; "
            f"closest {line['closest']:.2f} m; cables {tension['min']:.2f} to {tension['max']:.2f} N; "
            f"vehicle 0 off by {first(line['hover'])} cm in hover, "
            f"{first(line['transport'])} cm in transport"
        )
    return said


def _write(flights: "list[CooperativeResult]", folder: Path) -> None:
    """Write paths and replay page of every flight, named by fleet and controller."""
    from diagrams.cooperative.figures import paths
    from diagrams.cooperative.replay_page import write_cooperative_replay
    from np_drake.files.figure_file import save

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
