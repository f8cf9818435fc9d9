"""`np-drake reproduce robustness`: where each controller stops being better than nominal, and where it is lost."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from diagrams.batch.failed_run import FailedRun
from diagrams.cli import options
from diagrams.cli.columns import MISSING, Column, tabulate
from diagrams.cli.output import Table, counted, progress
from diagrams.cli.reproduce.campaign import Campaign, campaign, choose_rows
from diagrams.cli.runner import Report

if TYPE_CHECKING:
    from diagrams.batch.campaign import Record
    from diagrams.robustness.robustness import Axis

CASES = "cases"  # folder in --out with a file for every case
OutOfCases = Annotated[
    Path | None, Option("--out", metavar="DIR", help="Folder for the figure and every case, to resume from.")
]


@campaign(seeds=2, out=OutOfCases)
def robustness(
    run: Campaign,
    scheduler: Annotated[
        str, Option(metavar="ADDRESS", help="Fly on the Dask cluster of this scheduler: tcp://HOST:PORT.")
    ] = "",
    only: options.Only = None,
    axis: Annotated[
        list[str] | None, Option(help="Only these axes: mass | length | speed | wind | noise | lag.")
    ] = None,
    duration: Annotated[float, Option(min=10.0, help="Of a flight, after the ramp [s].")] = 20.0,
) -> Report:
    """Payload, tether, speed, wind and noise, one by one. --out DIR: figure, and cases to resume from."""
    from diagrams.batch.cluster import client

    if scheduler:
        with client(scheduler):
            pass  # refused before any work
    from diagrams.robustness import robustness as experiment
    from diagrams.robustness.figure import robustness_figure
    from diagrams.robustness.table import robustness_table
    from np_drake.mpc.solvers import require_solver

    rows, axes = choose_rows(experiment.ROWS, only), _axes(axis or [])
    require_solver(run.solver)
    with progress("robustness", 1.0) as advance:
        trainings, flights = experiment.run_robustness(
            run.folder / CASES if run.out else None,
            rows=rows,
            axes=axes,
            duration=duration,
            jobs=run.jobs,
            scheduler=scheduler,
            on_training=lambda done, total: advance(0.0, f"{done} of {total} trainings"),
            on_progress=counted(advance, "flights"),
            **run.settings,
        )
    if all("error" in record for record in flights):
        raise FailedRun(f"no flight has a result; the first: {flights[0]['error']}")
    lines = robustness_table(flights, axes)
    config = experiment.campaign_config(run.seed, run.solver, duration) | {"seeds": run.seeds}
    title = _title(run, duration)
    return Report(
        [limits_printed(lines, title), errors_printed(lines, title)],
        config=config,
        metrics={"table": lines, "runs": [*trainings, *flights]},
        notes=[*_notes(trainings, flights, lines), *(f"{name}: {value}" for name, value in config.items())],
        figures={"robustness.png": lambda: robustness_figure(lines, f"circle, {title}")},
    )


def _title(run: Campaign, duration: float) -> str:
    first, *_, last = [*run.seeds, run.seeds[-1]]
    seeds = f"seed {first}" if first == last else f"seeds {first} … {last}"
    return f"{seeds}, {duration:g} s, trained on seed {run.seed}, {run.solver}"


def _axes(names: list[str]) -> "list[Axis]":
    """Return the axes of these names, all where there are none.

    Raises: ValueError: on an unknown one.
    """
    from diagrams.robustness.robustness import AXES

    known = [axis.name for axis in AXES]
    if unknown := set(names) - set(known):
        raise ValueError(f"--axis: must be one of {', '.join(known)}; got {', '.join(sorted(unknown))}.")
    return [axis for axis in AXES if not names or axis.name in names]


def _notes(trainings: "list[Record]", flights: "list[Record]", lines: list[dict]) -> list[str]:
    """Return the lines under the tables: lost flights, the rotors' room, spread over seeds, cost."""
    from diagrams.robustness.table import axes_of, extremes, lost_lines

    lost = lost_lines(flights)
    failed = [f"training of {r['case']['model']}: {r['error']}" for r in trainings if "error" in r]
    points = [point for line in lines for point in line["points"]]
    spread = [p["spread"] for p in points if p["spread"] and p["flights"] > 1]
    said = [f"E_xy of a seed is at most {100 * max(spread):.0f} % off the mean of its cell"] if spread else []
    minutes = sum(record["seconds"] or 0.0 for record in [*trainings, *flights]) / 60
    return [
        f"{len(flights)} flights, lost or failed: {len(lost)}; failed solves: "
        f"{sum(r['result']['solve_failures'] for r in flights if 'result' in r)}",
        *failed,
        *lost,
        *extremes(flights, axes_of(lines)),
        *said,
        f"processor time of all cases: {minutes:.0f} min",
    ]


def limits_printed(lines: list[dict], title: str) -> Table:
    """Return the table of where each controller is better than nominal, and where it is lost."""
    from diagrams.robustness.table import axes_of

    def lost(line: dict) -> str:
        found = [f"{p['value']:g} ({p['lost']} of {p['flights']})" for p in line["points"] if p["lost"]]
        return ", ".join(found) or "none"

    def growth(line: dict) -> str:
        found = [p["growth"] for p in line["points"] if p["growth"] is not None]
        return f"{max(found):.2f}" if found else MISSING

    axes = {axis.name: axis for axis in axes_of(lines)}
    columns: tuple[Column, ...] = (
        ("axis", lambda line: f"{axes[line['axis']].title} [{axes[line['axis']].unit}]"),
        ("controller", "row"),
        ("E_xy better", lambda line: _intervals(line, "E_xy", axes[line["axis"]].values)),
        ("E_z better", lambda line: _intervals(line, "E_z", axes[line["axis"]].values)),
        ("lost at", lost),
        ("growth", growth),
        ("failed", lambda line: sum(p["solve_failures"] for p in line["points"])),
        ("at limit", lambda line: f"{100 * max(p['at_limit'] for p in line['points']):.0f} %"),
    )
    by_axis = [line for name in axes for line in lines if line["axis"] == name]
    return tabulate(f"where it is better than nominal; {title}", by_axis, columns)


def _intervals(line: dict, key: str, values: tuple[float, ...]) -> str:
    """Return `all`, `nowhere` or the intervals where the controller is better than nominal."""
    from diagrams.robustness.table import NOMINAL

    if line["row"] == NOMINAL:
        return MISSING
    found = line["better"][key]
    if len(found) == 1 and (found[0][0], found[0][1]) == (values[0], values[-1]):
        return "all"
    return ", ".join(f"{a:.3g} … {b:.3g}" if b > a else f"{a:.3g}" for a, b in found) or "nowhere"


def errors_printed(lines: list[dict], title: str) -> Table:
    """Return the table of errors: a block for every axis, whose first row has the values; errors in cm."""
    from diagrams.robustness.table import axes_of

    axes = axes_of(lines)
    header = [""] * (1 + max(len(axis.values) for axis in axes))
    rows: list[tuple] = []
    for axis in axes:
        rows.append((f"{axis.title} [{axis.unit}]", *(f"{value:g}" for value in axis.values)))
        rows += [(line["row"], *map(_errors, line["points"])) for line in lines if line["axis"] == axis.name]
    return f"E_xy / E_z [cm]; {title}", header, [(*row, *header[len(row) :]) for row in rows]


def _errors(point: dict) -> str:
    if point["lost"]:
        return f"lost {point['lost']} of {point['flights']}"
    return f"{100 * point['E_xy']:.2f} / {100 * point['E_z']:.2f}"
