"""Studies of flights that are drawn at random, of no setting that anything was chosen on:
`beyond`, with what no pendulum explains, and `changes`, with payloads hung on and cut off in
flight.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any

import numpy as np
import pandas as pd
from typer import Option

from diagrams.batch.run import Case, FailedRun, Report, Run, failures, results
from diagrams.evidence.studies import tracking
from diagrams.evidence.studies.options import (
    DEFAULT_SOLVER,
    Column,
    Only,
    Solver,
    fixed,
    percent,
    tabulate,
)
from diagrams.evidence.studies.sweep import (
    DITHERED,
    FlownRun,
    Row,
    choose_rows,
    fly_rows,
    named,
    tidy,
    training_config,
)
from diagrams.loop.experiments import settings_of
from diagrams.loop.flight_result import fly
from diagrams.random_flights import BEYOND, PLAIN, Envelope, drawn_flight
from np_drake import metrics
from np_drake.vehicle import Vehicle

PEER = "payload_filter"  # row beside which the others are shown
ROWS = tuple(named(tracking.ROWS, name) for name in ("np", PEER, "hold"))
SETTLED = 3.0  # after the ramp, before errors count [s]
# the levels of f_z are means over these [s]
BEFORE = (-1.0, -0.05)
AFTER = (1.5, 2.5)
WATCHED = 3.0  # after an event, in which the error's peak is looked for [s]
KNOWN = 0.9  # share of the change of f_z that counts as known [1]
SOON = 0.2  # within which a change ought to be known [s]
BEYOND_SETTINGS = Envelope(tuple(BEYOND), 0.0)
CHANGES = Envelope((PLAIN,), 1.0)
Draws = Annotated[int, Option("--draws", min=1, max=100_000, help="Flights a row.")]


def flown(case: Case, row: Row, model: str, *, envelope: Envelope, solver: str) -> dict:
    """Return kind, errors [m] and the response to an event of a drawn flight, or why it was lost.

    A flight that cannot be flown as drawn has a kind of "".
    """
    kind = ""
    try:
        kind, config = drawn_flight(case["draw"], envelope, seed=case["seed"], vehicle=Vehicle())
        config.controller.kind = row.kind
        config.controller.solver = solver
        config.controller.predictor = model
        s = fly(config.check(), seed=case["draw"]).signals
    except (ValueError, FailedRun) as error:
        return {"kind": kind, "lost": str(error)}
    steady = s["t"] >= config.reference.lead + SETTLED
    errors = metrics.tracking_errors(s["x_true"][steady, :3], s["p_ref"][steady])
    result = {"kind": kind, "lost": "", "E_xy": errors["E_xy"], "E_z": errors["E_z"]}
    for event in config.events:
        t = s["t"] - event.time
        distance = np.linalg.norm(s["x_true"][:, :3] - s["p_ref"], axis=1)
        result["peak"] = distance[(t >= 0) & (t < WATCHED)].max()
        result["known"] = known_after(t, s["chi_hat"][:, 2])
    return result


def known_after(t: np.ndarray, f_z: np.ndarray) -> float:
    """Return when f_z (n,) has taken `KNOWN` of its change, at times t (n,) since the event [s];
    inf where it never has.
    """
    before, after = (f_z[(t >= low) & (t < high)].mean() for low, high in (BEFORE, AFTER))
    there = (t >= 0) & ((f_z - before) / (after - before) >= KNOWN)
    return t[np.argmax(there)] if there.any() else np.inf


def _report(
    run: FlownRun,
    name: str,
    envelope: Envelope,
    only: list[str] | None,
    table: Callable[[pd.DataFrame], list[dict[str, Any]]],
    columns: Sequence[Column],
    shown: str,
) -> Report:
    """Fly the draws with each row, and return the table that is made of their lines; `shown` says
    what it holds.
    """
    rows = choose_rows(ROWS, only, always=("np", PEER))
    settings = {
        "solver": run.solver,
        "seed": run.seed,
        "envelope": dc.asdict(envelope),
        "training": settings_of(training_config(DITHERED, solver=run.solver)),
    }
    scenarios = [{"draw": draw, "seed": run.seed + 1} for draw in range(run.count)]
    work = partial(flown, envelope=envelope, solver=run.solver)
    _, records = fly_rows(run, name, rows, scenarios, work, config=settings)
    results(records)
    flights = tidy(records)
    unflyable = int((flights["kind"] == "").sum()) // len(rows)
    flights = flights[flights["kind"] != ""].copy()
    flights["gone"] = (flights["lost"] != "") | (flights["error"] != "")
    flights["kind"] = flights["kind"].fillna("failed")
    flights.loc[flights["gone"], ["E_xy", "E_z"]] = np.inf
    lines = table(flights)
    title = (
        f"{run.count} draws of seed {run.seed + 1}, trained on seed {run.seed}, {run.solver}: "
        f"{shown}"
    )
    return Report(
        [tabulate(title, lines, columns)],
        config=settings,
        metrics={"table": lines, "flights": flights.to_dict("records")},
        notes=[
            f"draws that the paper's vehicle cannot fly: {unflyable}",
            *failures(run.workers.finished),
        ],
    )


def compared(flights: pd.DataFrame) -> list[dict[str, Any]]:
    """Return a line for every row and kind of flight, "all" among them: flights, lost ones, medians
    of the errors [m], and, against `PEER` and hold in the same draw, the median ratio of E_xy and
    the share in which it is smaller [1].
    """
    errors = flights.pivot(index="draw", columns="row", values="E_xy")
    lines = []
    for kind, of_kind in [("all", flights), *flights.groupby("kind")]:
        for row, group in of_kind.groupby("row", sort=False):
            line = {
                "kind": kind,
                "row": row,
                "flights": len(group),
                "lost": group["gone"].sum(),
                **group[["E_xy", "E_z"]].median().to_dict(),
            }
            mine = group.set_index("draw")["E_xy"]
            for other in {PEER, "hold"}.intersection(errors) - {row}:
                base = errors.loc[mine.index, other]
                line[f"{other}_ratio"] = (mine / base).median()
                line[f"{other}_better"] = (mine < base).mean()
            lines.append(line)
    return lines


COUNTS: tuple[Column, ...] = (("controller", "row"), ("n", "flights"), ("lost", "lost"))
COLUMNS: tuple[Column, ...] = (
    ("kind", "kind"),
    *COUNTS,
    ("xy [cm]", fixed("E_xy", 2, factor=100)),
    ("z [cm]", fixed("E_z", 2, factor=100)),
    ("to filter", fixed(f"{PEER}_ratio", 2)),
    ("better", percent(f"{PEER}_better")),
    ("to hold", fixed("hold_ratio", 2)),
    ("better", percent("hold_better")),
)


def beyond(
    run: Run, draws: Draws = 200, solver: Solver = DEFAULT_SOLVER, only: Only = None
) -> Report:
    """Drawn flights with what no pendulum explains: rope, two payloads, drag, spring, gusts."""
    return _report(
        FlownRun(**vars(run), count=draws, solver=solver),
        "beyond",
        BEYOND_SETTINGS,
        only,
        compared,
        COLUMNS,
        f"medians of E_xy, E_z; against {PEER} and hold, draw by draw",
    )


def responses(flights: pd.DataFrame) -> list[dict[str, Any]]:
    """Return a line for every row: flights, lost ones, median, 95th percentile and largest of the
    time until the force is known [s] and of the error's peak [m], and the share of flights in
    which it is known within `SOON` [1].
    """
    lines = []
    for row, group in flights.groupby("row", sort=False):
        line: dict[str, Any] = {
            "row": row,
            "flights": len(group),
            "lost": group["gone"].sum(),
            "soon": (group["known"].astype(float) <= SOON).mean(),
        }
        for key in ("known", "peak"):
            values = group[key].astype(float).fillna(np.inf)
            line[key] = values.median()
            line[f"{key}_95"] = np.quantile(values, 0.95, method="higher")
            line[f"{key}_most"] = values.max()
        lines.append(line)
    return lines


RESPONSE_COLUMNS: tuple[Column, ...] = (
    *COUNTS,
    ("90 % known [s]", fixed("known", 2)),
    ("95 % of flights", fixed("known_95", 2)),
    ("last", fixed("known_most", 2)),
    (f"in {SOON:g} s", percent("soon")),
    ("peak [cm]", fixed("peak", 2, factor=100)),
    ("95 % of flights", fixed("peak_95", 2, factor=100)),
    ("largest", fixed("peak_most", 2, factor=100)),
)


def changes(
    run: Run, draws: Draws = 200, solver: Solver = DEFAULT_SOLVER, only: Only = None
) -> Report:
    """Drawn flights in which a payload is hung on or cut off: how soon, and how far off."""
    return _report(
        FlownRun(**vars(run), count=draws, solver=solver),
        "changes",
        CHANGES,
        only,
        responses,
        RESPONSE_COLUMNS,
        "median over the flights, and the slowest",
    )
