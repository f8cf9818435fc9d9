"""`np-drake reproduce configurations`: every configuration of the predictor in the same loop."""

import dataclasses as dc
from collections.abc import Collection

from diagrams.cli import options
from diagrams.cli.output import Table, flying, require_files, show, write_metrics


def configurations(
    seeds: options.Seeds = 5,
    solver: options.Solver = "sqp",
    jobs: options.Jobs = 2,
    only: options.Only = None,
    seed: options.Seed = 1000,
    out: options.Out = None,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Every configuration of the predictor in the loop. All are trained on one flight; --out DIR: models."""
    require_files(json, markdown)
    from diagrams.tracking import configurations as experiment
    from diagrams.tracking import tracking
    from np_drake.lifting.training.train import make_config

    rows = choose_rows(experiment.ROWS, only)
    evaluation = options.evaluation_seeds(seed, seeds)
    with flying("configurations", out) as (folder, on_progress):
        summaries = tracking.run_tracking(
            folder,
            seeds=evaluation,
            training_seed=seed,
            solver=solver,
            rows=rows,
            jobs=jobs,
            on_progress=on_progress,
        )
    lines, places = tracking.table(summaries, rows), experiment.ranking(summaries)
    used = {row.configuration: make_config(row.configuration, seed=seed) for row in rows if row.configuration}
    weights = tracking.frozen_weights()
    config = {"solver": solver, "seeds": evaluation, "training_seed": seed, "mpc": weights}
    config["configurations"] = {name: dc.asdict(c) for name, c in used.items()}
    best = [{"row": name, "mean": mean, "sd": sd} for name, mean, sd in places]
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines, ranking=best, runs=summaries)
    title = (
        f"{seeds} flights a row, seeds {evaluation[0]} … {evaluation[-1]}, trained on seed {seed}, {solver}; "
        "± standard deviation over seeds"
    )
    notes = [
        experiment.verdict(places),
        f"training: {experiment.TRAINING}, seed {seed}; evaluation: seeds {evaluation}",
        *(f"{name}: {c}" for name, c in used.items()),
    ]
    show(markdown, printed(lines, title), notes=notes)


def choose_rows(rows: tuple, only: Collection[str] | None) -> tuple:
    """The rows of these names, all where there are none; nominal always. Raises ValueError on an unknown name."""
    only = only or ()
    unknown = set(only) - {row.name for row in rows}
    if unknown:
        names = "; ".join(row.name for row in rows)
        raise ValueError(f"--only: must name rows of the table ({names}); got {', '.join(sorted(unknown))}.")
    return tuple(row for row in rows if not only or row.name in only or row.name == "nominal")


def printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the lines that `tracking.table` gives; errors in cm."""

    def cell(line: dict, key: str) -> str:
        if line[key] == float("inf"):
            return "lost"
        sd = line[f"{key}_sd"]
        return f"{100 * line[key]:.2f}" + (f" ± {100 * sd:.2f}" if sd == sd else "")

    header = ["track", "controller", "E_xy [cm]", "E_z [cm]", "growth", "failed"]
    rows: list[tuple] = [
        (
            *(line["track"], line["row"], cell(line, "E_xy"), cell(line, "E_z")),
            *(f"{line['growth']:.2f}", line["solve_failures"]),
        )
        for line in sorted(lines, key=lambda line: line["track"])
    ]
    return title, header, rows
