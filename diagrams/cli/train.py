"""`np-drake train`: a predictor from flight logs. `np-drake evaluate`: prediction skill against the
horizon, naive rows included.
"""

import dataclasses as dc
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

from typer import Argument, Option

from diagrams.batch.run import FailedRun, require
from diagrams.cli.fly import fly_all
from diagrams.cli.verb import (
    Report,
    Run,
    Table,
    VehicleFile,
    noted,
    option,
    progress,
    reports,
    require_once,
    require_outputs,
    say,
    tell,
)
from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL
from diagrams.loop.experiments import training_flight
from np_drake.files.figure_file import Panel, panel_figure, save
from np_drake.files.number_text import number
from np_drake.flight_log import FlightLog
from np_drake.lifting.model.lifted_model import CONFIGURATIONS, MODE_DICTIONARY, load_model
from np_drake.lifting.model.lpv_model import NEURAL_LPV
from np_drake.logs import opening
from np_drake.logs.formats.neurobem import is_array, published_vehicle, read_wrenches
from np_drake.payload_filter.model_file import PAYLOAD_FILTER, SCHEMA, PayloadFilterModel
from np_drake.payload_filter.training import opened_logs, train_payload_filter
from np_drake.residual_models.motion_model import KNODE, REACTIONS
from np_drake.skill.skill import Model, diverged, score_flights
from np_drake.trained_model import delay_of, rotor_lag_of, schema_of
from np_drake.training_data.accelerations import with_accelerations
from np_drake.training_data.segments import Flight, WrenchSequence, require_motion, require_torque
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.scaling import sampling_period

# Configuration of logs, and of arrays of real flights
BY_AXES = {"world": PAYLOAD_FILTER, "body": MODE_DICTIONARY}
SCENARIOS = (".yaml", ".yml")  # files that are flown
T = TypeVar("T")
LOG_HELP = "Flight logs (CSV, .csv.gz, Parquet), NeuroBEM CSV, or NeuroBEM arrays (.npy)."


@dc.dataclass(frozen=True)
class TrainOptions:
    """Options of `train`."""

    out: Path = option("Model file (safetensors).", default=dc.MISSING, metavar="FILE")
    logs: list[Path] = option(LOG_HELP, default=(), kind=Argument, metavar="LOG…")
    configuration: str | None = option(
        f"{' | '.join(CONFIGURATIONS)}, of np; payload_filter; gp | knode. Default: "
        f"{PAYLOAD_FILTER} for logs, {MODE_DICTIONARY} for arrays.",
        metavar="NAME",
    )
    epochs: int | None = option(
        "Passes over the data; neural-lpv: gradient steps, on logs 0 by default.",
        min=1,
        max=1_000_000,
    )
    envelope: int | None = option(
        "Learn from N simulated flights with payloads the priors of payload_filter, or from 2 N "
        "the network of neural-lpv.",
        metavar="N",
        min=1,
        max=10_000,
    )
    step: float | None = option(
        "Predictor step for flight logs [s]; default: the vehicle's, 0.02 for arms of 9 to 36 cm.",
        min=1e-4,
        max=1.0,
    )
    vehicle: VehicleFile = None
    force: bool = option(
        "Train though the vehicle moves in none of the logs.", "--force", default=False
    )


class Lesson(NamedTuple):
    """What a configuration is trained on, and to which file.

    name: of the configuration. vehicle: of the flights. step: of the predictor [s].
    """

    run: Run
    asked: TrainOptions
    name: str
    flights: Sequence[Flight]
    vehicle: Vehicle
    step: float


@dc.dataclass(frozen=True)
class Learnt:
    """Model, and what its training tells."""

    model: Any
    columns: list[str]
    rows: list[tuple]  # of the table
    loss: list[float] = dc.field(default_factory=list)  # after each epoch [1]
    settings: dict[str, Any] = dc.field(default_factory=dict)
    axes: tuple[str, str] = ("epoch [1]", "loss [1]")  # of the curve of `loss`


