"""Studies of flights with every controller, several seeds, one trained model a row: `tracking` on
circle and lemniscate, `hover`, in which the payload swings, and `attach`, in which 100 g more are
hung on.
"""

import dataclasses as dc
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from typer import Option

from diagrams.batch.run import Case, FailedRun, Report, Run, Table, failures, results
from diagrams.evidence.studies.options import (
    DEFAULT_SOLVER,
    Column,
    FlownRun,
    Only,
    Reality,
    Seeds,
    Solver,
    fixed,
    percent,
    spread,
    tabulate,
)
from diagrams.evidence.studies.sweep import (
    Row,
    choose_rows,
    configure,
    fly_rows,
    means,
    named,
    training_config,
)
from diagrams.loop.controller_config import FILTER_MODEL
from diagrams.loop.experiments import load_experiment, scenario_file, settings_of
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from np_drake import metrics
from np_drake.files.figure_file import Figure, Panel, panel_figure
from np_drake.files.number_text import NOTHING
from np_drake.lifting.model.lpv_model import NEURAL_LPV
from np_drake.lifting.training.train import make_config
from np_drake.payload_filter.model_file import PAYLOAD_FILTER, PayloadFilterModel
from np_drake.residual_models.motion_model import GP, KNODE
from np_drake.residual_models.predictor_training import CONFIGURATIONS
from np_drake.vehicle import load_vehicle

TRACKS = ("circle", "lemniscate")  # experiments that are flown
# experiments that are trained on
PLAIN = "plain_circle"
DITHERED = "training_circle"
# The paper's Table II: (E_xy, E_z) [m], real flights. Source: Jin et al. 2025.
PAPER = {
    "nominal": {"circle": (0.1797, 0.2329), "lemniscate": (0.2029, 0.2539)},
    "gp": {"circle": (0.1414, 0.1692), "lemniscate": (0.1878, 0.1966)},
    "knode": {"circle": (0.0919, 0.1307), "lemniscate": (0.1503, 0.1406)},
    "np": {"circle": (0.0837, 0.0758), "lemniscate": (0.0849, 0.0591)},
}
PACKAGED = NEURAL_LPV  # configuration of the row `np`, and of the packaged model
DRAWN = ("nominal", "gp", "knode", "np")  # rows of the figure, the paper's controllers
ROWS = (
    Row("nominal", "nominal"),
    Row("observer", "observer"),
    Row("hold", "hold"),
    Row("hold + total mass", "hold", known_mass=True),
    Row("gp: plain circle", "gp", training=PLAIN, configuration=GP),
    Row("gp", "gp", training=DITHERED, configuration=GP),
    Row("knode: plain circle", "knode", training=PLAIN, configuration=KNODE),
    Row("knode", "knode", training=DITHERED, configuration=KNODE),
    Row("np: paper", "np", training=DITHERED, configuration="paper"),
    Row("np", "np", training=DITHERED, configuration=PACKAGED),
    Row("payload_filter", PAYLOAD_FILTER, training=DITHERED, configuration=PAYLOAD_FILTER),
    Row("oracle", "oracle"),
)
ERRORS = ("E_xy", "E_z")  # keys of the errors [m]
LOST = {**dict.fromkeys((*ERRORS, "growth"), np.inf), "solve_failures": 0}  # of a lost vehicle


def flown(case: Case, row: Row, model: str, *, solver: str, **world: Any) -> dict:
    """Return the `fly` summary of a case and its last lap, or why the vehicle was lost.

    A lost vehicle is a result: another try would lose it too.
    """
    track = case["track"]
    seed = case["seed"]
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
            line[f"{key}_sd"] = float(of[key].std()) if np.isfinite(of[key]).all() else np.nan
            if base is not None:
                line[f"{key}_cut"] = 1.0 - line[key] / float(base[key].mean())
        line["growth"] = float(of["growth"].mean())
        lines.append(line | {"solve_failures": int(of["solve_failures"].sum())})
    return lines


