"""Study `tracking`: every controller on circle and lemniscate, several seeds, one trained model a
row.
"""

import dataclasses as dc
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from typer import Option

from diagrams.batch.campaign import Case
from diagrams.batch.failed_run import FailedRun
from diagrams.batch.run import Report, Run, Table, failures, results
from diagrams.loop.experiments import load_experiment, scenario_file, settings_of
from diagrams.loop.flight_result import fly
from diagrams.studies.columns import Column, fixed, percent, spread, tabulate
from diagrams.studies.figures import Panel, panel_figure
from diagrams.studies.options import DEFAULT_SOLVER, FlownRun, Only, Reality, Seeds, Solver
from diagrams.studies.sweep import Row, choose_rows, configure, fly_rows, means, training_config
from np_drake.files.number_text import NOTHING
from np_drake.lifting.model.lifted_model import LIFTED, NEURAL
from np_drake.lifting.training.train import make_config
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.payload_filter.predictor import DEFAULT_BANK
from np_drake.residual_models.motion_model import GP, KNODE
from np_drake.residual_models.motion_training import CONFIGURATIONS
from np_drake.vehicle import Vehicle, load_vehicle

TRACKS = ("circle", "lemniscate")  # experiments that are flown
PLAIN, DITHERED = "plain_circle", "training_circle"  # experiments that are trained on
# The paper's Table II: (E_xy, E_z) [m], real flights. Source: Jin et al. 2025.
PAPER = {
    "nominal": {"circle": (0.1797, 0.2329), "lemniscate": (0.2029, 0.2539)},
    "gp": {"circle": (0.1414, 0.1692), "lemniscate": (0.1878, 0.1966)},
    "knode": {"circle": (0.0919, 0.1307), "lemniscate": (0.1503, 0.1406)},
    "np": {"circle": (0.0837, 0.0758), "lemniscate": (0.0849, 0.0591)},
}
DRAWN = ("nominal", "gp", "knode", "np")  # rows of the figure, the paper's controllers
ROWS = (
    Row("nominal", "nominal"),
    Row("nominal + total mass", "nominal", known_mass=True),
    Row("observer", "observer"),
    Row("observer + total mass", "observer", known_mass=True),
    Row("hold", "hold"),
    Row("hold + total mass", "hold", known_mass=True),
    Row("hold at 1 Hz + total mass", "hold", known_mass=True, hold_bandwidth=1.0),
    Row("gp: plain circle", "gp", training=PLAIN, configuration=GP),
    Row("gp", "gp", training=DITHERED, configuration=GP),
    Row("knode: plain circle", "knode", training=PLAIN, configuration=KNODE),
    Row("knode", "knode", training=DITHERED, configuration=KNODE),
    Row("np: paper, plain circle", "np", training=PLAIN, configuration="paper"),
    Row("np: plain circle", "np", training=PLAIN, configuration=NEURAL),
    Row(
        "payload_filter: plain circle", PAYLOAD_FILTER, training=PLAIN, configuration=PAYLOAD_FILTER
    ),
    Row("np: paper, dithered circle", "np", training=DITHERED, configuration="paper"),
    Row("np: lifted", "np", training=DITHERED, configuration=LIFTED),
    Row("np", "np", training=DITHERED, configuration=NEURAL),
    Row("payload_filter", PAYLOAD_FILTER, training=DITHERED, configuration=PAYLOAD_FILTER),
    Row("oracle", "oracle"),
)
ERRORS = ("E_xy", "E_z")  # keys of the errors [m]
LOST = {**dict.fromkeys((*ERRORS, "growth"), np.inf), "solve_failures": 0}  # of a lost vehicle


def flown(case: Case, row: Row, model: str, *, solver: str, **world: Any) -> dict:
    """Return the `fly` summary of a case and its last lap, or why the vehicle was lost.

    A lost vehicle is a result: another try would lose it too.
    """
    track, seed = case["track"], case["seed"]
    try:
        flight = fly(configure(track, row, solver=solver, model=model, **world), seed=seed)
    except FailedRun as error:
        head = {"experiment": track, "controller": row.kind, "seed": seed, "row": row.name}
        return {**head, "lost": str(error)}
    lap = {name: flight.signals[name][flight.last_lap, :2] for name in ("x_true", "p_ref")}
    return {**flight.summary(), "row": row.name, "lap": lap}


def table(summaries: Sequence[dict]) -> list[dict]:
    """Return E_xy and E_z [m] by row and track: means over seeds with 95 % interval (Student) and
    standard deviation, and the cut relative to nominal.
    """
    lines = []
    flights = pd.DataFrame(
        [{"row": s["row"], "track": s["experiment"], **s["metrics"]} for s in summaries]
    )
    groups = dict(list(flights.groupby(["row", "track"], sort=False)))
    for (row, track), of in groups.items():
        line = {"row": row, "track": track, **means(of, ERRORS)}
        base = groups.get(("nominal", track))
        for key in ERRORS:
            whole = np.isfinite(of[key]).all()
            line[f"{key}_sd"] = float(of[key].std()) if whole else np.nan
            if base is not None:
                line[f"{key}_cut"] = 1.0 - line[key] / float(base[key].mean())
        line["growth"] = float(of["growth"].mean())
        line["solve_failures"] = int(of["solve_failures"].sum())
        lines.append(line)
    return lines


