"""`np-drake reproduce mhe | gap | theorem`: tables of real flights."""

import dataclasses as dc
from typing import Annotated

from typer import Option

from diagrams.batch.workers import failures
from diagrams.cli import options
from diagrams.cli.columns import grouped, percent, tabulate
from diagrams.cli.output import progress
from diagrams.cli.reproduce.real_flights import arrays, required, trained
from diagrams.cli.runner import Report, Run, counting, reports


@reports("reproduce", seed=None, out=options.OutOfCases, many=True)
def mhe(run: Run, neurobem: options.Neurobem = None) -> Report:
    """A moving-horizon estimator on real flights. Those of the paper's estimation table."""
    folder = required("mhe", neurobem)
    from diagrams.prediction import mhe_flights
    from np_drake.estimation.wrench_table import COLUMNS

    with progress("real flights", 1.0) as advance:
        config = mhe_flights.tuned_config(folder)
        advance(0.3, "weights tuned")
        table = mhe_flights.mhe_table(
            folder,
            config,
            workers=run.workers,
            on_progress=lambda done, total: advance(0.3 + 0.7 * done / total, f"{done} of {total}"),
        )
    of_flight = {
        flight: [
            (line["row"], *(f"{line[name]:.3f}" for name in COLUMNS))
            for line in table.rows
            if line["flight"] == flight
        ]
        for flight in dict.fromkeys(line["flight"] for line in table.rows)
    }
    title = "Wrench from the motion on real flights, RMSE [N, N·m]; NeuroMHE as published"
    times = {"program": table.step_time, "closed_form": table.exact_step_time}
    return Report(
        [grouped(title, ["", *COLUMNS], of_flight)],
        config={"training": mhe_flights.TRAINING, "mhe": dc.asdict(config)},
        metrics={"table": table.rows, "step_time": times, "disagreement": table.disagreement},
        lines=[
            f"no random draw; tuned on the training segment: {config}",
            f"median time of a step: {1e3 * table.step_time:.3g} ms on MathematicalProgram, "
            f"{1e3 * table.exact_step_time:.2g} ms in closed form; they differ by {table.disagreement:.1g} at most",
        ],
    )


@reports("reproduce", seed=None, out=options.OutOfCases, many=True)
def gap(run: Run, neurobem: options.Neurobem = None) -> Report:
    """The diagnosis on agile real flights. Each is held out in turn."""
    from diagrams.gap import real_flights

    folder = required("gap", neurobem)
    with counting("real flights") as on_progress:
        folds = real_flights.leave_one_out(folder, workers=run.workers, on_progress=on_progress)
    lines, verdicts = real_flights.rows(folds), {f.name: f.verdict for f in folds}
    title = "Real flights, each held out in turn; force [N], torque [N·m]; zero, mean: what predicting these leaves"
    columns = (
        ("held out", "flight"),
        ("RMS of", "group"),
        ("nominal", "nominal"),
        ("after", "after"),
        ("cut", percent("cut")),
        ("zero", lambda line: line.get("zero")),
        ("mean", lambda line: line.get("mean")),
    )
    return Report(
        [tabulate(title, lines, columns)],
        config={"flights": list(verdicts)},
        metrics={"table": lines, "verdicts": verdicts},
        lines=[f"{name}: {', '.join(verdict) or 'nothing missing'}" for name, verdict in verdicts.items()],
    )


@reports("reproduce", seed=1000, out=options.OutOfCases, many=True)
def theorem(
    run: Run,
    neurobem: options.Neurobem = None,
    spacing: Annotated[int, Option(min=1, max=1_000_000, help="Samples between windows; 1: all.")] = 1,
) -> Report:
    """Theorem 1, corrected: bound against error. In every window of the real flights."""
    from diagrams.prediction import theorem as experiment

    flights = arrays("theorem", neurobem)
    models, settings = trained(flights[0], run.seed)
    with counting("every window") as on_progress:
        lines = experiment.bound_table(
            models,
            flights,
            spacing=spacing,
            config=settings,
            workers=run.workers,
            on_progress=on_progress,
        )
    horizon = f"horizon {experiment.STEPS[-1]} steps, every {spacing}. window."
    return Report(
        [experiment.printed(lines)],
        config=settings,
        metrics={"table": lines},
        lines=[
            f"seed {run.seed}, trained on {flights[0].name}; {horizon}",
            *experiment.assumption_lines(lines),
        ],
        notes=failures(run.workers.finished),
    )
