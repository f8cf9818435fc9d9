"""`np-drake train`: Algorithm 1 on flight logs."""

import dataclasses as dc
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.fly import fly_all
from diagrams.cli.output import progress, require_outputs, say, tell
from diagrams.cli.runner import Report, Run, reports
from diagrams.loop.experiments import training_flight
from diagrams.studies.learning import flown_share, placed_family, train_on_envelope
from np_drake.files.figure_file import new_figure, save
from np_drake.lifting.model.lifted_model import FAMILIES, LIFTED, NEURAL, LiftedModel
from np_drake.lifting.model.model_file import load_model, rotor_lag_of, save_model
from np_drake.lifting.training.network_training import PART
from np_drake.lifting.training.train import CONFIGURATIONS, TrainingResult, make_config, suited
from np_drake.logs import opening
from np_drake.logs.formats.neurobem import is_array, published_vehicle
from np_drake.logs.formats.neurobem_wrenches import read_wrenches
from np_drake.payload_filter.training import opened_logs, train_payload_filter
from np_drake.residual_models.motion_model import KNODE, REACTIONS, MotionModel
from np_drake.residual_models.motion_training import train_motion_model
from np_drake.residual_models.predictor_training import place_on_flights, train_on_flights
from np_drake.training_data.accelerations import with_accelerations
from np_drake.training_data.segments import WrenchSequence
from np_drake.training_data.training_segments import Flight, require_motion, require_torque
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.scaling import sampling_period

PAYLOAD_FILTER = "payload_filter"
SCENARIOS = (".yaml", ".yml")  # files that are flown
T = TypeVar("T")
LOG_HELP = "Flight logs (CSV, .csv.gz, Parquet), NeuroBEM CSV, or NeuroBEM arrays (.npy)."
Envelope = Annotated[
    int | None,
    Option(
        metavar="N",
        min=0,
        max=10_000,
        help="Fly N simulated payloads and learn from them too; 0: the logs alone.",
    ),
]
Prior = Annotated[
    Path | None,
    Option(
        metavar="FILE",
        help="Family that the logs place; by default the packaged one where it fits.",
    ),
]
Force = Annotated[
    bool, Option("--force", help="Train though the vehicle moves in none of the logs.")
]