def settings_of_training(rows: Sequence[Row], seed: int) -> dict[str, dict]:
    """Return the settings of every configuration that is trained, by its name; where the vehicle
    alone is, what is believed of its payload.
    """
    found: dict[str, Any] = {}
    for name in {row.configuration: None for row in rows if row.configuration}:
        if name == PAYLOAD_FILTER:
            found[name] = PayloadFilterModel.load(FILTER_MODEL).bank
        elif name in CONFIGURATIONS:
            found[name] = dc.replace(CONFIGURATIONS[name], seed=seed)
        else:
            found[name] = make_config(name, seed=seed)
    return {name: dc.asdict(own) for name, own in found.items()}


def run(
    run: Run,
    seeds: Seeds = 5,
    solver: Solver = DEFAULT_SOLVER,
    only: Only = None,
    reality: Reality = None,
    vehicle: Annotated[str, Option(help="Vehicle that flies in place of the paper's.")] = "",
) -> Report:
    """Every controller on circle and lemniscate. --out DIR: models and figure."""
    run = FlownRun(**vars(run), count=seeds, solver=solver)
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
    laps = {
        (s["experiment"], s["row"]): s["lap"]
        for s in summaries
        if "lap" in s and s["seed"] == run.seeds[0]
    }
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
        metrics={
            "table": lines,
            "runs": [{k: v for k, v in s.items() if k != "lap"} for s in summaries],
        },
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
    return {
        "reality": reality and scenario_file(reality).resolve(),
        "vehicle": load_vehicle(vehicle) if vehicle else None,
    }


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
    kinds = {row.name: row.kind for row in ROWS}
    return PAPER.get(kinds.get(line["row"], ""), {}).get(line["track"], ())


# Position RMSE [m]. Source: Jin et al. 2025, hovering experiment
HOVER_PAPER = {"nominal": 0.242, "np: paper": 0.064, "np": 0.064}
HOVER_KEYS = ("position_rmse", "early", "late", "E_xy", "E_z", "amplitude", "rate", "settling")
# of a lost vehicle
HOVER_LOST = {**dict.fromkeys(HOVER_KEYS, np.inf), "solve_failures": 0, "fallbacks": 0}
CUTS = ("position_rmse", "late", "E_xy")  # keys that are also given relative to nominal
EARLY = 2.0  # after the impulse; later every predictor has seen the swing begin [s]
# names of rows
DAMPED = "np + active damping"
FILTER_DAMPED = "payload_filter + active damping"
NP = named(ROWS, "np")
FILTER = named(ROWS, "payload_filter")
AS_IN_THE_PAPER = named(ROWS, "np: paper")
HOVER_ROWS = (
    *(named(ROWS, name) for name in ("nominal", "hold")),
    *(named(ROWS, name) for name in ("gp", "knode")),
    AS_IN_THE_PAPER,
    NP,
    # The weight on the body rates keeps tilting as slow as the swing; without it motor lag makes
    # pitch oscillate.
    dc.replace(NP, name=DAMPED, weight_swing=10.0, weight_rate=3.0),
    FILTER,
    dc.replace(FILTER, name=FILTER_DAMPED, weight_swing=10.0, weight_rate=3.0),
    named(ROWS, "oracle"),
)
AFTER = 2.0  # from here on after the event the new level counts as reached [s]
# Step and its deviation [N]. Source: Jin et al. 2025, payload attached in flight
ATTACH_PAPER = {"step": 0.96, "deviation": 0.004}
SIGNALS = ("chi_hat", "label")  # whose step response is measured
ATTACH_ROWS = (NP, FILTER, AS_IN_THE_PAPER)


def swing_course(flight: FlightResult) -> tuple[np.ndarray, np.ndarray]:
    """Return the time since the impulse [s] and the payload's horizontal distance from the origin
    [m], (n,) each.
    """
    if flight.payload_position is None:
        raise ValueError("hover: the payload must hang on a cable.")
    rows = flight.scored
    t = flight.signals["t"][rows] - flight.config.reference.ramp
    return t, np.linalg.norm(flight.payload_position[rows, :2], axis=1)


