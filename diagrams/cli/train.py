"""`np-drake train`: Algorithm 1 on flight logs."""

import dataclasses as dc
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.output import Table, progress, require_outputs, say
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from diagrams.cli.flights import Flight
    from np_drake.lifting.training.segments import Segment
    from np_drake.lifting.training.train import Config, TrainingResult
    from np_drake.residual_models.motion_model import MotionModel

LOG_HELP = "Flight logs (CSV, .csv.gz, Parquet), NeuroBEM CSV, or NeuroBEM arrays (.npy)."


@reports("train", seed=0, markdown=False)
def train(
    run: Run,
    logs: Annotated[list[Path], Argument(metavar="LOG…", help=LOG_HELP)],
    out: Annotated[Path, Option(metavar="FILE", help="Model file (safetensors).")],
    configuration: options.Configuration = "default",
    epochs: options.Epochs = None,
    checkpoint: Annotated[
        Path | None, Option(metavar="FILE", help="Save the run here as it goes, and resume it.")
    ] = None,
    step: options.Step = None,
    vehicle: options.VehicleFile = None,
    repair: options.Repair = False,
) -> Report:
    """Train a predictor; writes the model, and the loss curve as a PNG beside it."""
    if out.suffix != ".safetensors":
        raise ValueError(f"--out: must end in .safetensors; got {out.name}.")
    curve = out.with_suffix(".png")
    places = [place for place in (out, curve, checkpoint, run.json) if place is not None]
    if len(set(places)) < len(places):
        raise ValueError("--out, its loss curve, --json and --checkpoint must be different files.")
    require_outputs(*places)
    from diagrams.cli.flights import open_flights
    from np_drake.figure_file import save
    from np_drake.residual_models.motion_model import KNODE, REACTIONS
    from np_drake.scaling import sampling_period

    if configuration in REACTIONS and checkpoint is not None:
        raise ValueError(f"--checkpoint: {configuration} has none; it trains in a minute or less.")
    flights = open_flights(logs, vehicle, repair=repair)
    step = step or sampling_period(flights[0].vehicle)
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
        config = configure(configuration, frame=flights[0].frame, seed=run.seed, epochs=epochs)
        result, wall = train_predictor(configuration, flights, config, out, step=step, checkpoint=checkpoint)
        loss, summary = result.loss, result.model.summary
        head = {"configuration": configuration, "step": step, **dc.asdict(config)}
        lines, tables = [], [loss_table(summary, wall)]
        notes = [f"model: {out}", f"loss curve: {curve}"]
    if loss or tables:
        save(loss_figure(loss), curve)
    return Report(
        tables,
        config=head,
        metrics={"loss": loss, "wall": wall, "summary": summary},
        lines=[f"excitation: {summary['excitation']}", *lines],
        notes=notes,
    )


def train_predictor(
    name: str, flights: "list[Flight]", config: "Config", out: Path, *, step: float, checkpoint: Path | None
) -> tuple["TrainingResult", float]:
    """Train a predictor and write its model file.

    Returns: the result, and how long the training took [s].
    """
    from np_drake.labels import default_labels
    from np_drake.lifting.model.lifted_model import DEFAULT
    from np_drake.lifting.model.model_file import save_model
    from np_drake.lifting.model.origin import origin_of, with_origin, with_rotor_lag

    segments = [segment for flight in flights for segment in flight.segments(step)]
    frame, vehicle = flights[0].frame, flights[0].vehicle
    result, wall = run_training(f"training {name}", segments, config, checkpoint)
    model = with_origin(result.model, origin_of(frame, vehicle, default_labels(vehicle)))
    save_model(with_rotor_lag(model, rotor_lag(flights)) if name == DEFAULT else model, out)
    return result, wall


def train_reaction(
    name: str, flights: "list[Flight]", *, step: float, settings: dict
) -> tuple["MotionModel", list[float], float]:
    """Train gp or knode.

    Returns: the model, its loss, and how long the training took [s].
    Raises: ValueError: if `flights` do not serve.
    """
    from np_drake.residual_models.motion_training import train_motion_model

    start, vehicles = time.perf_counter(), [flight.vehicle for flight in flights]
    if any(vehicle != vehicles[0] for vehicle in vehicles):
        raise ValueError(f"{name}: all flights must be of one vehicle; give them one --vehicle FILE.")
    with progress(f"training {name}", 1.0) as advance:
        model, loss = train_motion_model(
            name, [flight.data for flight in flights], vehicles[0], step=step,
            on_epoch=lambda epoch, total, loss: advance(epoch / total, f"loss {loss:.4g}"), **settings,
        )  # fmt: skip
        advance(1.0)
    return model, loss, time.perf_counter() - start


def rotor_lag(flights: "list[Flight]") -> float:
    """Return the lag of the rotors that the flights show [s], and print it where there is one."""
    from np_drake.logs.flight_log import FlightLog
    from np_drake.rotor_lag import learned_rotor_lag

    lag = learned_rotor_lag([(f.data, f.vehicle) for f in flights if isinstance(f.data, FlightLog)])
    if lag > 0:
        say(
            f"rotors: {1e3 * lag:.0f} ms behind the command; in flight the labels of this model allow for it."
        )
    return lag


def configure(name: str, *, frame: str = "world", seed: int = 0, epochs: int | None = None) -> "Config":
    """Return the configuration called `name`; one in closed form has no epochs.

    Raises: ValueError: on another name.
    """
    from np_drake.lifting.training.train import make_config

    config = make_config(name, frame=frame, seed=seed)
    names = {field.name for field in dc.fields(config)} & {"epochs", "iterations"}
    given: dict[str, Any] = dict.fromkeys(names, epochs)
    return config if epochs is None else dc.replace(config, **given)


def run_training(
    description: str, segments: list["Segment"], config: "Config", checkpoint: Path | None = None
) -> tuple["TrainingResult", float]:
    """Train behind a progress bar; return the result and how long it took [s]."""
    from np_drake.lifting.training.train import train as run

    start = time.perf_counter()
    with progress(description, 1.0) as advance:

        def on_epoch(epoch: int, total: int, loss: float) -> None:
            advance(epoch / total, f"loss {loss:.4g}")

        result = run(segments, config, checkpoint=checkpoint, on_epoch=on_epoch)
        advance(1.0, f"loss {result.loss[-1]:.4g}" if result.loss else "")
    return result, time.perf_counter() - start


def loss_table(summary: dict[str, Any], wall: float) -> Table:
    """Return the table of a training run: the loss by block."""
    loss = summary["loss"] if isinstance(summary["loss"], dict) else {"total": summary["loss"]}
    rows: list[tuple] = [(name, float(value)) for name, value in loss.items()]
    return f"{summary['samples']} samples, {wall:.1f} s", ["block", "loss [1]"], rows


def loss_figure(loss: list[float]) -> "Figure":
    """Plot loss against epoch."""
    from np_drake.figure_file import new_figure

    figure, grid = new_figure(1, 1, width=6.0, height=3.5)
    axes = grid[0, 0]
    axes.set(xlabel="epoch [1]", ylabel="loss [1]", yscale="log")
    axes.plot(range(1, len(loss) + 1), loss)
    axes.grid(True, alpha=0.3)
    return figure
