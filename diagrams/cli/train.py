"""`np-drake train`: Algorithm 1 on flight logs."""

import dataclasses as dc
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.output import Table, progress, require_outputs, say, tell
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from np_drake.lifting.model.lifted_model import LiftedModel
    from np_drake.residual_models.motion_model import MotionModel
    from np_drake.training_data.training_segments import Flight

PAYLOAD_FILTER = "payload_filter"
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


@reports("train", seed=0, markdown=False, many=True)
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
    repair: options.Repair = False,
    force: Force = False,
) -> Report:
    """Train a predictor; writes the model, and the loss curve as a PNG beside it."""
    if out.suffix != ".safetensors":
        raise ValueError(f"--out: must end in .safetensors; got {out.name}.")
    curve = out.with_suffix(".png")
    require_outputs(out, curve, run.json)
    from diagrams.cli.flights import open_flights
    from diagrams.studies.learning import flown_share, train_on_envelope
    from np_drake.files.figure_file import save
    from np_drake.lifting.model.lifted_model import FAMILIES, LIFTED, NEURAL
    from np_drake.lifting.model.model_file import rotor_lag_of, save_model
    from np_drake.lifting.training.network_training import PART
    from np_drake.lifting.training.train import CONFIGURATIONS, TrainingResult, make_config
    from np_drake.residual_models.motion_model import KNODE, REACTIONS
    from np_drake.residual_models.predictor_training import train_on_flights
    from np_drake.training_data.training_segments import require_motion
    from np_drake.vehicle import Vehicle, load_vehicle
    from np_drake.vehicle.scaling import sampling_period

    name = asked_configuration(
        configuration, "--configuration", (*CONFIGURATIONS, PAYLOAD_FILTER, *REACTIONS)
    )
    logs = logs or []
    if not (logs or envelope):
        raise ValueError("train: must have something to learn from; give LOG, or --envelope N.")
    flights = open_flights(logs, vehicle, repair=repair)
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
        lines, tables = [], [_loss_table(summary, wall)]
        notes = [f"model: {out}", *([f"loss curve: {curve}"] if loss else [])]
    if loss:
        save(_loss_figure(loss), curve)
    return Report(
        tables,
        config=head,
        metrics={"loss": loss, "wall": wall, "summary": summary},
        lines=[f"excitation: {summary['excitation']}", *lines],
        notes=notes,
    )


def _placed(
    flights: "Sequence[Flight]", prior: Path | None, step: float, envelope: int | None
) -> "LiftedModel | None":
    """Return a family as the logs place it, and say which; None where they are to be learnt from
    alone.

    Args:
        prior: its file; None for the packaged one, where that is of this vehicle and foresees the
            logs.
        step: time between samples [s].
        envelope: 0 where the logs alone count.
    """
    from diagrams.studies.learning import placed_family
    from np_drake.lifting.model.model_file import load_model
    from np_drake.residual_models.predictor_training import place_on_flights

    if prior is not None:
        return place_on_flights(flights, load_model(prior), step=step)
    if envelope is not None:
        return None
    family, text = placed_family(flights, step=step)
    say(text)
    say(
        "--envelope 0 trains on the logs alone."
        if family
        else "The logs alone count; --envelope N learns from simulated flights of the vehicle too."
    )
    return family


def asked_configuration(name: str | None, option: str, known: Sequence[str]) -> str:
    """Return the configuration of a name; empty where the axes of the flights choose it.

    Args:
        name: of the configuration, or None.
    Raises: ValueError: on an unknown name.
    """
    from np_drake.payload_filter.model_file import OLD_NAME

    if name == OLD_NAME:
        say(f"{option}: {OLD_NAME} is now called {PAYLOAD_FILTER}.")
        return PAYLOAD_FILTER
    if name is not None and name not in known:
        raise ValueError(f"{option}: must be one of {', '.join(known)}; got {name}.")
    return name or ""


def configuration_for(name: str, frame: str) -> str:
    """Return the configuration to train, and say which where none was named.

    Args:
        name: of the configuration; empty for the one that suits the axes.
        frame: axes of the wrenches, world | body.
    """
    from np_drake.lifting.training.train import suited

    configuration = suited(name, frame)
    if not name:
        say(f"configuration: {configuration}, as the wrenches are in {frame} axes.")
    return configuration


def _payload_filter_report(flights: "Sequence[Flight]", out: Path, *, step: float) -> Report:
    """Train a payload filter, write its file, and return what it found of the vehicle.

    Raises: ValueError: if `flights` do not serve.
    """
    from np_drake.payload_filter.training import opened_logs, train_payload_filter

    logs = opened_logs(flights)
    start = time.perf_counter()
    with progress("training payload_filter", 1.0) as advance:
        model = train_payload_filter(
            logs,
            step=step,
            on_pass=lambda done, total: advance(done / total, f"pass {done} of {total}"),
        )
    wall = time.perf_counter() - start
    model.save(out)
    hook = ", ".join(f"{1e3 * value:.1f}" for value in model.hook)
    rows: list[tuple] = [
        (
            "thrust error [%]",
            f"{100 * model.thrust_error:.2f} ± {100 * model.thrust_error_deviation:.2f}",
        ),
        (
            "drag [N·s/m]",
            f"{model.mass * model.drag:.3f} ± {model.mass * model.drag_deviation:.3f}",
        ),
        ("hook x, y, z [mm]", hook),
        (
            "torque over velocity, roll, pitch [mN·s]",
            ", ".join(f"{1e3 * c:.3g}" for c in model.speed_torque),
        ),
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
    name: str, flights: "Sequence[Flight]", *, step: float, settings: dict
) -> "tuple[MotionModel, list[float], float]":
    """Train gp or knode.

    Args:
        step: of the model [s].
    Returns: the model, its loss, and how long the training took [s].
    Raises: ValueError: if `flights` do not serve.
    """
    from np_drake.residual_models.motion_training import train_motion_model

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


def _loss_table(summary: dict[str, Any], wall: float) -> Table:
    """Return the table of a training run: the loss by block."""
    loss = summary["loss"] if isinstance(summary["loss"], dict) else {"total": summary["loss"]}
    rows: list[tuple] = [(name, float(value)) for name, value in loss.items()]
    return f"{summary['samples']} samples, {wall:.1f} s", ["block", "loss [1]"], rows


def _loss_figure(loss: list[float]) -> "Figure":
    """Plot loss against epoch."""
    from np_drake.files.figure_file import new_figure

    figure, grid = new_figure(1, 1, width=6.0, height=3.5)
    axes = grid[0, 0]
    axes.set(xlabel="epoch [1]", ylabel="loss [1]", yscale="log")
    axes.plot(range(1, len(loss) + 1), loss)
    axes.grid(True, alpha=0.3)
    return figure