def hover_metrics(flight: FlightResult, early: float = EARLY) -> dict:
    """Return the metrics of `HOVER_KEYS` [m, 1/s, s], solver times and failures, of one flight with
    its impulse at the end of the ramp; `early` [s] parts the two position RMSE.
    """
    t, distance = swing_course(flight)
    rows = flight.scored
    shared = flight.metrics()
    p = flight.signals["x_true"][rows, :3]
    p_ref = flight.signals["p_ref"][rows]

    def rmse(part: np.ndarray) -> float:
        square = np.sum((p - p_ref)[part] ** 2, axis=1)
        return float(np.sqrt(square.mean())) if part.any() else float("nan")

    return {
        **metrics.tracking_errors(p, p_ref),
        "early": rmse(t < early),
        "late": rmse(t >= early),
        "amplitude": float(distance.max()),
        "rate": metrics.decay_rate(t, distance),
        "settling": metrics.settling_time(t, distance),
        **{key: shared[key] for key in ("solve_failures", "fallbacks", "solve_ms")},
    }


def swung(case: Case, row: Row, model: str, **how: Any) -> dict:
    """Return metrics and the payload's course of a case, or why the vehicle was lost."""
    head = {"row": row.name, "seed": case["seed"]}
    try:
        flight = fly(configure("hover_swing", row, model=model, **how), seed=case["seed"])
    except FailedRun as error:
        return {**head, "lost": str(error)}
    return {**head, "metrics": hover_metrics(flight), "course": swing_course(flight)}


def hover_table(runs: list[dict]) -> list[dict]:
    """Return one line a row: means over the seeds with 95 % interval, and cuts relative to
    nominal.
    """
    flights = pd.DataFrame([{"row": run["row"], **run["metrics"]} for run in runs])
    flights["settling"] = flights["settling"].astype(float).fillna(np.inf)  # it never comes
    base = flights[flights["row"] == "nominal"]
    lines = []
    for row, mine in flights.groupby("row", sort=False):
        line: dict = {"row": row, "flights": len(mine), **means(mine, HOVER_KEYS)}
        line |= {f"{key}_cut": 1.0 - line[key] / float(base[key].mean()) for key in CUTS}
        lines.append(line | {"solve_failures": int(mine["solve_failures"].sum())})
    return lines


HOVER_COLUMNS = (
    ("controller", "row"),
    ("3-D [cm]", spread("position_rmse")),
    ("cut", percent("position_rmse_cut", 1)),
    (f"first {EARLY:.0f} s", spread("early")),
    ("after", spread("late")),
    ("xy [cm]", spread("E_xy")),
    ("swing [cm]", spread("amplitude", 1)),
    ("decay [1/s]", spread("rate", 3, factor=1)),
    ("< 5 cm after [s]", spread("settling", 1, factor=1, lost="never")),
    (
        "paper 3-D",
        lambda line: (
            f"{100 * HOVER_PAPER[line['row']]:.1f}" if line["row"] in HOVER_PAPER else NOTHING
        ),
    ),
    ("failed", "solve_failures"),
)


