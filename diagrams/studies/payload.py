"""Studies `hover`, in which the payload swings, and `attach`, in which 100 g more are hung on."""

import dataclasses as dc
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from diagrams.batch.campaign import Case
from diagrams.batch.failed_run import FailedRun
from diagrams.batch.run import Report, Run, failures, results
from diagrams.loop.experiments import settings_of
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.studies.columns import fixed, percent, spread, tabulate
from diagrams.studies.figures import Panel, panel_figure
from diagrams.studies.options import DEFAULT_SOLVER, FlownRun, Only, Reality, Seeds, Solver
from diagrams.studies.sweep import Row, choose_rows, configure, fly_rows, means, training_config
from diagrams.studies.tracking import DITHERED, PLAIN, world_of
from np_drake import metrics
from np_drake.files.number_text import NOTHING
from np_drake.lifting.model.lifted_model import NEURAL
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.residual_models.motion_model import GP, KNODE

# Position RMSE [m]. Source: Jin et al. 2025, hovering experiment
PAPER = {"nominal": 0.242, "np": 0.064}
KEYS = ("position_rmse", "early", "late", "E_xy", "E_z", "amplitude", "rate", "settling")
LOST = {**dict.fromkeys(KEYS, np.inf), "solve_failures": 0, "fallbacks": 0}  # of a lost vehicle
CUTS = ("position_rmse", "late", "E_xy")  # keys that are also given relative to nominal
EARLY = 2.0  # after the impulse; later every predictor has seen the swing begin [s]
DAMPED, FILTER_DAMPED = "np + active damping", "payload_filter + active damping"  # names of rows
_NEURAL: dict[str, Any] = {"training": DITHERED, "configuration": NEURAL}
_FILTER: dict[str, Any] = {"training": DITHERED, "configuration": PAYLOAD_FILTER}
ROWS = (
    Row("nominal", "nominal"),
    Row("hold", "hold"),
    # Slower than the swing (0.56 Hz): the level is compensated and most of the swing is not.
    Row("hold at 0.3 Hz", "hold", hold_bandwidth=0.3),
    Row("gp", "gp", training=DITHERED, configuration=GP),
    Row("knode", "knode", training=DITHERED, configuration=KNODE),
    Row("np: paper, plain circle", "np", training=PLAIN, configuration="paper"),
    Row("np", "np", **_NEURAL),
    # The weight on the body rates keeps tilting as slow as the swing; without it motor lag makes
    # pitch oscillate.
    Row(DAMPED, "np", weight_swing=10.0, weight_rate=3.0, **_NEURAL),
    Row("payload_filter", PAYLOAD_FILTER, **_FILTER),
    # Three times the weight: what the vehicle can do against the swing is less than the lifted
    # model makes of it.
    Row(FILTER_DAMPED, PAYLOAD_FILTER, weight_swing=30.0, weight_rate=3.0, **_FILTER),
    Row("oracle", "oracle"),
)
AFTER = 2.0  # from here on after the event the new level counts as reached [s]
# Step and its deviation [N]. Source: Jin et al. 2025, payload attached in flight
ATTACH_PAPER = {"step": 0.96, "deviation": 0.004}
SIGNALS = ("chi_hat", "label")  # whose step response is measured
ATTACH_ROWS = (
    Row("np", "np", training=DITHERED, configuration=NEURAL),
    Row("payload_filter", PAYLOAD_FILTER, training=DITHERED, configuration=PAYLOAD_FILTER),
    Row("np: paper, plain circle", "np", training=PLAIN, configuration="paper"),
)


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
    """Return the metrics of `KEYS` [m, 1/s, s], solver times and failures, of one flight with its
    impulse at the end of the ramp; `early` [s] parts the two position RMSE.
    """
    t, distance = swing_course(flight)
    rows, shared = flight.scored, flight.metrics()
    p, p_ref = flight.signals["x_true"][rows, :3], flight.signals["p_ref"][rows]

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
        line: dict = {"row": row, "flights": len(mine), **means(mine, KEYS)}
        line |= {f"{key}_cut": 1.0 - line[key] / float(base[key].mean()) for key in CUTS}
        line["solve_failures"] = int(mine["solve_failures"].sum())
        lines.append(line)
    return lines


COLUMNS = (
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
        lambda line: f"{100 * PAPER[line['row']]:.1f}" if line["row"] in PAPER else NOTHING,
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
    run, world = FlownRun.of(run, count=seeds, solver=solver), world_of(reality)
    rows, how = choose_rows(ROWS, only), {"solver": run.solver, **world}
    config = {
        "solver": run.solver,
        "training_seed": run.seed,
        "early": EARLY,
        "hover": settings_of(configure("hover_swing", ROWS[0], **how)),
        "training": settings_of(training_config(DITHERED, **how)),
    }
    work, scenarios = partial(swung, **how), [{"seed": seed} for seed in run.seeds]
    _, records = fly_rows(run, "hover", rows, scenarios, work, config=config, **world)
    runs = [{"metrics": LOST, **result} for result in results(records)]
    lines = hover_table(runs)
    controllers = {
        row.name: configure(
            "hover_swing", row, model=row.training and f"trained on {row.training}", **how
        )
        for row in rows
    }
    return Report(
        [tabulate(f"{run.title(learner='np ')}; ± 95 % interval of the mean", lines, COLUMNS)],
        config={
            **run.settings,
            "controllers": {name: dc.asdict(c.controller) for name, c in controllers.items()},
        },
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
    s, counts = flight.signals, flight.metrics()
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
    before, after = courses[:, (t < 0) & (t >= -AFTER)], courses[:, t >= AFTER]
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
        t, wanted = np.array(mine[0]["t"]), expected_step(config)
        height = np.array([run["height"] for run in mine])[:, t >= 0]
        shared = {
            **{"event": "attach", "row": row, "expected": wanted, "flights": len(mine)},
            "height_error": float(np.abs(height).max(axis=1).mean()),
            "solve_failures": int(sum(run["solve_failures"] for run in mine)),
        }
        for name in SIGNALS:
            step = step_response(t, np.array([run[name] for run in mine]))
            error = {"error": step["size"] / wanted - 1.0}
            lines.append({**shared, "signal": name, **step, **error})
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
    run, world = FlownRun.of(run, count=seeds, solver=solver), world_of(reality)
    how = {"solver": run.solver, **world}
    config = configure("attach", Row("", "nominal"), **how)
    settings = {
        "solver": run.solver,
        "training_seed": run.seed,
        "attach": settings_of(config),
        "training": settings_of(training_config(DITHERED, **how)),
    }
    work, scenarios = partial(attached, **how), [{"seed": seed} for seed in run.seeds]
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
