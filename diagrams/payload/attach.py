"""Hover while the payload changes: 100 g more, the cable cut, a slack cable that snaps taut."""

import dataclasses as dc
from collections.abc import Callable
from pathlib import Path

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.batch.flown import FlownRun
from diagrams.batch.workers import results
from diagrams.loop.experiments import settings_of
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.payload.hover_swing import TRAINING
from diagrams.tracking.model_files import (
    Models,
    Training,
    digest_of,
    key_of,
    model_path,
    rows_with_models,
    trained_models,
)
from diagrams.tracking.tracking import PLAIN, Row, configure, named, training_config
from np_drake import attitude
from np_drake.lifting.model.lifted_model import NEURAL
from np_drake.metrics import half_width
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from systems.payload_config import PayloadEvent, push, release

AFTER = 2.0  # from here on after the event the new level counts as reached [s]
TOSS = 0.3  # impulse upwards on the payload that makes the cable slack [N·s]
PAPER = {
    "step": 0.96,
    "deviation": 0.004,
}  # [N]. Source: Jin et al. 2025, payload attached in flight
BESIDE = 5  # flights at most of the events that the paper does not test [1]
SIGNALS = ("chi_hat", "label")  # whose step response is measured
# Each at the time of the experiment's own event; of the first two, the change of the hanging mass
# can be seen.
EVENTS: dict[str, Callable[[PayloadEvent], PayloadEvent]] = {
    "attach": lambda own: own,
    "release": lambda own: release(own.time),
    "snap": lambda own: push(own.time, [0.0, 0.0, TOSS]),
}

ROWS = (
    Row("np", "np", training=TRAINING, configuration=NEURAL),
    Row("payload_filter", PAYLOAD_FILTER, training=TRAINING, configuration=PAYLOAD_FILTER),
    Row("np: paper, plain circle", "np", training=PLAIN, configuration="paper"),
)


def attach_config(
    row: Row, *, solver: str, model: str, event: str = "attach", reality: Path | None = None
) -> FlightConfig:
    """Return the experiment `attach` under NP-MPC.

    Args:
        event: one of `EVENTS`.
        reality: scenario file that it is flown in, see `load_experiment`.
    """
    config = configure("attach", row, solver=solver, model=model, reality=reality)
    return dc.replace(config, events=[EVENTS[event](config.events[0])]).check()


def expected_step(event: str, config: FlightConfig) -> float:
    """Return the change of f_z that a label from commanded thrust sees [N].

    It is the change of weight over the real thrust scale: in hover the real thrust, scale times the
    command, carries everything, and the label is the nominal weight less the command.

    Args:
        event: one of `EVENTS`.
    """
    change = {"attach": -config.events[0].mass, "release": config.reality.payload.mass}.get(
        event, 0.0
    )
    return change * config.vehicle.gravity / config.reality.thrust_scale


def slack_time(flight: FlightResult) -> float:
    """Return how long the cable hangs slack before it first snaps taut, to one period [s]."""
    s, payload = flight.signals, flight.config.reality.payload
    x, p_WP = s["x_true"], s["plant_state"][:, 11:14]
    hook = attitude.rotate(x[:, 3:7], np.array(payload.hook))
    slack = np.linalg.norm(p_WP - x[:, :3] - hook, axis=1) < payload.length
    since = slack[s["t"] > flight.config.events[0].time]
    return float(
        flight.config.controller.period * (np.argmin(since) if not since.all() else len(since))
    )


@dc.dataclass(frozen=True)
class Flying:
    """Work of a flight: {"event", "row", "seed", …} -> courses of f_z [N] and height [m], and
    counts.

    reality: scenario file that all is flown in, see `load_experiment`.
    """

    models: Models
    solver: str
    reality: Path | None = None

    def __call__(self, case: Case) -> dict:
        """Fly the case."""
        event, seed = case["event"], case["seed"]
        row = named(ROWS, case["row"])
        with model_path(self.models[key_of(row)]) as model:
            config = attach_config(
                row, solver=self.solver, model=model, event=event, reality=self.reality
            )
            flight = fly(config, seed=seed)
        s, counts = flight.signals, flight.metrics()
        return {
            **{
                "event": event,
                "row": row.name,
                "seed": seed,
                "t": s["t"] - config.events[0].time,
                "slack": slack_time(flight),
            },
            **{name: s[name][:, 2] for name in SIGNALS},
            "height": s["x_true"][:, 2] - config.reference.height,
            **{key: counts[key] for key in ("solve_failures", "fallbacks")},
        }


def train_rows(run: FlownRun, reality: Path | None = None) -> Models:
    """Train what `ROWS` need, write the model files into the folder of the run and return their
    content.

    Args:
        reality: scenario file of the training flights, see `load_experiment`.
    """
    config = campaign_config(run.seed, run.solver, reality)
    return trained_models(run, ROWS, Training(run.seed, run.solver, reality), config)