@reports("train", seed=0, markdown=False, many=True, files=("out",))
def train(run: Run, asked: TrainOptions) -> Report:
    """Train a predictor; writes the model, and the loss curve, if any, as a PNG beside it."""
    curve = _check_request(run, asked)
    lesson = _lesson(run, asked)
    name = lesson.name
    start = time.perf_counter()
    learnt = LEARNERS.get(name, _learn_lifted)(lesson)
    learnt.model.save(asked.out)
    wall = time.perf_counter() - start
    summary = learnt.model.summary
    if learnt.loss:
        epochs = range(1, len(learnt.loss) + 1)
        axes = {"xlabel": learnt.axes[0], "ylabel": learnt.axes[1], "yscale": "log"}
        figure = panel_figure(
            [[Panel({name: (epochs, learnt.loss)}, axes)]],
            f"training {name}",
            width=6.0,
            height=3.5,
        )
        save(figure, curve)
    return Report(
        [(f"{summary['samples']} samples, {wall:.1f} s", learnt.columns, learnt.rows)],
        config={"configuration": name, "step": lesson.step, "seed": run.seed, **learnt.settings},
        metrics={"loss": learnt.loss, "wall": wall, "summary": summary},
        lines=[f"excitation: {summary['excitation']}"] if "excitation" in summary else [],
        notes=[f"model: {asked.out}", *([f"loss curve: {curve}"] if learnt.loss else [])],
        warnings=noted(read_from(lesson.flights)),
    )


def _check_request(run: Run, asked: TrainOptions) -> Path:
    """Check what can be checked before a log is read, and return the file of the loss curve."""
    out = asked.out
    require(out.suffix == ".safetensors", f"--out: must end in .safetensors; got {out.name}.")
    curve = out.with_suffix(".png")
    require_outputs(out, curve, *([run.json] if run.json else []))
    known = (PAYLOAD_FILTER, *CONFIGURATIONS, *REACTIONS)
    require(
        asked.configuration in (None, *known),
        f"--configuration: must be one of {', '.join(known)}; got {asked.configuration}.",
    )
    require(
        bool(asked.logs or asked.envelope),
        "train: must have something to learn from; give LOG, or --envelope N.",
    )
    return curve


def _lesson(run: Run, asked: TrainOptions) -> Lesson:
    """Return the flights that are asked for, and what is trained on them.

    Raises: ValueError: where configuration, flights and options do not go together.
    """
    vehicle = asked.vehicle
    flights = open_flights(asked.logs, vehicle)
    if not asked.force:
        require_motion(flights)
    frame = flights[0].frame if flights else "world"
    name = asked.configuration or BY_AXES[frame]
    if asked.configuration is None:
        say(f"configuration: {name}, as the wrenches are in {frame} axes.")
    require(
        name in (PAYLOAD_FILTER, NEURAL_LPV) or not asked.envelope,
        f"--envelope: must be of {PAYLOAD_FILTER} or {NEURAL_LPV}; got {name}.",
    )
    require(
        bool(asked.logs) or asked.step is None,
        "--step: must be left out where --envelope alone teaches; it takes the vehicle's period.",
    )
    flown = flights[0].vehicle if flights else load_vehicle(vehicle) if vehicle else Vehicle()
    return Lesson(run, asked, name, flights, flown, asked.step or sampling_period(flown))


def _learn_vehicle(lesson: Lesson) -> Learnt:
    """Train a payload filter: its priors on the envelope, where that is asked for, and the vehicle
    of the flights.
    """
    learned = None
    loss = list[float]()
    if lesson.asked.envelope:
        from diagrams.training import train_on_envelope

        learned, loss = train_on_envelope(
            lesson.asked.envelope, run=lesson.run, vehicle=lesson.vehicle
        )
    with progress(f"training {PAYLOAD_FILTER}") as advance:
        if learned is not None and not lesson.flights:
            model = learned
        else:
            model = train_payload_filter(
                opened_logs(lesson.flights),
                step=lesson.step,
                prior=learned or PayloadFilterModel.load(FILTER_MODEL),
                on_pass=lambda done, total: advance(done / total, f"pass {done} of {total}"),
            )
    torque = ", ".join(f"{1e3 * c:.3g}" for c in model.speed_torque)
    rows: list[tuple] = [
        (
            "thrust error [%]",
            f"{100 * model.thrust_error:.2f} ± {100 * model.thrust_error_deviation:.2f}",
        ),
        (
            "drag [N·s/m]",
            f"{model.mass * model.drag:.3f} ± {model.mass * model.drag_deviation:.3f}",
        ),
        ("hook x, y, z [mm]", ", ".join(f"{1e3 * value:.1f}" for value in model.hook)),
        ("torque over velocity, roll, pitch [mN·s]", torque),
        *_timing(model.rotor_lag, model.delay),
    ]
    axes = ("trial [1]", "error [m]")
    return Learnt(model, ["vehicle", "found"], rows, loss, axes=axes)


def _timing(lag: float, delay: float) -> list[tuple]:
    """Return the rows of the timing of an actuator [s]."""
    return [
        ("rotor lag [ms]", f"{1e3 * lag:.1f}"),
        ("delay of commands [ms]", f"{1e3 * delay:.1f}"),
    ]


