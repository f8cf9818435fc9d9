"""Margins of every controller: the largest delay and the widest loop gain that its flight on the
circle bears.

A margin is found by bisection, a flight a step. It presumes that a flight which fails stays a
failure further out.
"""

import dataclasses as dc
import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import numpy as np
from typer import Option

from diagrams.batch.campaign import Case, Record
from diagrams.batch.columns import Column, tabulate
from diagrams.batch.flown import FlownOptions, choose_rows
from diagrams.batch.options import Only, Seeds
from diagrams.batch.run import Report, Run, Table
from diagrams.batch.workers import failures, require_result
from diagrams.robustness.axes import BASE
from diagrams.robustness.measures import GROWING
from diagrams.robustness.robustness import ROWS, Flying, Sweep, sweep_of
from diagrams.tracking.model_files import digest_of
from diagrams.tracking.tracking import Row
from np_drake.metrics import half_width

SPEEDS = (BASE["speed"], 2.5)  # of the home circle and of a faster one [m/s]


@dc.dataclass(frozen=True)
class Margin:
    """Quantity that leaves its base step by step, until a flight fails."""

    name: str  # of a case
    title: str  # in tables
    axis: str  # that is varied
    unit: str
    values: tuple[float, ...]  # from the base outward


MARGINS = (
    Margin("delay", "extra delay", "delay", "s", tuple(i / 200 for i in range(25))),
    Margin("gain up", "gain up", "gain", "1", tuple((20 + i) / 20 for i in range(41))),
    # Below 0.55 the rotors do not carry the payload: `FlightConfig.check` refuses it.
    Margin("gain down", "gain down", "gain", "1", tuple((20 - i) / 20 for i in range(10))),
)


def last_that_holds(holds: Callable[[float], bool], values: Sequence[float]) -> float | None:
    """Return the last of `values` at which `holds` is true, None where it is false at the first; by
    bisection.

    Args:
        holds: must not become true again where it was false before.
    """
    if not holds(values[0]):
        return None
    if holds(values[-1]):
        return values[-1]
    inside, outside = 0, len(values) - 1
    while outside - inside > 1:
        middle = (inside + outside) // 2
        inside, outside = (middle, outside) if holds(values[middle]) else (inside, middle)
    return values[inside]


def stable(result: dict) -> bool:
    """Return whether a flight stays near its reference and its error does not grow (`LOST`,
    `GROWING`).
    """
    return result["lost_at"] is None and result["growth"] <= GROWING


@dc.dataclass(frozen=True)
class Searching:
    """Work of a margin: case -> {"margin": last value that holds, or None, "flights": by value}."""

    fly: Callable[[Case], dict]  # case of a flight -> `measures`

    def __call__(self, case: Case) -> dict:
        """Find the margin of the case."""
        axis = next(margin.axis for margin in MARGINS if margin.name == case["margin"])
        flights: list[dict[str, Any]] = []

        def holds(value: float) -> bool:
            setting = BASE | {"speed": case["speed"], axis: value}
            result = self.fly({"row": case["row"], **setting, "seed": case["seed"]})
            flights.append({"value": value, "stable": stable(result), **result})
            return flights[-1]["stable"]

        return {"margin": last_that_holds(holds, case["values"]), "flights": flights}


def margin_cases(rows: Sequence[Row], seeds: Sequence[int], models: dict[str, bytes]) -> list[Case]:
    """Return every margin of every row at every speed with every seed."""
    return [
        {
            "row": row.name,
            "model": digest_of(models.get(row.configuration)),
            "margin": margin.name,
            "values": list(margin.values),
            "growing": GROWING,
            "speed": speed,
            "seed": seed,
        }
        for seed in seeds
        for speed in SPEEDS
        for margin in MARGINS
        for row in rows
    ]


def run_margins(sweep: Sweep, rows: Sequence[Row]) -> tuple[list[Record], list[Record]]:
    """Train what `rows` need, then find every margin.
    Returns: the records of the trainings and of the margins. Rows whose training failed do not fly.
    """
    trainings, models, able = sweep.train(rows)
    work = Searching(Flying(models, sweep.solver, sweep.duration))
    cases = margin_cases(able, sweep.seeds, models)
    return trainings, sweep.cases("margins", "margins", work, cases, config=sweep.config)


def margin_table(records: Sequence[Record]) -> list[dict]:
    """Return one line a row and speed that flew, in the order of `ROWS`.

    Returns: {"row", "speed" [m/s], "margins": by name {"values": of the seeds, None where the
    search failed or the
        first flight does not hold, "mean" and its half 95 % interval "ci95", None where one is
        missing, "end": whether every seed holds at the last value that was tried}}.
    """
    lines = []
    for speed in SPEEDS:
        for row in ROWS:
            mine = [
                r for r in records if (r["case"]["row"], r["case"]["speed"]) == (row.name, speed)
            ]
            found = {
                m.name: _margin(m, [r for r in mine if r["case"]["margin"] == m.name])
                for m in MARGINS
            }
            if mine:
                lines.append({"row": row.name, "speed": speed, "margins": found})
    return lines


def _margin(margin: Margin, records: Sequence[Record]) -> dict:
    """Return values, mean and interval of one margin over its seeds."""
    values = [r["result"]["margin"] if "result" in r else None for r in records]
    known = [value for value in values if value is not None]
    whole = bool(known) and len(known) == len(values)
    return {
        "values": values,
        "mean": float(np.mean(known)) if whole else None,
        "ci95": half_width(np.array(known)) if whole else None,
        "end": whole and all(value == margin.values[-1] for value in known),
    }


# Each third of what is scored then holds a lap at 1.5 m/s, and growth compares like with like.
WholeLaps = Annotated[float, Option(min=20.0, help="Of a flight, after the ramp [s].")]


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    seeds: Seeds = 3
    only: Only = None
    duration: WholeLaps = 20.0


def run(run: Run, options: Options) -> Report:
    """Largest delay and loop gain that each controller bears. With the --out DIR of robustness: its
    models.
    """
    run = sweep_of(run, options, options.duration)
    trainings, records = run_margins(run, choose_rows(ROWS, options.only))
    require_result(records)
    lines = margin_table(records)
    config = run.config | {"seeds": run.seeds}
    return Report(
        [_printed(lines, run.span)],
        config=config,
        metrics={"table": lines, "runs": [*trainings, *records]},
        notes=failures([*trainings, *records]),
    )


def _printed(lines: list[dict], title: str) -> Table:
    """Return the table of margins: mean and 95 % interval over the seeds, and every seed's
    value.
    """
    columns: list[Column] = [
        ("controller", "row"),
        ("speed [m/s]", lambda line: f"{line['speed']:g}"),
    ]
    for margin in MARGINS:
        columns.append((f"{margin.title} [{margin.unit}]", _cell(margin)))
    said = (
        "last value at which the vehicle stays within 1 m of the reference and its error "
        "does not grow"
    )
    return tabulate(f"{said}; {title}", lines, columns)


def _cell(margin: Margin):
    """Return the cell of a margin: `mean ± half interval (value of every seed)`; `≥`, `≤` at the
    end of the search.
    """
    outward = "≥ " if margin.values[-1] > margin.values[0] else "≤ "

    def cell(line: dict) -> str:
        found = line["margins"][margin.name]
        seeds = ", ".join("none" if value is None else f"{value:g}" for value in found["values"])
        if found["mean"] is None:
            return f"({seeds})"
        width = "" if math.isnan(found["ci95"]) else f" ± {found['ci95']:.2g}"
        return f"{outward if found['end'] else ''}{found['mean']:.3g}{width} ({seeds})"

    return cell
