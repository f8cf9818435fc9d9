"""Study `robustness`: the circle with payload, motion, air, sensors or actuators changed.

Models are trained once, on the standard training flight, and flown everywhere, so that their
generalisation is tested.
"""

import dataclasses as dc
import itertools
from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any

import numpy as np
import pandas as pd
from typer import Option

from diagrams.batch.run import Case, Report, Run, Table, failures, require, results
from diagrams.evidence.studies.options import (
    DEFAULT_SOLVER,
    Column,
    Duration,
    Only,
    Seeds,
    Solver,
    chosen,
    fixed,
    percent,
    spread,
    tabulate,
)
from diagrams.evidence.studies.sweep import (
    DITHERED,
    FlownRun,
    Row,
    choose_rows,
    configure,
    fly_rows,
    means,
    named,
    tidy,
)
from diagrams.evidence.studies.tracking import ERRORS
from diagrams.evidence.studies.tracking import ROWS as TRACKING_ROWS
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import LostVehicle, fly
from np_drake import metrics
from np_drake.mpc.problem import MpcStatus
from np_drake.mpc.solvers import require_solver

SETTLING = 5.0  # part of the flight after the ramp that is not read [s]
# Distance from the reference beyond which a vehicle counts as lost; own choice: the circle's radius
# [m].
LOST = 1.0
HEIGHT = 2.4  # of the circle: room for the longest tether [m]
GUSTS = 0.25  # standard deviation of each axis of the wind, over its mean speed [1]
GROWING = 1.5  # growth of error or swing above which it counts as growing; own choice [1]
GROWTHS = ("growth", "swing_growth")  # keys of growth over the steady window [1]
ORACLE = "oracle"  # row that knows everything
# near the oracle: at most NEAR times its E_xy [1] and FLOOR more [m]
NEAR = 2.0
FLOOR = 0.001
# Rows of the tracking comparison that are flown.
SHOWN = ("nominal", "hold", "hold + total mass", "gp", "knode", "np", "payload_filter", ORACLE)
ROWS = tuple(named(TRACKING_ROWS, name) for name in SHOWN)
Setting = dict[str, float]  # value of every axis by name


@dc.dataclass(frozen=True)
class Axis:
    """A quantity that is varied while the others stay at their base."""

    name: str  # key of a case
    title: str  # in tables and plots
    unit: str  # of base and values
    base: float
    values: tuple[float, ...]  # that are flown


AXES = (
    Axis("mass", "payload", "kg", 0.26, (0.0, 0.13, 0.26, 0.38, 0.5)),
    Axis("length", "tether", "m", 0.8, (0.4, 0.6, 0.8, 1.2, 1.6)),
    Axis("speed", "speed", "m/s", 1.5, (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)),
    Axis("wind", "wind", "m/s", 0.0, (0.0, 2.0, 4.0, 6.0, 8.0)),
    Axis("gust", "gusts", "m/s", 0.0, (0.0, 0.5, 1.0, 1.5, 2.0)),
    Axis("noise", "noise", "1", 1.0, (1.0, 1.5, 2.0, 2.5, 3.0)),
    Axis("lag", "motor lag", "s", 0.03, (0.02, 0.03, 0.05, 0.08, 0.15)),
    Axis("delay", "command delay", "s", 0.0, (0.0, 0.01, 0.02, 0.03, 0.045, 0.06, 0.08)),
    Axis("loss", "thrust loss", "1/s", 0.0, (0.0, 0.0015, 0.003, 0.0045, 0.006)),
)
BASE: Setting = {axis.name: axis.base for axis in AXES}
GRID = {axis.name: axis.values[:5] for axis in AXES[:3]}  # every combination of these


def grid_settings(count: int) -> list[Setting]:
    """Return every point of the grid of `count` evenly spaced values of each quantity, the ends
    among them; without payload the tether's base, as there is none to differ.
    """
    at = np.linspace(0, 4, count).round().astype(int)
    points = itertools.product(*([values[i] for i in at] for values in GRID.values()))
    settings = [BASE | dict(zip(GRID, point, strict=True)) for point in points]
    return distinct([s if s["mass"] > 0 else s | {"length": BASE["length"]} for s in settings])