@reports("train", seed=0, markdown=False, many=True, files=("out",))
def train(
    run: Run,
    out: Annotated[Path, Option(metavar="FILE", help="Model file (safetensors).")],
    logs: Annotated[list[Path] | None, Argument(metavar="LOG…", help=LOG_HELP)] = None,
    configuration: options.Configuration = None,
    epochs: options.Epochs = None,
    envelope: Envelope = None,
    prior: Prior = None,
    step: options.Step = None,
    vehicle: options.VehicleFile = None,
    force: Force = False,
) -> Report:
    """Train a predictor; writes the model, and the loss curve as a PNG beside it."""
    if out.suffix != ".safetensors":
        raise ValueError(f"--out: must end in .safetensors; got {out.name}.")
    curve = out.with_suffix(".png")
    require_outputs(out, curve, run.json)
    name = asked_configuration(
        configuration, "--configuration", (*CONFIGURATIONS, PAYLOAD_FILTER, *REACTIONS)
    )
    logs = logs or []
    if not (logs or envelope):
        raise ValueError("train: must have something to learn from; give LOG, or --envelope N.")
    flights = open_flights(logs, vehicle)
    if not force:
        require_motion(flights)
    flown = flights[0].vehicle if flights else load_vehicle(vehicle) if vehicle else Vehicle()
    step = step or sampling_period(flown)
    frame = flights[0].frame if flights else "world"
    family = None
    if not name and envelope:
        name = NEURAL if envelope >= PART else LIFTED
    if name in ("", *FAMILIES) and frame == "world" and not envelope:
        family = _placed(flights, prior, step, envelope)
    if family is not None:
        family = family.without_network if name == LIFTED else family
        name = family.configuration
    configuration = configuration_for(name, frame)
    if configuration not in FAMILIES and (envelope or prior):
        raise ValueError(
            f"--envelope and --prior: must be of {' | '.join(FAMILIES)}; got {configuration}."
        )
    if configuration == PAYLOAD_FILTER:
        return _payload_filter_report(flights, out, step=step)
    if configuration in REACTIONS:
        head: dict[str, Any] = {"seed": run.seed}
        head |= {"epochs": epochs} if epochs and configuration == KNODE else {}
        learnt, loss, wall = train_reaction(configuration, flights, step=step, settings=head)
        learnt.save(out)
        summary = learnt.summary
        rmse = [round(value, 4) for value in summary["label_rmse"]]
        lines, tables = [f"against the labels [N, N·m]: {rmse}"], []
        notes = [f"{summary['samples']} samples, {wall:.1f} s", f"model: {out}"]
    else:
        config = make_config(configuration, frame=frame, seed=run.seed, epochs=epochs)
        start = time.perf_counter()
        if configuration in FAMILIES and envelope:
            result = train_on_envelope(
                envelope, config, run=run, vehicle=flown, flights=flights, step=step
            )
            result = dc.replace(
                result, model=flown_share(result.model, envelope, run=run, vehicle=flown)
            )
            wall = time.perf_counter() - start
        elif family is not None:
            result, wall = TrainingResult(family, []), time.perf_counter() - start
        else:
            learn = partial(train_on_flights, flights, config, step=step)
            result, wall = behind_bar(f"training {configuration}", learn)
        save_model(result.model, out)
        loss, summary = result.loss, result.model.summary
        head = {"configuration": configuration, "step": step, **dc.asdict(config)}
        lag = rotor_lag_of(result.model)
        if lag > 0:
            tell(
                f"rotors: {1e3 * lag:.0f} ms behind the command; in flight the labels of "
                f"this model allow for it."
            )
        by_block = summary["loss"]
        by_block = by_block if isinstance(by_block, dict) else {"total": by_block}
        rows = [(block, float(value)) for block, value in by_block.items()]
        title = f"{summary['samples']} samples, {wall:.1f} s"
        lines, tables = [], [(title, ["block", "loss [1]"], rows)]
        notes = [f"model: {out}", *([f"loss curve: {curve}"] if loss else [])]
    if loss:
        figure, grid = new_figure(1, 1, width=6.0, height=3.5)
        axes = grid[0, 0]
        axes.set(xlabel="epoch [1]", ylabel="loss [1]", yscale="log")
        axes.plot(range(1, len(loss) + 1), loss)
        axes.grid(True, alpha=0.3)
        save(figure, curve)
    return Report(
        tables,
        config=head,
        metrics={"loss": loss, "wall": wall, "summary": summary},
        lines=[f"excitation: {summary['excitation']}", *lines],
        notes=notes,
    )


def _placed(
    flights: Sequence[Flight], prior: Path | None, step: float, envelope: int | None
) -> LiftedModel | None:
    """Return a family as the logs place it, that of a file or the packaged one, and say which; None
    where they are to be learnt from alone.
    """
    if prior is not None:
        return place_on_flights(flights, load_model(prior), step=step)
    if envelope is not None:
        return None
    family, text = placed_family(flights, step=step)
    say(text)
    alone = "The logs alone count; --envelope N learns from simulated flights of the vehicle too."
    say("--envelope 0 trains on the logs alone." if family else alone)
    return family


def asked_configuration(name: str | None, option: str, known: Sequence[str]) -> str:
    """Return the configuration of a name; empty where the axes of the flights choose it.

    Raises: ValueError: on an unknown name.
    """
    if name is not None and name not in known:
        raise ValueError(f"{option}: must be one of {', '.join(known)}; got {name}.")
    return name or ""


def configuration_for(name: str, frame: str) -> str:
    """Return the configuration to train, and say which where none was named; wrenches are in world
    or body axes.
    """
    configuration = suited(name, frame)
    if not name:
        say(f"configuration: {configuration}, as the wrenches are in {frame} axes.")
    return configuration