def run_attach(run: FlownRun, models: Models, reality: Path | None = None) -> list[dict]:
    """Fly every event and seed, of release and snap the first `BESIDE`, and return their time
    histories.

    Time counts from the event. Flights without a result are missing; the records of the run's
    workers say why.

    Args:
        models: of `train_rows`.
        reality: scenario file that all is flown in, see `load_experiment`.
    Raises: FailedRun: if no flight has a result.
    """
    cases = [
        {"event": event, "row": row.name, "model": digest_of(models[key_of(row)]), "seed": seed}
        for event in EVENTS
        for row in rows_with_models(ROWS, models)
        for seed in (run.seeds if event == "attach" else run.seeds[:BESIDE])
    ]
    config = campaign_config(run.seed, run.solver, reality)
    records = run.cases(
        "attach", "flights", Flying(models, run.solver, reality), cases, config=config
    )
    courses = ("t", "height", *SIGNALS)
    return [
        flown | {name: np.array(flown[name], float) for name in courses}
        for flown in results(records)
    ]


def campaign_config(training_seed: int, solver: str, reality: Path | None = None) -> dict:
    """Return all that the results depend on other than the case itself.

    Args:
        reality: scenario file that all is flown in; None for none.
    """
    return {
        "solver": solver,
        "training_seed": training_seed,
        "toss": TOSS,
        "attach": settings_of(
            attach_config(Row("", "nominal"), solver=solver, model="", reality=reality)
        ),
        "training": settings_of(training_config(TRAINING, solver=solver, reality=reality)),
    }


@dc.dataclass(frozen=True)
class Step:
    """Response of a signal to a step.

    size: with half width size_ci95 of its 95 % interval [N].
    scatter: of the steps of single flights [N]. rise: until 90 % of the step on the mean response
        [s].
    overshoot, dip: extremes of the mean response within 2 s, above the new level, and below it once
        90 % are reached [1, of the step].
    deviation: of one flight over time in steady hover before the event, mean over flights [N].
    """

    size: float
    size_ci95: float
    scatter: float
    rise: float
    overshoot: float
    dip: float
    deviation: float


def step_response(t: np.ndarray, courses: np.ndarray) -> Step:
    """Return the step response of the given time histories.

    Args:
        t: (n,) since the event [s].
        courses: (flights, n) [N].
    """
    before, after = courses[:, (t < 0)], courses[:, t >= AFTER]
    before = before[:, t[t < 0] >= -AFTER]
    steps = after.mean(axis=1) - before.mean(axis=1)
    course = (courses.mean(axis=0) - before.mean()) / steps.mean()
    early = (t >= 0) & (t < AFTER)
    rise = _crossing(t[early], course[early], 0.9)
    late = course[early & (t >= rise)]
    return Step(
        size=float(steps.mean()),
        size_ci95=half_width(steps),
        scatter=float(np.std(steps, ddof=1)) if len(steps) > 1 else float("nan"),
        rise=rise,
        overshoot=float(course[early].max() - 1.0),
        dip=float(1.0 - late.min()) if len(late) else float("nan"),
        deviation=float(before.std(axis=1).mean()),
    )


def _crossing(t: np.ndarray, y: np.ndarray, level: float) -> float:
    """Return where y first reaches `level`, on the line between two samples; inf where it never
    does.
    """
    k = int(np.argmax(y >= level))
    if y[k] < level:
        return float("inf")
    if k == 0:
        return float(t[0])
    return float(t[k - 1] + (level - y[k - 1]) / (y[k] - y[k - 1]) * (t[k] - t[k - 1]))


def attach_table(runs: list[dict], config: FlightConfig) -> list[dict]:
    """Return one line an event, row and signal.

    The snap, which leaves no step, is given by its extremes.

    Args:
        runs: time histories of `run_attach`.
    """
    lines = []
    for event, row in dict.fromkeys((run["event"], run["row"]) for run in runs):
        mine = [run for run in runs if (run["event"], run["row"]) == (event, row)]
        t, wanted = mine[0]["t"], expected_step(event, config)
        height = np.array([run["height"] for run in mine])[:, t >= 0]
        shared = {
            "height_error": float(np.abs(height).max(axis=1).mean()),
            "solve_failures": int(sum(run["solve_failures"] for run in mine)),
            "flights": len(mine),
        }
        for name in SIGNALS:
            courses = np.array([run[name] for run in mine])
            line: dict = {"event": event, "row": row, "signal": name, "expected": wanted, **shared}
            if wanted:
                step = step_response(t, courses)
                line |= {**dc.asdict(step), "error": step.size / wanted - 1.0}
            else:
                mean = courses.mean(axis=0)[(t >= 0) & (t < AFTER)]
                line |= {"lowest": float(mean.min()), "highest": float(mean.max())}
                line["slack"] = float(np.mean([run["slack"] for run in mine]))
            lines.append(line)
    return lines
