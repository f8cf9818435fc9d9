"""Studies of flights with every controller, several seeds, one trained model a row: `tracking` on
circle and lemniscate, `hover`, in which the payload swings, and `attach`, in which 100 g more are
hung on.
"""

import dataclasses as dc
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
import pandas as pd
from typer import Option

from diagrams.batch.run import Report, Run, Table, failures
from diagrams.evidence.studies.options import (
    DEFAULT_SOLVER,
    Column,
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
    DITHERED,
    PLAIN,
    Comparison,
    FlownRun,
    Row,
    choose_rows,
    configure,
    named,
    summaries,
)
from diagrams.loop.controller_config import FILTER_MODEL
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult
from np_drake import metrics
from np_drake.files.figure_file import Figure, Panel, panel_figure
from np_drake.files.number_text import NOTHING
from np_drake.lifting.model.lpv_model import NEURAL_LPV
from np_drake.lifting.training.train import make_config
from np_drake.payload_filter.model_file import PAYLOAD_FILTER, PayloadFilterModel
from np_drake.residual_models.motion_model import GP, KNODE
from np_drake.residual_models.predictor_training import CONFIGURATIONS

TRACKS = ("circle", "lemniscate")  # experiments that are flown
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


def with_last_lap(flight: FlightResult) -> dict:
    """Return the `fly` summary of a flight, and its last lap from above as `drawn`."""
    lap = {name: flight.signals[name][flight.last_lap, :2] for name in ("x_true", "p_ref")}
    return {**flight.summary(), "drawn": lap}


TRACKING = Comparison(
    "tracking",
    TRACKS,
    with_last_lap,
    lost={**dict.fromkeys((*ERRORS, "growth"), np.inf), "solve_failures": 0},
)


def table(runs: Sequence[dict]) -> list[dict]:
    """Return E_xy and E_z [m] by row and track: means over seeds with 95 % interval (Student) and
    standard deviation, and the cut relative to nominal.
    """
    return [
        {
            "track": flights["experiment"].iat[0],
            **line,
            **{f"{key}_sd": flights[key].std() for key in ERRORS},
            "growth": flights["growth"].mean(),
        }
        for flights, line in summaries(runs, ERRORS, ERRORS)
    ]


def settings_of_training(rows: Sequence[Row], seed: int) -> dict[str, dict]:
    """Return the settings of every configuration that is trained, by its name; where the vehicle
    alone is, what is believed of its payload.
    """
    settings: dict[str, Any] = {}
    for name in {row.configuration: None for row in rows if row.configuration}:
        if name == PAYLOAD_FILTER:
            settings[name] = PayloadFilterModel.load(FILTER_MODEL).bank
        elif name in CONFIGURATIONS:
            settings[name] = dc.replace(CONFIGURATIONS[name], seed=seed)
        else:
            settings[name] = make_config(name, seed=seed)
    return {name: dc.asdict(config) for name, config in settings.items()}


def run(
    run: Run,
    seeds: Seeds = 5,
    solver: Solver = DEFAULT_SOLVER,
    only: Only = None,
    reality: Reality = None,
    vehicle: Annotated[str, Option(help="Vehicle that flies in place of the paper's.")] = "",
) -> Report:
    """Every controller on circle and lemniscate. --out DIR: models and figure."""
    run = FlownRun(**vars(run), count=seeds, solver=solver, reality=reality, vehicle=vehicle)
    rows = choose_rows(ROWS, only)
    runs = TRACKING.fly(run, rows)
    lines = table(runs)
    world = run.world
    flown = load_experiment("circle", world["vehicle"], world["reality"]).check()
    lost = [
        f"{s['row']}, {s['experiment']}, seed {s['seed']}: {s['lost']}" for s in runs if "lost" in s
    ]
    return Report(
        [printed(lines, run.title())],
        config={
            **run.settings,
            "mpc": dc.asdict(flown.controller.mpc),
            "reality": dc.asdict(flown.reality),
            "configurations": settings_of_training(rows, run.seed),
        },
        metrics={"table": lines, "runs": without(runs, "drawn")},
        notes=[
            f"failed solves: {sum(line['solve_failures'] for line in lines)} in {len(runs)} "
            f"flights; lost flights: {len(lost)}",
            *lost,
            *failures(run.workers.finished),
        ],
        figures={"plane_tracks.png": lambda: plane_tracks(runs, run.seeds[0])},
    )


def without(runs: Sequence[dict], *names: str) -> list[dict]:
    """Return the results of flights as `--json` holds them, without the keys `names`."""
    return [{key: value for key, value in run.items() if key not in names} for run in runs]