def hover(
    run: Run,
    seeds: Seeds = 5,
    solver: Solver = DEFAULT_SOLVER,
    only: Only = None,
    reality: Reality = None,
) -> Report:
    """Hover while the payload swings. --out DIR: models, and the payload's distance as a figure."""
    run = FlownRun(**vars(run), count=seeds, solver=solver)
    world = world_of(reality)
    rows = choose_rows(HOVER_ROWS, only)
    how = {"solver": run.solver, **world}
    config = {
        "solver": run.solver,
        "training_seed": run.seed,
        "early": EARLY,
        "hover": settings_of(configure("hover_swing", HOVER_ROWS[0], **how)),
        "training": settings_of(training_config(DITHERED, **how)),
    }
    work = partial(swung, **how)
    scenarios = [{"seed": seed} for seed in run.seeds]
    _, records = fly_rows(run, "hover", rows, scenarios, work, config=config, **world)
    runs = [{"metrics": HOVER_LOST, **result} for result in results(records)]
    lines = hover_table(runs)
    controllers = {
        row.name: dc.asdict(
            configure(
                "hover_swing", row, model=row.training and f"trained on {row.training}", **how
            ).controller
        )
        for row in rows
    }
    return Report(
        [tabulate(f"{run.title()}; ± 95 % interval of the mean", lines, HOVER_COLUMNS)],
        config={**run.settings, "controllers": controllers},
        metrics={
            "table": lines,
            "runs": [{k: v for k, v in flown.items() if k != "course"} for flown in runs],
        },
        notes=failures(run.workers.finished),
        figures={"hover_payload_distance.png": lambda: distances(runs, run.seeds[0])},
    )


def distances(runs: list[dict], seed: int) -> Figure:
    """Plot the payload's horizontal distance from the origin, one flight a controller."""
    curves = {
        run["row"]: (run["course"][0], 100 * np.array(run["course"][1]))
        for run in runs
        if run["seed"] == seed and "course" in run
    }
    axes = {"xlabel": "time since the impulse [s]", "ylabel": "payload from the origin [cm]"}
    title = f"Hover, impulse on the payload, seed {seed}"
    return panel_figure([[Panel(curves, axes)]], title, width=7.5, height=4.5)


def expected_step(config: FlightConfig) -> float:
    """Return the change of f_z that a label from commanded thrust sees [N].

    It is the change of weight over the real thrust scale: in hover the real thrust, scale times the
    command, carries everything, and the label is the nominal weight less the command.
    """
    return -config.events[0].mass * config.vehicle.gravity / config.reality.thrust_scale


def attached(case: Case, row: Row, model: str, **how: Any) -> dict:
    """Return the courses of f_z [N] and height [m] of a case from its event on, and counts."""
    config = configure("attach", row, model=model, **how)
    flight = fly(config, seed=case["seed"])
    s = flight.signals
    counts = flight.metrics()
    return {
        **{"row": row.name, "seed": case["seed"], "t": s["t"] - config.events[0].time},
        **{name: s[name][:, 2] for name in SIGNALS},
        "height": s["x_true"][:, 2] - config.reference.height,
        **{key: counts[key] for key in ("solve_failures", "fallbacks")},
    }


def step_response(t: np.ndarray, courses: np.ndarray) -> dict[str, float]:
    """Return the step response of courses (flights, n) [N] at times t (n,) since the event [s].

    Returns:
        size: of the step, with half width size_ci95 of its 95 % interval [N].
        scatter: of the steps of single flights [N]. rise: until 90 % of the step on the mean
            response [s].
        overshoot, dip: extremes of the mean response within 2 s, above the new level, and below it
            once 90 % are reached [1, of the step].
        deviation: of one flight over time in steady hover before the event, mean over flights [N].
    """
    before = courses[:, (t < 0) & (t >= -AFTER)]
    after = courses[:, t >= AFTER]
    steps = after.mean(axis=1) - before.mean(axis=1)
    course = (courses.mean(axis=0) - before.mean()) / steps.mean()
    early = (t >= 0) & (t < AFTER)
    rise = _crossing(t[early], course[early], 0.9)
    late = course[early & (t >= rise)]
    return {
        **{"size": float(steps.mean()), "size_ci95": metrics.half_width(steps), "rise": rise},
        "scatter": float(np.std(steps, ddof=1)) if len(steps) > 1 else float("nan"),
        "overshoot": float(course[early].max() - 1.0),
        "dip": float(1.0 - late.min()) if len(late) else float("nan"),
        "deviation": float(before.std(axis=1).mean()),
    }


