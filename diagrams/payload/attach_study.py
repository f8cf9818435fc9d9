"""Study `attach`: the payload changes in flight."""

import dataclasses as dc

import numpy as np
from scipy import signal

from diagrams.batch.columns import fixed, percent, spread, tabulate
from diagrams.batch.flown import FlownOptions, FlownRun
from diagrams.batch.options import Reality, Seeds
from diagrams.batch.run import Report, Run, Table
from diagrams.batch.workers import failures
from diagrams.loop.controller_config import NP_MODEL
from diagrams.loop.experiments import scenario_file
from diagrams.loop.flight import FlightConfig
from diagrams.payload import attach as experiment
from diagrams.payload import figures
from diagrams.payload.attach import PAPER, TOSS
from diagrams.payload.hover_swing import TRAINING
from diagrams.tracking.model_files import file_name, key_of
from np_drake.labels import FORCE
from np_drake.lifting.model.lifted_model import LiftedModel
from np_drake.lifting.model.model_file import load_model


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    seeds: Seeds = 20
    reality: Reality = None


def run(run: Run, options: Options) -> Report:
    """The payload changes in flight: attached, cut off, taut. --out DIR: model, and the responses
    as a figure.
    """
    run = FlownRun.of(run, options)
    reality = (
        options.reality and scenario_file(options.reality).resolve()
    )  # workers may have another folder
    models = experiment.train_rows(run, reality)
    runs = experiment.run_attach(run, models, reality)
    row = next(row for row in experiment.ROWS if key_of(row) in models)
    file = str(run.folder / file_name(key_of(row)))
    config = experiment.attach_config(row, solver=run.solver, model=file, reality=reality)
    lines = experiment.attach_table(runs, config)
    notes = _attach_notes(lines, config)
    controller = dc.asdict(config.controller) | {
        "predictor": f"trained on {TRAINING}, seed {run.seed}"
    }
    title = run.title(f"flights a row (release, snap: {min(run.count, experiment.BESIDE)})")
    of_figure = f"seeds from {run.seeds[0]}"
    return Report(
        [_printed(lines, title)],
        config={**run.settings, "controller": controller},
        metrics={"table": lines, "notes": notes},
        notes=[*notes, *failures(run.workers.finished), f"controller: {controller}"],
        figures={"attach_responses.png": lambda: figures.event_responses(runs, config, of_figure)},
    )


def _attach_notes(lines: list[dict], config: FlightConfig) -> list[str]:
    """Return the notes: thrust scale, filter, the paper's values, and the snap, which leaves no
    step.
    """
    step = encoder_step(load_model(config.controller.predictor or NP_MODEL))
    period = config.controller.period
    peak = int(np.argmax(step[: len(step) // 4]))
    lowest = peak + int(np.argmin(step[peak:]))
    band, scale = config.controller.label.force_bandwidth, config.reality.thrust_scale
    said = [
        f"expected: {config.events[0].mass * config.vehicle.gravity:.3f} N over the thrust "
        f"scale {scale}; "
        f"paper: {PAPER['step']} N, standard deviation {PAPER['deviation']} N.",
        f"np: filter of the label, low-pass of {band:g} Hz, order "
        f"{config.controller.label.order}; alone it "
        f"rises to 90 % in {np.log(10) / (2 * np.pi * band):.3f} s and passes "
        f"{label_deviation(config):.3f} N of the "
        "accelerometer's noise.",
        f"np: encoder alone, a step of the label and nothing else moving: "
        f"{100 * step[peak]:.0f} % of it after "
        f"{peak * period:.2f} s, {100 * step[lowest]:.0f} % after {lowest * period:.2f} s, "
        f"{100 * step[-1]:.0f} % when "
        f"its window of {(len(step) - 1) * period:.1f} s is full.",
    ]
    for line in lines:
        if "slack" in line:
            said.append(
                f"{line['event']}, {line['row']}, {line['signal']}: tossed up with {TOSS} N·s, "
                f"slack for {line['slack']:.2f} s; "
                f"f_z of the mean between {line['lowest']:.2f} and {line['highest']:.2f} "
                f"N, height within "
                f"{100 * line['height_error']:.1f} cm, {line['solve_failures']} failed solves."
            )
    return said


def label_deviation(config: FlightConfig) -> float:
    """Return the standard deviation of the label's f_z in hover, from filtered accelerometer noise
    [N].
    """
    sections = next(
        s
        for channels, s in config.controller.label.filters(config.controller.period)
        if channels == FORCE
    )
    impulse = np.zeros(4000)
    impulse[0] = 1.0
    gain = np.linalg.norm(signal.sosfilt(sections, impulse))
    return float(config.vehicle.mass * config.reality.noise.acceleration * gain)


def encoder_step(model: LiftedModel) -> np.ndarray:
    """Return the share of a step in the label that chi_hat (f_z) shows 0, 1, … samples later, (D +
    1,) [1].

    All else is at rest: this is the encoder's own part in the answer to a payload that changes,
    without filter, motion and control loop. The step is -1 N, about the experiment's.
    """
    ages = np.arange(model.warm_up + 1)
    windows = np.zeros((len(ages), model.warm_up, 12))
    windows[:, :, 2] = -1.0 * (np.arange(model.warm_up) >= model.warm_up - ages[:, None])
    f_z = (model.lift(windows) @ model.system.C.T)[:, 2]
    return f_z[0] - f_z


def _printed(lines: list[dict], title: str) -> Table:
    """Return the table of the steps among the lines that `attach_table` gives; N, s, cm."""
    columns = (
        ("event", "event"),
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
    return tabulate(title, [line for line in lines if "size" in line], columns)