def _learn_network(lesson: Lesson) -> Learnt:
    """Train a network on the envelope, or take the packaged one, and fit it to the vehicle of the
    flights.
    """
    from diagrams.training import train_network_on_envelope
    from np_drake.residual_models.predictor_training import fitted_lpv

    flights = lesson.flights
    envelope = lesson.asked.envelope
    epochs = lesson.asked.epochs
    loss = list[float]()
    model: Any = load_model(NP_MODEL)
    if flights:  # refuses what does not suit it, before anything is flown
        count = 0 if envelope else epochs or 0
        fit = partial(fitted_lpv, model, flights, lesson.step, epochs=count)
        model = behind_bar("training the network", fit)
    if envelope:
        model, loss = train_network_on_envelope(
            envelope, run=lesson.run, vehicle=lesson.vehicle, epochs=epochs
        )
        model = fitted_lpv(model, flights, lesson.step) if flights else model
    rows = _timing(rotor_lag_of(model), delay_of(model) or 0.0)
    axes = ("report [1]", "loss [1]")
    return Learnt(model, ["vehicle", "found"], rows, loss, axes=axes)


def _learn_reaction(lesson: Lesson) -> Learnt:
    """Train a wrench as a function of the motion."""
    from np_drake.residual_models.predictor_training import train_motion_model

    name = lesson.name
    settings: dict[str, Any] = {"seed": lesson.run.seed}
    if name == KNODE and lesson.asked.epochs:
        settings["epochs"] = lesson.asked.epochs
    learn = partial(train_motion_model, name, lesson.flights, step=lesson.step, **settings)
    model, loss = behind_bar(f"training {name}", learn)
    rmse = ", ".join(f"{value:.4g}" for value in model.summary["label_rmse"])
    rows: list[tuple] = [("against the labels, RMSE [N, N·m]", rmse)]
    return Learnt(model, ["model", name], rows, loss, settings)


def _learn_lifted(lesson: Lesson) -> Learnt:
    """Train a lifted linear system."""
    from np_drake.lifting.training.train import make_config
    from np_drake.residual_models.predictor_training import train_on_flights

    flights = lesson.flights
    config = make_config(
        lesson.name, frame=flights[0].frame, seed=lesson.run.seed, epochs=lesson.asked.epochs
    )
    learn = partial(train_on_flights, flights, config, step=lesson.step)
    result = behind_bar(f"training {lesson.name}", learn)
    lag = rotor_lag_of(result.model)
    if lag > 0:
        tell(
            f"rotors: {1e3 * lag:.0f} ms behind the command; in flight the labels of this model "
            "allow for it."
        )
    loss = result.model.summary["loss"]
    by_block = loss if isinstance(loss, dict) else {"total": loss}
    rows: list[tuple] = [(block, float(value)) for block, value in by_block.items()]
    return Learnt(result.model, ["block", "loss [1]"], rows, result.loss, dc.asdict(config))


LEARNERS: dict[str, Callable[[Lesson], Learnt]] = {
    PAYLOAD_FILTER: _learn_vehicle,
    NEURAL_LPV: _learn_network,
    **dict.fromkeys(REACTIONS, _learn_reaction),
}  # by configuration; the others are lifted linear systems


def behind_bar(description: str, learn: Callable[..., T]) -> T:
    """Return the result of `learn(on_epoch=…)`, called behind a progress bar."""
    with progress(description) as advance:
        result = learn(
            on_epoch=lambda epoch, total, loss: advance(epoch / total, f"loss {loss:.4g}")
        )
    return result