def settings_of_training(rows: Sequence[Row], seed: int) -> dict[str, dict]:
    """Return the settings of every configuration that is trained, by its name; of a payload filter
    what it believes before.
    """
    found: dict[str, Any] = {}
    for name in (row.configuration for row in rows if row.configuration):
        known = CONFIGURATIONS.get(name)
        found[name] = dc.replace(known, seed=seed) if known else None
        if name == PAYLOAD_FILTER:
            found[name] = DEFAULT_BANK
    return {name: dc.asdict(own or make_config(name, seed=seed)) for name, own in found.items()}


def run(
    run: Run,
    seeds: Seeds = 5,
    solver: Solver = DEFAULT_SOLVER,
    only: Only = None,
    reality: Reality = None,
    vehicle: Annotated[str, Option(help="Vehicle that flies in place of the paper's.")] = "",
) -> Report:
    """Every controller on circle and lemniscate. --out DIR: models and figure."""
    run = FlownRun.of(run, count=seeds, solver=solver)
    rows = choose_rows(ROWS, only)
    world = world_of(reality, vehicle)
    how = {"solver": run.solver, **world}
    config = {
        "solver": run.solver,
        "training_seed": run.seed,
        "tracks": {track: settings_of(configure(track, ROWS[0], **how)) for track in TRACKS},
        "training": {name: settings_of(training_config(name, **how)) for name in (PLAIN, DITHERED)},
    }
    scenarios = [{"track": track, "seed": seed} for track in TRACKS for seed in run.seeds]
    work = partial(flown, **how)
    _, records = fly_rows(run, "tracking", rows, scenarios, work, config=config, **world)
    summaries = [{"metrics": LOST, **result} for result in results(records)]
    laps: dict[tuple[str, str], dict[str, list]] = {}
    for summary in summaries:
        lap = summary.pop("lap", None)
        if lap is not None and summary["seed"] == run.seeds[0]:
            laps[summary["experiment"], summary["row"]] = lap
    own = load_experiment("circle", **world).check()
    lines = table(summaries)
    lost = [
        f"{s['row']}, {s['experiment']}, seed {s['seed']}: {s['lost']}"
        for s in summaries
        if "lost" in s
    ]
    return Report(
        [printed(lines, run.title())],
        config={
            **run.settings,
            "mpc": dc.asdict(own.controller.mpc),
            "reality": dc.asdict(own.reality),
            "configurations": settings_of_training(rows, run.seed),
        },
        metrics={"table": lines, "runs": summaries},
        notes=[
            f"failed solves: {sum(line['solve_failures'] for line in lines)} in {len(summaries)} "
            f"flights; lost flights: {len(lost)}",
            *lost,
            *failures(run.workers.finished),
        ],
        figures={"plane_tracks.png": lambda: plane_tracks(laps, f"last lap, seed {run.seeds[0]}")},
    )


def world_of(reality: Path | None, vehicle: str = "") -> dict[str, Any]:
    """Return the arguments of `configure` for the options; the file's path is absolute, as workers
    may have another folder.
    """
    own: Vehicle | None = load_vehicle(vehicle) if vehicle else None
    return {"reality": reality and scenario_file(reality).resolve(), "vehicle": own}


def plane_tracks(laps: dict[tuple[str, str], dict[str, list]], title: str) -> Figure:
    """Plot the last lap of the paper's controllers by (track, row), the reference dotted."""
    panels = []
    for track in TRACKS:
        mine = {row: lap for (on, row), lap in laps.items() if on == track}
        curves = {row: np.array(mine[row]["x_true"]).T for row in DRAWN if row in mine}
        reference: Any = next((np.array(lap["p_ref"]).T for lap in mine.values()), ([], []))
        axes = {"xlabel": "x [m]", "ylabel": "y [m]", "title": track, "aspect": "equal"}
        panels.append(Panel(curves, axes, {"reference": reference}))
    return panel_figure([panels], title, width=10.0, height=4.6)


def printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines that `table` gives; errors in cm."""

    def paper(line: dict) -> str:
        return " / ".join(f"{100 * error:.1f}" for error in _published(line)) or NOTHING

    def paper_cut(line: dict) -> str:
        pairs = zip(_published(line), PAPER["nominal"][line["track"]], strict=False)
        return " / ".join(f"{100 * (1 - of / base):.0f} %" for of, base in pairs) or NOTHING

    columns: tuple[Column, ...] = (
        ("track", "track"),
        ("controller", "row"),
        ("E_xy [cm]", spread("E_xy")),
        ("cut", percent("E_xy_cut", 1)),
        ("E_z [cm]", spread("E_z")),
        ("cut", percent("E_z_cut", 1)),
        ("growth", fixed("growth", 2)),
        ("paper xy / z", paper),
        ("paper's cuts", paper_cut),
        ("failed", "solve_failures"),
    )
    return tabulate(title, sorted(lines, key=lambda line: line["track"]), columns)


def _published(line: dict) -> tuple[float, ...]:
    """Return the errors of this controller in the paper [m]; empty where it has none."""
    kinds = {row.name: row.kind for row in ROWS if not row.known_mass}
    return PAPER.get(kinds.get(line["row"], ""), {}).get(line["track"], ())