def _payload_filter_report(flights: Sequence[Flight], out: Path, *, step: float) -> Report:
    """Train a payload filter, write its file, and return what it found of the vehicle."""
    start = time.perf_counter()
    with progress("training payload_filter", 1.0) as advance:

        def on_pass(done: int, total: int) -> None:
            advance(done / total, f"pass {done} of {total}")

        model = train_payload_filter(opened_logs(flights), step=step, on_pass=on_pass)
    wall = time.perf_counter() - start
    model.save(out)
    error, spread = 100 * model.thrust_error, 100 * model.thrust_error_deviation
    drag, drag_spread = model.mass * model.drag, model.mass * model.drag_deviation
    torque = ", ".join(f"{1e3 * c:.3g}" for c in model.speed_torque)
    rows: list[tuple] = [
        ("thrust error [%]", f"{error:.2f} ± {spread:.2f}"),
        ("drag [N·s/m]", f"{drag:.3f} ± {drag_spread:.3f}"),
        ("hook x, y, z [mm]", ", ".join(f"{1e3 * value:.1f}" for value in model.hook)),
        ("torque over velocity, roll, pitch [mN·s]", torque),
        ("rotor lag [ms]", f"{1e3 * model.rotor_lag:.1f}"),
        ("delay of commands [ms]", f"{1e3 * model.delay:.1f}"),
    ]
    return Report(
        [(f"{model.summary['samples']} samples, {wall:.1f} s", ["vehicle", "found"], rows)],
        config={"configuration": PAYLOAD_FILTER, "step": step},
        metrics={"wall": wall, "summary": model.summary},
        notes=[f"model: {out}"],
    )


def train_reaction(
    name: str, flights: Sequence[Flight], *, step: float, settings: dict
) -> tuple[MotionModel, list[float], float]:
    """Return gp or knode trained, its loss, and how long the training took [s]."""
    vehicle = flights[0].vehicle
    if any(flight.vehicle != vehicle for flight in flights):
        raise ValueError(
            f"{name}: all flights must be of one vehicle; give them one --vehicle FILE."
        )
    data = [flight.data for flight in flights]
    learn = partial(train_motion_model, name, data, vehicle, step=step, **settings)
    (model, loss), wall = behind_bar(f"training {name}", learn)
    return model, loss, wall


def behind_bar(description: str, learn: Callable[..., T]) -> tuple[T, float]:
    """Call `learn(on_epoch=…)` behind a progress bar; return its result and how long it took
    [s].
    """
    start = time.perf_counter()
    with progress(description, 1.0) as advance:
        result = learn(
            on_epoch=lambda epoch, total, loss: advance(epoch / total, f"loss {loss:.4g}")
        )
        advance(1.0)
    return result, time.perf_counter() - start


def open_flights(paths: list[Path], vehicle_file: Path | None) -> list[Flight]:
    """Open and check every file, and print what a reader derived; a scenario file is flown,
    once every other file is open.

    Without a vehicle file, NeuroBEM files have the published one, flight logs the paper's.
    Raises: LogError, OSError: one line, at the first file that is not usable; ValueError: on a bad
        vehicle file, or if NeuroBEM arrays are mixed with logs.
    """
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
            for data in map(require_torque, log.flights):
                flights.append(Flight(with_accelerations(data), own))
                notes = flights[-1].data.notes
                tell(*(f"{data.name}: {note}" for note in notes))
        elif isinstance(found, WrenchSequence):
            flights.append(Flight(found, vehicle or published_vehicle()))
        else:
            (flown,) = fly_all([found], 0)
            say(f"{path}: flown for {found.end:g} s with {found.controller.name}, seed 0.")
            flights.append(Flight(flown.log(), found.vehicle))
    if vehicle is None and flights:
        used = sorted({f"{flight.vehicle.name}, {flight.vehicle.mass:g} kg" for flight in flights})
        say(f"vehicle: {'; '.join(used)}, as no --vehicle was given.")
    require_one_frame(flights)
    return flights


def require_one_frame(flights: list[Flight]) -> None:
    """Check that total wrenches in body axes are not mixed with residual ones in W."""
    if len({flight.frame for flight in flights}) > 1:
        raise ValueError(
            "flights: arrays (.npy) hold the total wrench in body axes, logs the residual "
            "one; give one kind."
        )
