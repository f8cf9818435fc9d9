"""`np-drake reproduce robustness`: where each controller stops being better than nominal, and where it is lost."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diagrams.batch.failed_run import FailedRun
from diagrams.cli import options
from diagrams.cli.output import (
    Table,
    counted,
    make_folder,
    progress,
    require_files,
    require_folder,
    say,
    show,
    write_metrics,
)
from diagrams.cli.reproduce.configurations import choose_rows

if TYPE_CHECKING:
    from diagrams.batch.campaign import Record
    from diagrams.robustness.robustness import Axis

CASES = "cases"  # folder in --out with a file for every case


def robustness(
    seeds: options.Seeds = 2,
    solver: options.Solver = "sqp",
    jobs: options.Jobs = 2,
    scheduler: Annotated[
        str,
        typer.Option(metavar="ADDRESS", help="Fly on the Dask cluster of this scheduler: tcp://HOST:PORT."),
    ] = "",
    only: options.Only = None,
    axis: Annotated[
        list[str] | None, typer.Option(help="Only these axes: mass | length | speed | wind | noise | lag.")
    ] = None,
    duration: Annotated[float, typer.Option(min=10.0, help="Of a flight, after the ramp [s].")] = 20.0,
    seed: options.Seed = 1000,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder for the figure and every case, to resume from."),
    ] = None,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Payload, tether, speed, wind and noise, one by one. --out DIR: figure, and cases to resume from."""
    require_files(json, markdown)
    if out is not None:
        require_folder(out)
    from diagrams.batch.cluster import client

    if scheduler:
        with client(scheduler):
            pass  # refused before any work
    from diagrams.robustness import robustness as experiment
    from diagrams.robustness.table import robustness_table
    from np_drake.mpc.solvers import require_solver

    rows = choose_rows(experiment.ROWS, only)
    require_solver(solver)
    axes = _axes(axis or [])
    evaluation = options.evaluation_seeds(seed, seeds)
    with progress("robustness", 1.0) as advance:
        trainings, flights = experiment.run_robustness(
            make_folder(out) / CASES if out else None,
            seeds=evaluation,
            training_seed=seed,
            rows=rows,
            axes=axes,
            duration=duration,
            solver=solver,
            jobs=jobs,
            scheduler=scheduler,
            on_training=lambda done, total: advance(0.0, f"{done} of {total} trainings"),
            on_progress=counted(advance, "flights"),
        )
    if all("error" in record for record in flights):
        raise FailedRun(f"no flight has a result; the first: {flights[0]['error']}")
    lines = robustness_table(flights, axes)
    config = experiment.campaign_config(seed, solver, duration) | {"seeds": evaluation}
    if out is not None:
        _draw(lines, out, f"circle, {_title(seeds, seed, solver, duration)}")
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines, runs=[*trainings, *flights])
    title = _title(seeds, seed, solver, duration)
    notes = _notes(trainings, flights, lines)
    notes += [f"{name}: {value}" for name, value in config.items()]
    show(markdown, limits_printed(lines, title), errors_printed(lines, title), notes=notes)


def _title(seeds: int, seed: int, solver: str, duration: float) -> str:
    flown = f"seed {seed + 1}" if seeds == 1 else f"seeds {seed + 1} … {seed + seeds}"
    return f"{flown}, {duration:g} s, trained on seed {seed}, {solver}"


def _axes(names: list[str]) -> "list[Axis]":
    """The axes of these names, all where there are none.   Raises: ValueError: on an unknown one."""
    from diagrams.robustness.robustness import AXES

    known = [axis.name for axis in AXES]
    if unknown := set(names) - set(known):
        raise ValueError(f"--axis: must be one of {', '.join(known)}; got {', '.join(sorted(unknown))}.")
    return [axis for axis in AXES if not names or axis.name in names]


def _draw(lines: list[dict], out: Path, title: str) -> None:
    from diagrams.robustness.figure import robustness_figure
    from np_drake.figure_file import save

    save(robustness_figure(lines, title), out / "robustness.png")
    say(f"figure: {out / 'robustness.png'}")


def _notes(trainings: "list[Record]", flights: "list[Record]", lines: list[dict]) -> list[str]:
    """What stands under the tables: lost flights, the rotors' room, spread over seeds, cost."""
    from diagrams.robustness.table import axes_of, extremes, lost_lines

    lost = lost_lines(flights)
    failed = [f"training of {r['case']['model']}: {r['error']}" for r in trainings if "error" in r]
    spread = [
        point["spread"]
        for line in lines
        for point in line["points"]
        if point["spread"] and point["flights"] > 1
    ]
    minutes = sum(record["seconds"] or 0.0 for record in [*trainings, *flights]) / 60
    return [
        f"{len(flights)} flights, lost or failed: {len(lost)}; failed solves: "
        f"{sum(r['result']['solve_failures'] for r in flights if 'result' in r)}",
        *failed,
        *lost,
        *extremes(flights, axes_of(lines)),
        *(
            [f"E_xy of a seed is at most {100 * max(spread):.0f} % off the mean of its cell"]
            if spread
            else []
        ),
        f"processor time of all cases: {minutes:.0f} min",
    ]


def limits_printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows: where each controller is better than nominal, and where it is lost."""
    from diagrams.robustness.table import axes_of

    header = ["axis", "controller", "E_xy better", "E_z better", "lost at", "growth", "failed", "at limit"]
    rows: list[tuple] = []
    for axis in axes_of(lines):
        for line in (line for line in lines if line["axis"] == axis.name):
            points = line["points"]
            lost = [f"{p['value']:g} ({p['lost']} of {p['flights']})" for p in points if p["lost"]]
            growth = [p["growth"] for p in points if p["growth"] is not None]
            rows.append((
                f"{axis.title} [{axis.unit}]", line["row"],
                *(_intervals(line, key, axis.values) for key in ("E_xy", "E_z")),
                ", ".join(lost) or "none",
                f"{max(growth):.2f}" if growth else "–",
                sum(p["solve_failures"] for p in points),
                f"{100 * max(p['at_limit'] for p in points):.0f} %",
            ))  # fmt: skip
    return f"where it is better than nominal; {title}", header, rows


def _intervals(line: dict, key: str, values: tuple[float, ...]) -> str:
    """`all`, `nowhere` or the intervals where the controller is better than nominal."""
    from diagrams.robustness.table import NOMINAL

    if line["row"] == NOMINAL:
        return "–"
    found = line["better"][key]
    if len(found) == 1 and (found[0][0], found[0][1]) == (values[0], values[-1]):
        return "all"
    return (
        ", ".join(f"{low:.3g} … {high:.3g}" if high > low else f"{low:.3g}" for low, high in found)
        or "nowhere"
    )


def errors_printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows: a block an axis, whose first row has the values; errors in cm."""
    from diagrams.robustness.table import axes_of

    columns = max(len(axis.values) for axis in axes_of(lines))
    rows: list[tuple] = []
    for axis in axes_of(lines):
        values = [f"{value:g}" for value in axis.values]
        rows.append((f"{axis.title} [{axis.unit}]", *values, *[""] * (columns - len(values))))
        for line in (line for line in lines if line["axis"] == axis.name):
            cells = [_errors(point) for point in line["points"]]
            rows.append((line["row"], *cells, *[""] * (columns - len(cells))))
    return f"E_xy / E_z [cm]; {title}", ["", *[""] * columns], rows


def _errors(point: dict) -> str:
    if point["lost"]:
        return f"lost {point['lost']} of {point['flights']}"
    return f"{100 * point['E_xy']:.2f} / {100 * point['E_z']:.2f}"
