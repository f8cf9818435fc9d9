"""`np-drake reproduce attach`: the payload changes in flight."""

import dataclasses as dc
from typing import TYPE_CHECKING, Annotated

import typer

from diagrams.cli import options
from diagrams.cli.output import Table, flying, require_files, say, show, write_metrics

if TYPE_CHECKING:
    from diagrams.loop.flight import FlightConfig


def attach(
    seeds: Annotated[int, typer.Option(min=1, help="Flights of seeds seed + 1, …")] = 20,
    solver: options.Solver = "sqp",
    jobs: options.Jobs = 2,
    seed: options.Seed = 1000,
    out: options.Out = None,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """The payload changes in flight: attached, cut off, taut. --out DIR: model, and the responses as a figure."""
    require_files(json, markdown)
    from diagrams.payload import attach as experiment
    from diagrams.payload import figures
    from diagrams.payload.hover_swing import TRAINING
    from diagrams.tracking.tracking import Row, train_models
    from np_drake.figure_file import save

    row = Row("np", "np", training=TRAINING, configuration="default")
    evaluation = options.evaluation_seeds(seed, seeds)
    with flying("attach", out) as (folder, on_progress):
        model = train_models((row,), folder, seed=seed, solver=solver)[(row.training, row.configuration)]
        config = experiment.attach_config(solver=solver, model=model)
        runs = experiment.run_attach(
            model,
            seeds=evaluation,
            solver=solver,
            jobs=jobs,
            on_progress=on_progress,
        )
        lines = experiment.attach_table(runs, config)
        said = _attach_notes(lines, config)  # reads the model file, which is gone with a scratch folder
    if out is not None:
        figure = figures.event_responses(runs, config, f"seeds from {evaluation[0]}")
        save(figure, out / "attach_responses.png")
        say(f"figure: {out / 'attach_responses.png'}")
    controller = dc.asdict(config.controller) | {"predictor": f"trained on {TRAINING}, seed {seed}"}
    settings = {"solver": solver, "seeds": evaluation, "training_seed": seed, "controller": controller}
    write_metrics(json, "reproduce", seed=seed, config=settings, table=lines, notes=said)
    title = (
        f"{seeds} flights (release, snap: {min(seeds, experiment.BESIDE)}), seeds {evaluation[0]} … {evaluation[-1]}, "
        f"np trained on seed {seed}, {solver}"
    )
    show(markdown, attach_printed(lines, title), notes=[*said, f"controller: {controller}"])


def _attach_notes(lines: list[dict], config: "FlightConfig") -> list[str]:
    """What is behind the figures: thrust scale, filter, paper, and the snap, which leaves no step."""
    import numpy as np

    from diagrams.loop.controllers import DEFAULT_MODEL
    from diagrams.payload.attach import ADDED, PAPER, TOSS, encoder_step, label_deviation
    from np_drake.lifting.model.model_file import load_model

    step = encoder_step(load_model(config.controller.predictor or DEFAULT_MODEL))
    period = config.controller.period
    peak = int(np.argmax(step[: len(step) // 4]))
    lowest = peak + int(np.argmin(step[peak:]))
    band, scale = config.controller.label.force_bandwidth, config.reality.thrust_scale
    said = [
        f"expected: {ADDED * config.vehicle.gravity:.3f} N over the thrust scale {scale}; paper: {PAPER['step']} N, "
        f"standard deviation {PAPER['deviation']} N.",
        f"filter: low-pass of {band:g} Hz, order {config.controller.label.order}; alone it rises to 90 % in "
        f"{2.302585 / (6.283185 * band):.3f} s and passes {label_deviation(config):.3f} N of accelerometer noise.",
        f"encoder alone, a step of the label and nothing else moving: {100 * step[peak]:.0f} % of it after "
        f"{peak * period:.2f} s, {100 * step[lowest]:.0f} % after {lowest * period:.2f} s, {100 * step[-1]:.0f} % when "
        f"its window of {(len(step) - 1) * period:.1f} s is full.",
    ]
    for line in lines:
        if "slack" in line:
            said.append(
                f"{line['event']}, {line['signal']}: tossed up with {TOSS} N·s, slack for {line['slack']:.2f} s; "
                f"f_z of the mean between {line['lowest']:.2f} and {line['highest']:.2f} N, height within "
                f"{100 * line['height_error']:.1f} cm, {line['solve_failures']} failed solves."
            )
    return said


def attach_printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the steps among the lines that `attach_table` gives; N, s, cm."""
    header = [
        "event",
        "signal",
        "step [N]",
        "expected",
        "off",
        "90 % [s]",
        "over",
        "dip",
        "sd [N]",
        "height [cm]",
        "failed",
    ]
    rows: list[tuple] = [
        (
            line["event"],
            line["signal"],
            f"{line['size']:.3f}"
            + (f" ± {line['size_ci95']:.3f}" if line["size_ci95"] == line["size_ci95"] else ""),
            f"{line['expected']:.3f}",
            f"{100 * line['error']:.1f} %",
            f"{line['rise']:.3f}",
            f"{100 * line['overshoot']:.0f} %",
            f"{100 * line['dip']:.0f} %",
            f"{line['deviation']:.3f}",
            f"{100 * line['height_error']:.1f}",
            line["solve_failures"],
        )
        for line in lines
        if "size" in line
    ]
    return title, header, rows
