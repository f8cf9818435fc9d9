"""`np-drake reproduce configurations`: every configuration of the predictor in the same loop."""

import dataclasses as dc

from diagrams.batch.workers import failures
from diagrams.cli import options
from diagrams.cli.columns import fixed, spread, tabulate
from diagrams.cli.output import Table
from diagrams.cli.reproduce.campaign import Campaign, campaign, choose_rows
from diagrams.cli.runner import Report


@campaign(seeds=5)
def configurations(run: Campaign, only: options.Only = None) -> Report:
    """Every configuration of the predictor in the loop. All are trained on one flight; --out DIR: models."""
    from diagrams.tracking import campaign as flights
    from diagrams.tracking import configurations as experiment
    from diagrams.tracking import tracking
    from np_drake.lifting.training.train import make_config

    rows = choose_rows(experiment.ROWS, only)
    summaries = run.fly("configurations", flights.run_tracking, rows)
    lines, places = tracking.table(summaries, rows), experiment.ranking(summaries)
    used = {
        row.configuration: make_config(row.configuration, seed=run.seed) for row in rows if row.configuration
    }
    configs = {name: dc.asdict(c) for name, c in used.items()}
    best = [{"row": name, "mean": mean, "sd": sd} for name, mean, sd in places]
    return Report(
        [printed(lines, f"{run.title()}; ± standard deviation over seeds")],
        config={**run.settings, "mpc": tracking.frozen_weights(), "configurations": configs},
        metrics={"table": lines, "ranking": best, "runs": summaries},
        notes=[
            *failures(run.workers.finished),
            experiment.verdict(places),
            f"training: {experiment.TRAINING}, seed {run.seed}; evaluation: seeds {run.seeds}",
            *(f"{name}: {c}" for name, c in used.items()),
        ],
    )


def printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines that `tracking.table` gives; errors in cm."""
    columns = (
        ("track", "track"),
        ("controller", "row"),
        ("E_xy [cm]", spread("E_xy", by="sd")),
        ("E_z [cm]", spread("E_z", by="sd")),
        ("growth", fixed("growth", 2)),
        ("failed", "solve_failures"),
    )
    return tabulate(title, sorted(lines, key=lambda line: line["track"]), columns)
