"""`np-drake reproduce vehicles`: three sizes of vehicle on four tracks, each trained on 60 s of its own."""

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Annotated

from typer import Option

from diagrams.batch.workers import require_result
from diagrams.cli.columns import MISSING, Column, Line, grouped, spread, tabulate
from diagrams.cli.output import Table, counted, progress
from diagrams.cli.reproduce.campaign import Campaign, campaign, choose_rows
from diagrams.cli.reproduce.sweep import (
    Duration,
    make_sweep,
    title_of,
    trained,
)
from diagrams.cli.runner import Report

if TYPE_CHECKING:
    from diagrams.batch.campaign import Record


@campaign(seeds=3)
def vehicles(
    run: Campaign,
    only: Annotated[
        list[str] | None,
        Option("--only", help="Only rows of these names (nominal and oracle are always flown)."),
    ] = None,
    vehicle: Annotated[list[str] | None, Option(help="Only these vehicles: 35g | paper | 6kg.")] = None,
    track: Annotated[
        list[str] | None, Option(help="Only these tracks: circle | fast_lemniscate | steps | vertical.")
    ] = None,
    duration: Duration = 20.0,
) -> Report:
    """35 g, 2 kg and 6 kg on four tracks, each trained on 60 s of its own. --out DIR: cases to resume from.

    Durations are those of the paper's vehicle and scale with the others.
    """
    sweep = make_sweep(run, duration)
    from diagrams.robustness.vehicles import study
    from diagrams.robustness.vehicles.fleet import TRACKS, VEHICLES
    from diagrams.robustness.vehicles.table import ORACLE, vehicle_table

    chosen = chosen_of("--vehicle", vehicle, VEHICLES), chosen_of("--track", track, TRACKS)
    rows = choose_rows(study.ROWS, only, always=("nominal", ORACLE))
    with progress("vehicles", 1.0) as advance:
        trainings, flights = study.run_vehicles(
            sweep,
            seeds=run.seeds,
            rows=rows,
            vehicles=chosen[0],
            tracks=chosen[1],
            on_training=trained(advance),
            on_progress=counted(advance, "flights"),
        )
    require_result(flights)
    lines = vehicle_table(flights)
    config = study.campaign_config(run.seed, run.solver, duration) | {"seeds": run.seeds}
    return Report(
        vehicles_printed(lines, title_of(run, duration)),
        config=config,
        metrics={"table": lines, "runs": [*trainings, *flights]},
        notes=_notes(trainings, flights),
    )


def chosen_of(option: str, names: Collection[str] | None, known: Sequence[str]) -> list[str]:
    """Return the known names that are asked for, all where none is.

    Raises: ValueError: on an unknown one.
    """
    if unknown := set(names or ()) - set(known):
        raise ValueError(f"{option}: must be one of {', '.join(known)}; got {', '.join(sorted(unknown))}.")
    return [name for name in known if not names or name in names]


def _notes(trainings: "list[Record]", flights: "list[Record]") -> list[str]:
    """Return the lines under the tables: failed trainings, lost flights."""
    from diagrams.robustness.vehicles.table import lost_flights

    lost = lost_flights(flights)
    failed = sum(r["result"]["solve_failures"] for r in flights if "result" in r)
    return [
        f"{len(flights)} flights, lost or failed: {len(lost)}; failed solves: {failed}",
        *(
            f"training of {r['case']['model']}, {r['case']['vehicle']}: {r['error']}"
            for r in trainings
            if "error" in r
        ),
        *lost,
    ]


def vehicles_printed(lines: list[dict], title: str) -> list[Table]:
    """Return a table for every vehicle, a block for every track; errors in cm."""

    def error(key: str):
        value = spread(key, 3)
        return lambda line: MISSING if line[key] is None else value(line)

    columns: tuple[Column, ...] = (
        ("controller", "row"),
        ("E_xy [cm]", error("E_xy")),
        ("over oracle", _over("E_xy_ratio")),
        ("E_z [cm]", error("E_z")),
        ("over oracle", _over("E_z_ratio")),
        ("lost", lambda line: f"{line['lost']} of {line['flights']}"),
    )
    tables = []
    for vehicle in dict.fromkeys(line["vehicle"] for line in lines):
        mine = [line for line in lines if line["vehicle"] == vehicle]
        blocks: dict[str, list[tuple]] = {}
        for track in dict.fromkeys(line["track"] for line in mine):
            blocks[track] = tabulate("", [line for line in mine if line["track"] == track], columns)[2]
        said = f"vehicle {vehicle}, mean and 95 % interval; {title}"
        tables.append(grouped(said, [header for header, _ in columns], blocks))
    return tables


def _over(key: str):
    """Return the cell of a ratio to the oracle's error."""

    def cell(line: Line) -> str:
        return MISSING if line[key] is None else f"{line[key]:.1f}"

    return cell
