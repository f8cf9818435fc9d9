"""`np-drake train`: a predictor from flight logs. `np-drake evaluate`: prediction skill against the
horizon, naive rows included.
"""

import dataclasses as dc
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

from typer import Argument, Option

from diagrams.batch.run import FailedRun, require
from diagrams.cli.fly import fly_all
from diagrams.cli.verb import (
    Report,
    Run,
    Table,
    VehicleFile,
    noted,
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
from np_drake.lifting.model.lifted_model import (
    CONFIGURATIONS,
    MODE_DICTIONARY,
    load_model,
    save_model,
)
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
Epochs = Annotated[
    int | None,
    Option(
        "--epochs",
        min=1,
        max=1_000_000,
        help="Passes, of neural-lpv gradient steps; on logs it takes none by default.",
    ),
]
Step = Annotated[
    float | None,
    Option(
        "--step",
        min=1e-4,
        max=1.0,
        help="Predictor step for flight logs [s]; default: the vehicle's, 0.02 for arms of 9 to "
        "36 cm.",
    ),
]
LOG_HELP = "Flight logs (CSV, .csv.gz, Parquet), NeuroBEM CSV, or NeuroBEM arrays (.npy)."
Force = Annotated[
    bool, Option("--force", help="Train though the vehicle moves in none of the logs.")
]


@reports("train", seed=0, markdown=False, many=True, files=("out",))
def train(
    run: Run,
    out: Annotated[Path, Option(metavar="FILE", help="Model file (safetensors).")],
    logs: Annotated[list[Path] | None, Argument(metavar="LOG…", help=LOG_HELP)] = None,
    configuration: Annotated[
        str | None,
        Option(
            metavar="NAME",
            help=f"{' | '.join(CONFIGURATIONS)}, of np; payload_filter; gp | knode. Default: "
            f"{PAYLOAD_FILTER} for logs, {MODE_DICTIONARY} for arrays.",
        ),
    ] = None,
    epochs: Epochs = None,
    envelope: Annotated[
        int | None,
        Option(
            metavar="N",
            min=1,
            max=10_000,
            help="Fly N simulated payloads and learn from them: the priors of payload_filter, or "
            "the network of neural-lpv.",
        ),
    ] = None,
    step: Step = None,
    vehicle: VehicleFile = None,
    force: Force = False,
) -> Report:
    """Train a predictor; writes the model, and the loss curve as a PNG beside it."""
    require(out.suffix == ".safetensors", f"--out: must end in .safetensors; got {out.name}.")
    curve = out.with_suffix(".png")
    require_outputs(out, curve, *([run.json] if run.json else []))
    known = (PAYLOAD_FILTER, *CONFIGURATIONS, *REACTIONS)
    require(
        configuration in (None, *known),
        f"--configuration: must be one of {', '.join(known)}; got {configuration}.",
    )
    logs = logs or []
    require(
        bool(logs or envelope),
        "train: must have something to learn from; give LOG, or --envelope N.",
    )
    flights = open_flights(logs, vehicle)
    if not force:
        require_motion(flights)
    frame = flights[0].frame if flights else "world"
    name = configuration or BY_AXES[frame]
    if configuration is None:
        say(f"configuration: {name}, as the wrenches are in {frame} axes.")
    require(
        name in (PAYLOAD_FILTER, NEURAL_LPV) or not envelope,
        f"--envelope: must be of {PAYLOAD_FILTER} or {NEURAL_LPV}; got {name}.",
    )
    require(
        bool(logs) or step is None,
        "--step: must be left out where --envelope alone teaches; it takes the vehicle's period.",
    )
    flown = flights[0].vehicle if flights else load_vehicle(vehicle) if vehicle else Vehicle()
    step = step or sampling_period(flown)
    start = time.perf_counter()
    if name == PAYLOAD_FILTER:
        learned = None
        loss = list[float]()
        if envelope:
            from diagrams.training import train_on_envelope

            learned, loss = train_on_envelope(envelope, run=run, vehicle=flown)
        learnt = _learn_vehicle(flights, out, step=step, learned=learned, loss=loss)
    elif name == NEURAL_LPV:
        learnt = _learn_network(
            flights, out, run=run, step=step, epochs=epochs, envelope=envelope, vehicle=flown
        )
    elif name in REACTIONS:
        learnt = _learn_reaction(name, flights, out, step=step, seed=run.seed, epochs=epochs)
    else:
        learnt = _learn_lifted(name, flights, out, step=step, seed=run.seed, epochs=epochs)
    wall = time.perf_counter() - start
    summary = learnt.summary
    if learnt.loss:
        what = {
            PAYLOAD_FILTER: ("trial [1]", "error [m]"),
            NEURAL_LPV: ("report [1]", "loss [1]"),
        }.get(name, ("epoch [1]", "loss [1]"))
        axes = {"xlabel": what[0], "ylabel": what[1], "yscale": "log"}
        panel = Panel({name: (range(1, len(learnt.loss) + 1), learnt.loss)}, axes)
        save(panel_figure([[panel]], f"training {name}", width=6.0, height=3.5), curve)
    return Report(
        [(f"{summary['samples']} samples, {wall:.1f} s", learnt.columns, learnt.rows)],
        config={"configuration": name, "step": step, "seed": run.seed, **learnt.settings},
        metrics={"loss": learnt.loss, "wall": wall, "summary": summary},
        lines=[f"excitation: {summary['excitation']}"] if "excitation" in summary else [],
        notes=[f"model: {out}", *([f"loss curve: {curve}"] if learnt.loss else [])],
        warnings=noted(read_from(flights)),
    )


@dc.dataclass(frozen=True)
class Learnt:
    """What a training tells, beside the model file that it has written."""

    summary: dict[str, Any]
    columns: list[str]
    rows: list[tuple]  # of the table
    loss: list[float] = dc.field(default_factory=list)  # after each epoch [1]
    settings: dict[str, Any] = dc.field(default_factory=dict)


def _learn_vehicle(
    flights: Sequence[Flight],
    out: Path,
    *,
    step: float,
    learned: PayloadFilterModel | None,
    loss: list[float],
) -> Learnt:
    """Train a payload filter.

    Args:
        learned: on the envelope; None: the priors of the packaged one.
        loss: of the learning of its priors.
    """
    with progress(f"training {PAYLOAD_FILTER}", 1.0) as advance:
        if learned is not None and not flights:
            found = learned
        else:
            found = train_payload_filter(
                opened_logs(flights),
                step=step,
                prior=learned or PayloadFilterModel.load(FILTER_MODEL),
                on_pass=lambda done, total: advance(done / total, f"pass {done} of {total}"),
            )
    found.save(out)
    error = 100 * found.thrust_error
    spread = 100 * found.thrust_error_deviation
    drag = found.mass * found.drag
    drag_spread = found.mass * found.drag_deviation
    torque = ", ".join(f"{1e3 * c:.3g}" for c in found.speed_torque)
    rows: list[tuple] = [
        ("thrust error [%]", f"{error:.2f} ± {spread:.2f}"),
        ("drag [N·s/m]", f"{drag:.3f} ± {drag_spread:.3f}"),
        ("hook x, y, z [mm]", ", ".join(f"{1e3 * value:.1f}" for value in found.hook)),
        ("torque over velocity, roll, pitch [mN·s]", torque),
        ("rotor lag [ms]", f"{1e3 * found.rotor_lag:.1f}"),
        ("delay of commands [ms]", f"{1e3 * found.delay:.1f}"),
    ]
    return Learnt(found.summary, ["vehicle", "found"], rows, loss)


def _learn_network(
    flights: Sequence[Flight],
    out: Path,
    *,
    run: Run,
    step: float,
    epochs: int | None,
    envelope: int | None,
    vehicle: Vehicle,
) -> Learnt:
    """Train a network on the envelope, or take the packaged one, and fit it to the vehicle of the
    flights.
    """
    from diagrams.training import train_network_on_envelope
    from np_drake.residual_models.predictor_training import fitted_lpv

    loss = list[float]()
    model: Any = load_model(NP_MODEL)
    if flights:  # refuses what does not suit it, before anything is flown
        count = 0 if envelope else epochs or 0
        with progress("training the network", 1.0) as advance:
            model = fitted_lpv(
                model,
                flights,
                step,
                epochs=count,
                on_epoch=lambda done, total, error: advance(done / total, f"loss {error:.4g}"),
            )
    if envelope:
        model, loss = train_network_on_envelope(envelope, run=run, vehicle=vehicle, epochs=epochs)
        model = fitted_lpv(model, flights, step) if flights else model
    save_model(model, out)
    rows: list[tuple] = [
        ("rotor lag [ms]", f"{1e3 * rotor_lag_of(model):.1f}"),
        ("delay of commands [ms]", f"{1e3 * (delay_of(model) or 0.0):.1f}"),
    ]
    return Learnt(model.summary, ["vehicle", "found"], rows, loss)


def _learn_reaction(
    name: str, flights: Sequence[Flight], out: Path, *, step: float, seed: int, epochs: int | None
) -> Learnt:
    """Train a wrench as a function of the motion."""
    from np_drake.residual_models.predictor_training import train_motion_model

    settings: dict[str, Any] = {"seed": seed} | (
        {"epochs": epochs} if name == KNODE and epochs else {}
    )
    learn = partial(train_motion_model, name, flights, step=step, **settings)
    model, loss = behind_bar(f"training {name}", learn)
    model.save(out)
    rmse = ", ".join(f"{value:.4g}" for value in model.summary["label_rmse"])
    rows: list[tuple] = [("against the labels, RMSE [N, N·m]", rmse)]
    return Learnt(model.summary, ["model", name], rows, loss, settings)


def _learn_lifted(
    name: str, flights: Sequence[Flight], out: Path, *, step: float, seed: int, epochs: int | None
) -> Learnt:
    """Train a lifted linear system."""
    from np_drake.lifting.training.train import make_config
    from np_drake.residual_models.predictor_training import train_on_flights

    config = make_config(name, frame=flights[0].frame, seed=seed, epochs=epochs)
    result = behind_bar(f"training {name}", partial(train_on_flights, flights, config, step=step))
    save_model(result.model, out)
    summary = result.model.summary
    lag = rotor_lag_of(result.model)
    if lag > 0:
        tell(
            f"rotors: {1e3 * lag:.0f} ms behind the command; in flight the labels of this model "
            "allow for it."
        )
    loss = summary["loss"]
    by_block = loss if isinstance(loss, dict) else {"total": loss}
    rows: list[tuple] = [(block, float(value)) for block, value in by_block.items()]
    return Learnt(summary, ["block", "loss [1]"], rows, result.loss, dc.asdict(config))


def behind_bar(description: str, learn: Callable[..., T]) -> T:
    """Return the result of `learn(on_epoch=…)`, called behind a progress bar."""
    with progress(description, 1.0) as advance:
        result = learn(
            on_epoch=lambda epoch, total, loss: advance(epoch / total, f"loss {loss:.4g}")
        )
        advance(1.0)
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
    opened = [found for found in inputs if isinstance(found, opening.Opened)]
    logs = iter(opening.with_vehicle(opened, vehicle))
    flights = list[Flight]()
    for path, found in zip(paths, inputs, strict=True):
        if isinstance(found, opening.Opened):
            log = next(logs)
            own = vehicle or log.vehicle or Vehicle()
            for data in map(with_accelerations, map(require_torque, log.flights)):
                flights.append(Flight(data, own))
        elif isinstance(found, WrenchSequence):
            flights.append(Flight(found, vehicle or published_vehicle()))
        else:
            (flown,) = fly_all([found], 0, [])
            say(f"{path}: flown for {found.end:g} s with {found.controller.name}, seed 0.")
            flights.append(Flight(flown.log(), found.vehicle))
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
    found = []
    for flight, own in frame.groupby("flight", sort=False):
        own = own.sort_values("horizon", kind="stable")
        for kind, unit in (("force", "N"), ("torque", "N·m")):
            figures = zip(own[f"{kind}_rmse"], own[f"{kind}_skill"], strict=True)
            cells = pd.Series([f"{number(rmse)} ({skill:.2f})" for rmse, skill in figures])
            lines = cells.groupby(own["model"].to_numpy(), sort=False)
            what = f"{kind} RMSE [{unit}] (skill: below 1 beats all naive)"
            title = f"{flight}: {what}, coming motion {zeta}"
            found.append((title, header, [(model, *of) for model, of in lines]))
    return found