def drawn_flights(runs: Sequence[dict], seed: int) -> dict[tuple[str, str], Any]:
    """Return what is drawn of the flights of a seed, by (experiment, row)."""
    return {
        (run["experiment"], run["row"]): run["drawn"]
        for run in runs
        if run["seed"] == seed and "drawn" in run
    }


def plane_tracks(runs: Sequence[dict], seed: int) -> Figure:
    """Plot the last lap of the paper's controllers on each track, the reference dotted."""
    laps = drawn_flights(runs, seed)
    panels = []
    for track in TRACKS:
        curves = {
            row: np.array(laps[track, row]["x_true"]).T for row in DRAWN if (track, row) in laps
        }
        flown = [np.array(lap["p_ref"]).T for (on, _), lap in laps.items() if on == track]
        axes = {"xlabel": "x [m]", "ylabel": "y [m]", "title": track, "aspect": "equal"}
        panels.append(Panel(curves, axes, {"reference": flown[0] if flown else ([], [])}))
    return panel_figure([panels], f"last lap, seed {seed}", width=10.0, height=4.6)


def published(line: dict) -> tuple[float, ...]:
    """Return the errors of this controller in the paper [m]; empty where it has none."""
    return PAPER.get(named(ROWS, line["row"]).kind, {}).get(line["track"], ())


def published_cuts(line: dict) -> list[str]:
    """Return the paper's cuts relative to nominal."""
    pairs = zip(published(line), PAPER["nominal"][line["track"]], strict=False)
    return [f"{100 * (1 - error / base):.0f} %" for error, base in pairs]


COLUMNS: tuple[Column, ...] = (
    ("track", "track"),
    ("controller", "row"),
    ("E_xy [cm]", spread("E_xy")),
    ("cut", percent("E_xy_cut", 1)),
    ("E_z [cm]", spread("E_z")),
    ("cut", percent("E_z_cut", 1)),
    ("growth", fixed("growth", 2)),
    (
        "paper xy / z",
        lambda line: " / ".join(f"{100 * error:.1f}" for error in published(line)) or NOTHING,
    ),
    ("paper's cuts", lambda line: " / ".join(published_cuts(line)) or NOTHING),
    ("failed", "solve_failures"),
)


def printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines that `table` gives; errors in cm."""
    return tabulate(title, sorted(lines, key=lambda line: line["track"]), COLUMNS)


# Position RMSE [m]. Source: Jin et al. 2025, hovering experiment
HOVER_PAPER = {"nominal": 0.242, "np: paper": 0.064, "np": 0.064}
HOVER_KEYS = ("position_rmse", "early", "late", "E_xy", "E_z", "amplitude", "rate", "settling")
CUTS = ("position_rmse", "late", "E_xy")  # keys that are also given relative to nominal
EARLY = 2.0  # after the impulse; later every predictor has seen the swing begin [s]
# names of rows
DAMPED = "np + active damping"
FILTER_DAMPED = "payload_filter + active damping"
NP = named(ROWS, "np")
FILTER = named(ROWS, "payload_filter")
AS_IN_THE_PAPER = named(ROWS, "np: paper")
HOVER_ROWS = (
    *(named(ROWS, name) for name in ("nominal", "hold", "gp", "knode")),
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
    shared = flight.metrics()
    error = (flight.flown - flight.signals["p_ref"])[flight.scored]
    squares = pd.Series(np.sum(error**2, axis=1)).groupby(t >= early).mean()
    kept = ("E_xy", "E_z", "position_rmse", "solve_failures", "fallbacks", "solve_ms")
    return {
        **{key: shared[key] for key in kept},
        "early": np.sqrt(squares.get(False, np.nan)),
        "late": np.sqrt(squares.get(True, np.nan)),
        "amplitude": distance.max(),
        "rate": metrics.decay_rate(t, distance),
        "settling": metrics.settling_time(t, distance),
    }


def swung(flight: FlightResult) -> dict:
    """Return metrics and the payload's course of a flight."""
    return {"metrics": hover_metrics(flight), "drawn": swing_course(flight)}


HOVER = Comparison(
    "hover",
    ("hover_swing",),
    swung,
    lost={**dict.fromkeys(HOVER_KEYS, np.inf), "solve_failures": 0, "fallbacks": 0},
)