def _crossing(t: np.ndarray, y: np.ndarray, level: float) -> float:
    """Return where y first reaches `level`, on the line between samples; inf if it never does."""
    k = int(np.argmax(y >= level))
    around = slice(max(k - 1, 0), k + 1)
    return float(np.interp(level, y[around], t[around])) if y[k] >= level else float("inf")


def attach_table(runs: list[dict], config: FlightConfig) -> list[dict]:
    """Return one line a row and signal."""
    lines = []
    for row in dict.fromkeys(run["row"] for run in runs):
        mine = [run for run in runs if run["row"] == row]
        t = np.array(mine[0]["t"])
        wanted = expected_step(config)
        height = np.array([run["height"] for run in mine])[:, t >= 0]
        shared = {
            **{"event": "attach", "row": row, "expected": wanted, "flights": len(mine)},
            "height_error": float(np.abs(height).max(axis=1).mean()),
            "solve_failures": int(sum(run["solve_failures"] for run in mine)),
        }
        for name in SIGNALS:
            step = step_response(t, np.array([run[name] for run in mine]))
            off = step["size"] / wanted - 1.0
            lines.append({**shared, "signal": name, **step, "error": off})
    return lines


ATTACH_COLUMNS = (  # N, s, cm
    ("controller", "row"),
    ("signal", "signal"),
    ("step [N]", spread("size", 3, factor=1)),
    ("expected", fixed("expected", 3)),
    ("off", percent("error", 1)),
    ("90 % [s]", fixed("rise", 3)),
    ("over", percent("overshoot")),
    ("dip", percent("dip")),
    ("sd [N]", fixed("deviation", 3)),
    ("height [cm]", fixed("height_error", 1, factor=100)),
    ("failed", "solve_failures"),
)


def attach(
    run: Run, seeds: Seeds = 20, solver: Solver = DEFAULT_SOLVER, reality: Reality = None
) -> Report:
    """100 g more are hung on in flight. --out DIR: models, and the responses as a figure."""
    run = FlownRun(**vars(run), count=seeds, solver=solver)
    world = world_of(reality)
    how = {"solver": run.solver, **world}
    config = configure("attach", Row("", "nominal"), **how)
    settings = {
        "solver": run.solver,
        "training_seed": run.seed,
        "attach": settings_of(config),
        "training": settings_of(training_config(DITHERED, **how)),
    }
    work = partial(attached, **how)
    scenarios = [{"seed": seed} for seed in run.seeds]
    _, records = fly_rows(run, "attach", ATTACH_ROWS, scenarios, work, config=settings, **world)
    runs = results(records)
    lines = attach_table(runs, config)
    model = f"trained on {DITHERED}, seed {run.seed}"
    controller = dc.asdict(configure("attach", ATTACH_ROWS[0], model=model, **how).controller)
    return Report(
        [tabulate(run.title(), lines, ATTACH_COLUMNS)],
        config={**run.settings, "controller": controller},
        metrics={"table": lines},
        notes=[
            f"expected: the change of weight over the thrust scale {config.reality.thrust_scale}; "
            f"paper: {ATTACH_PAPER['step']} N, standard deviation {ATTACH_PAPER['deviation']} N.",
            *failures(run.workers.finished),
        ],
        figures={"attach_responses.png": lambda: responses(runs, f"seeds from {run.seeds[0]}")},
    )


def responses(runs: list[dict], title: str) -> Figure:
    """Plot the mean f_z that each controller predicts around the event, and the first's label."""
    t = runs[0]["t"]

    def course(row: str, name: str) -> tuple:
        return t, np.mean([run[name] for run in runs if run["row"] == row], axis=0)

    rows = list(dict.fromkeys(run["row"] for run in runs))
    curves = {row: course(row, "chi_hat") for row in rows}
    axes = {"xlabel": "time since the event [s]", "ylabel": "$f_z$ [N]", "xlim": (-0.5, 1.5)}
    panel = Panel(curves, axes, {"label, low-passed": course(rows[0], "label")})
    return panel_figure([[panel]], title, width=7.5, height=3.6)