def distinct(settings: Sequence[Setting]) -> list[Setting]:
    """Return every setting once, in ascending order of the values."""
    return [dict(items) for items in sorted({tuple(setting.items()) for setting in settings})]


def flight_config(
    case: Case, row: Row = ROWS[0], *, solver: str, model: str = "", duration: float = 20.0
) -> FlightConfig:
    """Return the circle with the values of a case, for `duration` after the ramp [s]."""
    config = configure("circle", row, solver=solver, model=model)
    reality = config.reality
    noise = dc.asdict(reality.noise)
    reality.payload.length = case["length"]
    if case["mass"] > 0:
        reality.payload.mass = case["mass"]
    else:
        reality.payload.tether = "none"
    reality.noise = type(reality.noise)(**{k: case["noise"] * size for k, size in noise.items()})
    reality.wind = [case["wind"], 0.0, 0.0]
    reality.gust = GUSTS * case["wind"] + case["gust"]
    reality.gust_seed = case["seed"]
    reality.motor_lag = case["lag"]
    reality.command_delay = case["delay"]
    reality.thrust_loss = case["loss"]
    config.reference.speed = case["speed"]
    config.reference.height = HEIGHT
    config.duration = duration
    config.controller.extra_mass = case["mass"] if row.known_mass else 0.0
    return config.check()


def flown(case: Case, row: Row, model: str, **how: Any) -> dict:
    """Fly a case and return its measures."""
    config = flight_config(case, row, model=model, **how)
    try:
        return measures(config, fly(config, seed=case["seed"], tolerance=LOST).signals)
    except LostVehicle as error:
        return measures(config, error.signals, str(error))


def measures(config: FlightConfig, signals: dict[str, np.ndarray], why: str = "") -> dict:
    """Return the metrics of a flight until it is lost, and of its steady window where it is not.

    Returns:
        lost_at: when [s], or None; with `lost`: the simulator's line, where it ended the flight.
        E_xy, E_z [m], growth, swing_growth [1]: of the steady window; None where the vehicle is
            lost; `swing_growth`, that of the payload's horizontal distance from the vehicle, also
            without payload.
        solve_failures, fallbacks: periods until the loss.
        at_limit: share of these with a command at a rotor's limit [1].
    """
    t = signals["t"]
    distance = np.linalg.norm(signals["x_true"][:, :3] - signals["p_ref"], axis=1)
    far = ~(distance < LOST)  # so that NaN is far
    lost = why or far.any()
    end = np.argmax(far) if far.any() else len(t)
    rows = slice(0, max(end, 1))
    status = signals["status"][rows, 0]
    command = signals["u"][rows] @ config.vehicle.unmixer.T / config.vehicle.max_rotor_thrust
    return {
        **dict.fromkeys((*ERRORS, *GROWTHS)),
        **({} if lost else steady_measures(config, signals)),
        "lost_at": t[min(end, len(t) - 1)] if lost else None,
        "lost": why,
        "solve_failures": np.sum(status >= MpcStatus.SQP_FALLBACK),
        "fallbacks": np.sum(status >= MpcStatus.SHIFTED_PLAN),
        "at_limit": np.any((command > 1.0 - 1e-3) | (command < 1e-3), axis=1).mean(),
    }


def steady_measures(config: FlightConfig, signals: dict[str, np.ndarray]) -> dict[str, float]:
    """Return errors [m] and growths [1] of the steady window."""
    steady = signals["t"] >= config.reference.lead + SETTLING - 1e-9
    p = signals["x_true"][steady, :3]
    p_ref = signals["p_ref"][steady]
    plant = signals["plant_state"][steady]
    errors = metrics.tracking_errors(p, p_ref)
    values = {key: errors[key] for key in ERRORS} | {"growth": metrics.error_growth(p, p_ref)}
    if plant.shape[1] >= 26:  # there is a payload
        line = plant[:, 4:7] - plant[:, 11:14]
        values["swing_growth"] = metrics.error_growth(line, np.zeros_like(line))
    return values


def summaries(flights: pd.DataFrame) -> pd.DataFrame:
    """Return a line for every row and setting: row, value of every axis, and their `summary`."""
    groups = flights.groupby(["row", *BASE], sort=False)
    return pd.DataFrame(
        [dict(zip(("row", *BASE), at, strict=True)) | summary(group) for at, group in groups]
    )