def open_flights(paths: list[Path], vehicle_file: Path | None) -> list[Flight]:
    """Open and check every file; a scenario file is flown, once every other file is open.

    Without a vehicle file, NeuroBEM files have the published one, flight logs the paper's.
    Raises: LogError, OSError: one line, at the first file that is not usable; ValueError: on a bad
        vehicle file, or if NeuroBEM arrays are mixed with logs.
    """
    require_once(paths)
    vehicle = None if vehicle_file is None else load_vehicle(vehicle_file)
    inputs: list[Any] = []
    for path in paths:
        if path.suffix in SCENARIOS:
            inputs.append(training_flight(path))
        elif is_array(path):
            inputs.append(read_wrenches(path))
        else:
            inputs.append(opening.read_as_logged(path))
    opened = [source for source in inputs if isinstance(source, opening.Opened)]
    logs = iter(opening.with_vehicle(opened, vehicle))
    flights = list[Flight]()
    for path, source in zip(paths, inputs, strict=True):
        if isinstance(source, opening.Opened):
            log = next(logs)
            stated = vehicle or log.vehicle or Vehicle()
            for data in map(with_accelerations, map(require_torque, log.flights)):
                flights.append(Flight(data, stated))
        elif isinstance(source, WrenchSequence):
            flights.append(Flight(source, vehicle or published_vehicle()))
        else:
            (flown,) = fly_all([source], 0, [])
            say(f"{path}: flown for {source.end:g} s with {source.controller.name}, seed 0.")
            flights.append(Flight(flown.log(), source.vehicle))
    if vehicle is None and flights:
        used = sorted({f"{flight.vehicle.name}, {flight.vehicle.mass:g} kg" for flight in flights})
        say(f"vehicle: {'; '.join(used)}, as no --vehicle was given.")
    require(
        len({flight.frame for flight in flights}) <= 1,
        "flights: arrays (.npy) hold the total wrench in body axes, logs the residual "
        "one; give one kind.",
    )
    return flights


def read_from(flights: Sequence[Flight]) -> list[FlightLog]:
    """Return the logs among flights; the others are arrays, of which readers say nothing."""
    return [flight.data for flight in flights if isinstance(flight.data, FlightLog)]


HORIZONS = "1,5,10,20,40"
FARTHEST = 10**6  # steps ahead, own choice; flights are shorter
MOTIONS = ("held", "known")  # what a forecast knows of the coming zeta


@reports("evaluate", seed=None, markdown=False)
def evaluate(
    run: Run,
    logs: Annotated[list[Path], Argument(metavar="LOG…", help=LOG_HELP)],
    predictor: Annotated[
        Path, Option(metavar="FILE", help="Model file; default: the packaged payload_filter.")
    ] = FILTER_MODEL,
    horizons: Annotated[str, Option(help="Steps ahead, comma-separated.")] = HORIZONS,
    vehicle: VehicleFile = None,
) -> Report:
    """Score a predictor on flights that it was not trained on.

    Twice: with the coming motion (zeta) held at its last value, as a predictor alone would have to,
    and known.
    """
    steps = parse_horizons(horizons)
    model: Model = (
        PayloadFilterModel.load(predictor)
        if schema_of(predictor) == SCHEMA
        else load_model(predictor)
    )
    tests = open_flights(logs, vehicle)
    rows = list[dict]()
    for zeta in MOTIONS:
        with run.counting(f"scoring, coming motion {zeta}") as on_flight:
            rows += score_flights(model, tests, steps, zeta=zeta, on_flight=on_flight)
    lost = diverged(rows)
    return Report(
        [t for zeta in MOTIONS for t in tables(rows, zeta)],
        config={"configuration": model.configuration, "horizons": steps, "step": model.step},
        metrics={"rows": rows},
        warnings=noted(read_from(tests)),
        failure=FailedRun(f"a forecast diverged on {', '.join(lost)}.") if lost else None,
    )


def parse_horizons(text: str) -> list[int]:
    """Return the steps ahead, ascending."""
    parts = [part.strip() for part in text.split(",")]
    require(
        all(part.isdecimal() and 0 < int(part) <= FARTHEST for part in parts),
        f"--horizons: must be positive whole numbers of steps, at most {FARTHEST}, as "
        f"{HORIZONS}; got {text!r}.",
    )
    return sorted({int(part) for part in parts})


def tables(rows: list[dict[str, Any]], zeta: str) -> list[Table]:
    """Return two tables for every flight, a column for every horizon: hold RMSE and, in brackets,
    skill.
    """
    import pandas as pd

    frame = pd.DataFrame([row for row in rows if row["zeta"] == zeta])
    header = ["ahead", *(f"{h:.4g} s" for h in sorted(set(frame["horizon"])))]
    result = []
    for flight, scores in frame.groupby("flight", sort=False):
        scores = scores.sort_values("horizon", kind="stable")
        for kind, unit in (("force", "N"), ("torque", "N·m")):
            figures = zip(scores[f"{kind}_rmse"], scores[f"{kind}_skill"], strict=True)
            cells = pd.Series([f"{number(rmse)} ({skill:.2f})" for rmse, skill in figures])
            lines = cells.groupby(scores["model"].to_numpy(), sort=False)
            what = f"{kind} RMSE [{unit}] (skill: below 1 beats all naive)"
            title = f"{flight}: {what}, coming motion {zeta}"
            result.append((title, header, [(model, *of) for model, of in lines]))
    return result