def hover_table(runs: list[dict]) -> list[dict]:
    """Return one line a row: means over the seeds with 95 % interval, and cuts relative to
    nominal.
    """
    for run in runs:
        if run["metrics"]["settling"] is None:
            run["metrics"]["settling"] = np.inf  # it never comes
    return [
        {"flights": len(flights), **line} for flights, line in summaries(runs, HOVER_KEYS, CUTS)
    ]


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
    run = FlownRun(**vars(run), count=seeds, solver=solver, reality=reality)
    rows = choose_rows(HOVER_ROWS, only)
    runs = HOVER.fly(run, rows)
    lines = hover_table(runs)
    return Report(
        [tabulate(f"{run.title()}; ± 95 % interval of the mean", lines, HOVER_COLUMNS)],
        config={**run.settings, "controllers": HOVER.controllers(run, rows, "trained on {}")},
        metrics={"table": lines, "runs": without(runs, "drawn", "experiment")},
        notes=failures(run.workers.finished),
        figures={"hover_payload_distance.png": lambda: distances(runs, run.seeds[0])},
    )


def distances(runs: list[dict], seed: int) -> Figure:
    """Plot the payload's horizontal distance from the origin, one flight a controller."""
    curves = {
        row: (t, 100 * np.array(distance))
        for (_, row), (t, distance) in drawn_flights(runs, seed).items()
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


def attached(flight: FlightResult) -> dict:
    """Return the courses of f_z [N] and height [m] of a flight, time from its event on, and counts
    of solves.
    """
    s = flight.signals
    return {
        "t": s["t"] - flight.config.events[0].time,
        **{name: s[name][:, 2] for name in SIGNALS},
        "height": s["x_true"][:, 2] - flight.config.reference.height,
        "solve_failures": flight.metrics()["solve_failures"],
    }


ATTACH = Comparison("attach", ("attach",), attached)


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
        "size": steps.mean(),
        "size_ci95": metrics.half_width(steps),
        "rise": rise,
        "scatter": pd.Series(steps).std(),
        "overshoot": course[early].max() - 1.0,
        "dip": 1.0 - late.min() if len(late) else np.nan,
        "deviation": before.std(axis=1).mean(),
    }


def _crossing(t: np.ndarray, y: np.ndarray, level: float) -> float:
    """Return where y first reaches `level`, on the line between samples; inf if it never does."""
    k = np.argmax(y >= level)
    around = slice(max(k - 1, 0), k + 1)
    return np.interp(level, y[around], t[around]) if y[k] >= level else np.inf


def attach_table(runs: list[dict], config: FlightConfig) -> list[dict]:
    """Return one line a row and signal."""
    lines = []
    expected = expected_step(config)
    for row, flights in by_row(runs).items():
        t = np.array(flights[0]["t"])
        height = np.array([flight["height"] for flight in flights])[:, t >= 0]
        for name in SIGNALS:
            step = step_response(t, np.array([flight[name] for flight in flights]))
            lines.append(
                {
                    "event": "attach",
                    "row": row,
                    "expected": expected,
                    "flights": len(flights),
                    "height_error": np.abs(height).max(axis=1).mean(),
                    "solve_failures": sum(flight["solve_failures"] for flight in flights),
                    "signal": name,
                    **step,
                    "error": step["size"] / expected - 1.0,
                }
            )
    return lines


def by_row(runs: list[dict]) -> dict[str, list[dict]]:
    """Return the results of each row's flights."""
    rows = dict.fromkeys(run["row"] for run in runs)
    return {row: [run for run in runs if run["row"] == row] for row in rows}


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
    run = FlownRun(**vars(run), count=seeds, solver=solver, reality=reality)
    config = configure("attach", Row("", "nominal"), **run.world)
    runs = ATTACH.fly(run, ATTACH_ROWS)
    lines = attach_table(runs, config)
    controllers = ATTACH.controllers(run, ATTACH_ROWS[:1], f"trained on {{}}, seed {run.seed}")
    return Report(
        [tabulate(run.title(), lines, ATTACH_COLUMNS)],
        config={**run.settings, "controller": controllers[ATTACH_ROWS[0].name]},
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
    rows = by_row(runs)
    t = runs[0]["t"]
    curves = {
        row: (t, np.mean([flight["chi_hat"] for flight in flights], axis=0))
        for row, flights in rows.items()
    }
    labels = [flight["label"] for flight in next(iter(rows.values()))]
    axes = {"xlabel": "time since the event [s]", "ylabel": "$f_z$ [N]", "xlim": (-0.5, 1.5)}
    panel = Panel(curves, axes, {"label, low-passed": (t, np.mean(labels, axis=0))})
    return panel_figure([[panel]], title, width=7.5, height=3.6)