def summary(flights: pd.DataFrame) -> dict[str, Any]:
    """Return means and 95 % intervals over the seeds of a row in a setting, NaN where a flight is
    lost.

    Returns: {"flights", "lost": lost or failed flights, "E_xy", "E_z" [m], their half intervals
        "…_ci95" (NaN of one seed), "growth", "swing_growth" [1], "spread": largest relative
        deviation of a seed's E_xy from the mean [1], "solve_failures", "at_limit" [1]}.
    """
    lost = (flights["lost_at"].notna() | (flights["error"] != "")).sum()
    line = means(flights, (*ERRORS, *GROWTHS))
    if lost:
        line = dict.fromkeys(line, np.nan)
    return {
        "flights": len(flights),
        "lost": lost,
        **{key: value for key, value in line.items() if not key.endswith("growth_ci95")},
        "spread": (flights["E_xy"].astype(float) / line["E_xy"] - 1.0).abs().max(),
        "solve_failures": flights["solve_failures"].sum(),
        "at_limit": flights["at_limit"].max(),
    }


def robustness_table(lines: pd.DataFrame, axes: Sequence[Axis]) -> list[dict]:
    """Return one line an axis and row that flew: `points`, a summary a value."""
    points = lines.set_index(["row", *BASE]).to_dict("index")
    return [
        {
            "axis": axis.name,
            "row": row,
            "points": [
                {"value": value, **points[row, *(BASE | {axis.name: value}).values()]}
                for value in axis.values
            ],
        }
        for axis, row in itertools.product(axes, lines["row"].unique())
    ]


def grid_points(lines: pd.DataFrame, settings: Sequence[Setting]) -> pd.DataFrame:
    """Return one line a row and setting of the grid; without payload, one for all tethers.

    Returns: row, mass [kg], length [m], speed [m/s], the summary, over_oracle: E_xy over that of
        the oracle [1], NaN where either is lost, near: whether it is near the oracle, None where
        that is lost, grows: whether error or swing grows by more than `GROWING`.
    """
    points = pd.DataFrame(settings, columns=[*BASE], dtype=float).merge(lines)
    points = points.drop(columns=BASE.keys() - GRID.keys())
    oracle = points[points["row"] == ORACLE].set_index([*GRID])["E_xy"]
    ideal = oracle.reindex(pd.MultiIndex.from_frame(points[[*GRID]])).to_numpy(float)
    near = (points["E_xy"] <= NEAR * ideal + FLOOR).astype(object)
    return points.assign(
        over_oracle=points["E_xy"] / ideal,
        near=near.where(np.isfinite(ideal), None),
        grows=(points[[*GROWTHS]] > GROWING).any(axis=1),
    )


def grid_table(points: pd.DataFrame) -> list[dict]:
    """Return one line a row that flew.

    Returns: {"row", "points", "near": share of the points near the oracle [1], None without oracle,
        "worst": largest E_xy over the oracle's [1], "worst_at": its point, "growing": points
        where error or swing grows,
        "lost": lost or failed flights, "flights"}.
    """
    lines = []
    for row, group in points.groupby("row", sort=False):
        near = group["near"].dropna().astype(float)
        judged = group.dropna(subset="over_oracle")
        worst = judged.nlargest(1, "over_oracle").to_dict("records")
        lines.append(
            {
                "row": row,
                "points": len(group),
                "near": near.mean() if len(near) else None,
                "worst": worst[0]["over_oracle"] if worst else None,
                "worst_at": {name: worst[0][name] for name in GRID} if worst else None,
                "growing": group["grows"].sum(),
                "lost": group["lost"].sum(),
                "flights": group["flights"].sum(),
            }
        )
    return lines


