"""Study `robustness`: where each controller stops being better than nominal, and where it is
lost.
"""

import dataclasses as dc
from typing import Annotated

from typer import Option

from diagrams.batch.campaign import Record
from diagrams.batch.columns import Column, spread, tabulate
from diagrams.batch.flown import FlownOptions, choose_rows
from diagrams.batch.options import Duration, Only, Seeds
from diagrams.batch.run import Report, Run, Table
from diagrams.batch.workers import require_result
from diagrams.robustness import robustness as experiment
from diagrams.robustness.axes import FLOWN, Axis, Grid
from diagrams.robustness.figure import robustness_figure
from diagrams.robustness.grid_report import grid_figures, grid_printed
from diagrams.robustness.grid_table import grid_points, grid_table
from diagrams.robustness.robustness import sweep_of
from diagrams.robustness.table import NOMINAL, axes_of, extremes, lost_lines, robustness_table
from np_drake.files.number_text import NOTHING


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    seeds: Seeds = 3
    only: Only = None
    axis: Annotated[
        list[str] | None,
        Option(
            help=(
                "Only these axes: mass | length | speed | wind | gust | noise | lag | delay | loss."
            )
        ),
    ] = None
    grid: Annotated[
        bool,
        Option(
            "--grid", help="Also fly every payload mass with every tether length at every speed."
        ),
    ] = False
    grid_values: Annotated[
        int | None,
        Option(
            min=2, max=5, help="Evenly spaced values of each quantity of the grid; default: all."
        ),
    ] = None
    duration: Duration = 20.0


def run(run: Run, options: Options) -> Report:
    """Payload, tether, speed, wind, noise, motors, delay and battery. --out DIR: figures, and cases
    to resume from.
    """
    run = sweep_of(run, options, options.duration)
    rows, axes = choose_rows(experiment.ROWS, options.only), _axes(options.axis or [])
    grid = _grid(options)
    trainings, flights = experiment.run_robustness(run, rows, axes, grid)
    require_result(flights)
    lines, title = robustness_table(flights, axes), run.span
    points = grid_points(flights, grid) if grid else []
    config = run.config | {"seeds": run.seeds}
    tables = [_limits(lines, title), *(_errors(lines, key, title) for key in ("E_xy", "E_z"))]
    figures = {"robustness.png": lambda: robustness_figure(lines, f"circle, {title}")}
    return Report(
        [*tables, *grid_printed(points, title)],
        config=config,
        metrics={
            "table": lines,
            "grid": {"points": points, "table": grid_table(points)},
            "runs": [*trainings, *flights],
        },
        notes=[
            *_notes(trainings, flights, lines),
            *(f"{name}: {value}" for name, value in config.items()),
        ],
        figures=figures | grid_figures(points, grid, f"circle, {title}"),
    )


def _grid(options: Options) -> Grid | None:
    """Return the grid that is flown besides; None without `--grid`.

    Raises: ValueError: on values of no grid.
    """
    if options.grid_values is None:
        return Grid() if options.grid else None
    if not options.grid:
        raise ValueError("--grid-values: must come with --grid.")
    return Grid().thinned(options.grid_values)


def _axes(names: list[str]) -> list[Axis]:
    """Return the axes of these names, all where there are none.

    Raises: ValueError: on an unknown one.
    """
    known = [axis.name for axis in FLOWN]
    if unknown := set(names) - set(known):
        raise ValueError(
            f"--axis: must be one of {', '.join(known)}; got {', '.join(sorted(unknown))}."
        )
    return [axis for axis in FLOWN if not names or axis.name in names]


def _notes(trainings: list[Record], flights: list[Record], lines: list[dict]) -> list[str]:
    """Return the lines under the tables: lost flights, the rotors' room, spread over seeds,
    cost.
    """
    lost = lost_lines(flights)
    points = [point for line in lines for point in line["points"]]
    spread = [p["spread"] for p in points if p["spread"] and p["flights"] > 1]
    said = (
        [f"E_xy of a seed is at most {100 * max(spread):.0f} % off the mean of its cell"]
        if spread
        else []
    )
    return [
        f"{len(flights)} flights, lost or failed: {len(lost)}; failed solves: "
        f"{sum(r['result']['solve_failures'] for r in flights if 'result' in r)}",
        *(f"training of {r['case']['model']}: {r['error']}" for r in trainings if "error" in r),
        *lost,
        *extremes(flights, axes_of(lines)),
        *said,
    ]


def _limits(lines: list[dict], title: str) -> Table:
    """Return the table of where each controller is better than nominal, and where it is lost."""

    def lost(line: dict) -> str:
        found = [
            f"{p['value']:g} ({p['lost']} of {p['flights']})" for p in line["points"] if p["lost"]
        ]
        return ", ".join(found) or "none"

    def growth(line: dict) -> str:
        found = [p["growth"] for p in line["points"] if p["growth"] is not None]
        return f"{max(found):.2f}" if found else NOTHING

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
    if line["row"] == NOMINAL:
        return NOTHING
    found = line["better"][key]
    if len(found) == 1 and (found[0][0], found[0][1]) == (values[0], values[-1]):
        return "all"
    return ", ".join(f"{a:.3g} … {b:.3g}" if b > a else f"{a:.3g}" for a, b in found) or "nowhere"


def _errors(lines: list[dict], key: str, title: str) -> Table:
    """Return the table of the error `key` in cm: a block for every axis, whose first row has the
    values.
    """
    axes, value = axes_of(lines), spread(key)
    header = [""] * (1 + max((len(axis.values) for axis in axes), default=0))
    rows: list[tuple] = []

    def error(point: dict) -> str:
        return f"lost {point['lost']} of {point['flights']}" if point["lost"] else value(point)

    for axis in axes:
        rows.append((f"{axis.title} [{axis.unit}]", *(f"{value:g}" for value in axis.values)))
        rows += [
            (line["row"], *map(error, line["points"]))
            for line in lines
            if line["axis"] == axis.name
        ]
    return (
        f"{key} [cm], mean and 95 % interval; {title}",
        header,
        [(*row, *header[len(row) :]) for row in rows],
    )