def run(
    run: Run,
    seeds: Seeds = 3,
    solver: Solver = DEFAULT_SOLVER,
    only: Only = None,
    axis: Annotated[
        list[str] | None,
        Option(
            help=(
                "Only these axes: mass | length | speed | wind | gust | noise | lag | delay | loss."
            )
        ),
    ] = None,
    grid: Annotated[
        bool,
        Option(
            "--grid", help="Also fly every payload mass with every tether length at every speed."
        ),
    ] = False,
    grid_values: Annotated[
        int | None,
        Option(
            min=2, max=5, help="Evenly spaced values of each quantity of the grid; default: all."
        ),
    ] = None,
    duration: Duration = 20.0,
) -> Report:
    """Payload, tether, speed, wind, noise, motors, delay and battery. --out DIR: cases to
    resume from.
    """
    require_solver(solver)
    run = FlownRun(**vars(run), count=seeds, solver=solver)
    rows = choose_rows(ROWS, only)
    names = chosen("--axis", axis, [axis.name for axis in AXES])
    axes = [axis for axis in AXES if axis.name in names]
    require(grid or grid_values is None, "--grid-values: must come with --grid.")
    crossed = grid_settings(grid_values or 5) if grid else []
    work = partial(flown, solver=solver, duration=duration)
    base = flight_config({"seed": 0, **BASE}, solver=solver, duration=duration)
    config = {
        "training": DITHERED,
        "mpc": dc.asdict(load_experiment("circle").controller.mpc),
        "reality": dc.asdict(base.reality),
        "reference": dc.asdict(base.reference),
        "scored": duration,
        "settling": SETTLING,
        "lost": LOST,
        "gusts": GUSTS,
    }
    along = [BASE | {axis.name: value} for axis in axes for value in axis.values]
    settings = distinct([*along, *crossed])
    scenarios = [{**setting, "seed": seed} for seed in run.seeds for setting in settings]
    trainings, flights = fly_rows(run, "robustness", rows, scenarios, work, config=config)
    results(flights)
    lines = summaries(tidy(flights))
    table = robustness_table(lines, axes)
    points = grid_points(lines, crossed)
    title = f"{duration:g} s, {run.title()}"
    tables = [errors_printed(table, key, title) for key in ERRORS]
    return Report(
        [*tables, grid_printed(points, title)] if grid else tables,
        config=run.settings | config,
        metrics={
            "table": table,
            "grid": {"points": points.to_dict("records"), "table": grid_table(points)},
            "runs": [*trainings, *flights],
        },
        notes=[f"lost: {lines['lost'].sum()} of {len(flights)}", *failures(run.workers.finished)],
    )


def errors_printed(lines: list[dict], key: str, title: str) -> Table:
    """Return the table of the error `key` in cm: a block for every axis, whose first row has the
    values.
    """
    value = spread(key)
    axes = [axis for axis in AXES if any(line["axis"] == axis.name for line in lines)]
    width = max(len(axis.values) for axis in axes)
    rows: list[tuple] = []
    for axis in axes:
        blank = [""] * (width - len(axis.values))
        head = f"{axis.title} [{axis.unit}]"
        rows.append((head, *map("{:g}".format, axis.values), *blank))
        for line in (line for line in lines if line["axis"] == axis.name):
            cells = (
                f"lost {p['lost']} of {p['flights']}" if p["lost"] else value(p)
                for p in line["points"]
            )
            rows.append((line["row"], *cells, *blank))
    return f"{key} [cm], mean and 95 % interval; {title}", [""] * (1 + width), rows


def grid_printed(points: pd.DataFrame, title: str) -> Table:
    """Return the table of the grid: E_xy by speed, and what `grid_table` gives."""

    def by_speed(speed: float):
        def cell(line: dict) -> str:
            flown = points[(points["row"] == line["row"]) & (points["speed"] == speed)]
            errors = 100 * flown["E_xy"].to_numpy()
            if np.isnan(errors).any():
                return "lost"
            return f"{np.median(errors):.2f} ({errors.min():.2f}–{errors.max():.2f})"

        return cell

    columns: list[Column] = [
        ("controller", "row"),
        *((f"{v:g} m/s", by_speed(v)) for v in sorted(points["speed"].unique())),
        ("near oracle", percent("near")),
        ("worst ratio", fixed("worst", 2)),
        ("growing", lambda line: f"{line['growing']} of {line['points']}"),
        ("lost", lambda line: f"{line['lost']} of {line['flights']}"),
    ]
    explanation = (
        "grid, E_xy [cm] by speed: median (smallest–largest) of its points; near oracle: at most "
        f"{NEAR:g} times its error and {100 * FLOOR:g} cm; growing: error or swing of the last "
        f"third above {GROWING:g} times that of the first"
    )
    return tabulate(f"{explanation}; {title}", grid_table(points), columns)
