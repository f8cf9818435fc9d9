"""`np-drake reproduce hover | timing`: a swinging payload, and what a period costs, beside the paper."""

import dataclasses as dc

from diagrams.batch.workers import failures
from diagrams.cli import options
from diagrams.cli.columns import MISSING, fixed, percent, spread, tabulate
from diagrams.cli.output import Table
from diagrams.cli.reproduce.campaign import Campaign, campaign, choose_rows
from diagrams.cli.runner import Report, Run, counting, reports

PERIODS = 250  # of the timing table [1]


@campaign(seeds=5)
def hover(run: Campaign, only: options.Only = None) -> Report:
    """Hover while the payload swings. --out DIR: models, and the payload's distance as a figure."""
    from diagrams.payload import figures, hover_swing

    rows = choose_rows(hover_swing.ROWS, only)
    runs = run.fly("hover", hover_swing.run_hover, rows)
    lines = hover_swing.hover_table(runs)
    verdict = hover_swing.verdict(lines)
    named = {row.name: f"trained on {row.training}" if row.training else "" for row in rows}
    controllers = {
        row.name: dc.asdict(
            hover_swing.hover_config(row, solver=run.solver, model=named[row.name]).controller
        )
        for row in rows
    }
    of_figure = f"Hover, impulse on the payload, seed {run.seeds[0]}"
    summaries = [{key: value for key, value in flown.items() if key != "course"} for flown in runs]
    return Report(
        [hover_printed(lines, f"{run.title(learner='np ')}; ± 95 % interval of the mean")],
        config={**run.settings, "controllers": controllers},
        metrics={"table": lines, "verdict": verdict, "runs": summaries},
        notes=[
            *verdict,
            *failures(run.workers.finished),
            *(f"{name}: MPC {controller['mpc']}" for name, controller in controllers.items()),
        ],
        figures={"hover_payload_distance.png": lambda: figures.payload_distance(runs, of_figure)},
    )


def hover_printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines that `hover_table` gives; errors in cm."""
    from diagrams.payload.hover_swing import EARLY, PAPER

    def paper(line: dict) -> str:
        return f"{100 * PAPER[line['row']]:.1f}" if line["row"] in PAPER else MISSING

    columns = (
        ("controller", "row"),
        ("3-D [cm]", spread("position_rmse")),
        ("cut", percent("position_rmse_cut", 1)),
        (f"first {EARLY:.0f} s", spread("early")),
        ("after", spread("late")),
        ("xy [cm]", spread("E_xy")),
        ("swing [cm]", spread("amplitude", 1)),
        ("decay [1/s]", spread("rate", 3, factor=1)),
        ("< 5 cm after [s]", spread("settling", 1, factor=1, lost="never")),
        ("paper 3-D", paper),
        ("failed", "solve_failures"),
    )
    return tabulate(title, lines, columns)


@reports("reproduce", seed=1000)
def timing(run: Run, only: options.Only = None) -> Report:
    """What a period costs. As ratios to a reference calculation in the same run."""
    from diagrams.performance import timing as experiment
    from diagrams.tracking.tracking import train_models

    rows, flight_seed = choose_rows(experiment.ROWS, only), run.seed + 1
    with counting("timing", "controllers") as on_progress:
        models = train_models(rows, run.folder, seed=run.seed, solver="sqp")
        lines = experiment.timing_table(
            models, periods=PERIODS, seed=flight_seed, rows=rows, on_progress=on_progress
        )
    mpc = dc.asdict(experiment.timing_config(rows[0], periods=PERIODS, solver="sqp").controller.mpc)
    title = f"{PERIODS} periods of the {experiment.TRACK}, seed {flight_seed}, np trained on seed {run.seed}"
    config = {"track": experiment.TRACK, "periods": PERIODS, "mpc": mpc}
    return Report(
        [timing_printed(lines, f"{title}; median / 95 % quantile")],
        config=config | {"training_seed": run.seed, "flight_seed": flight_seed},
        metrics={"table": lines},
        notes=[
            "processor time of one process; ratio: to the pseudo-inverse of a 40 x 30 matrix in the same run "
            f"({lines[0]['reference']:.3f} ms); paper: lift and refit < {experiment.PAPER['predict']:g} ms, "
            f"solve < {experiment.PAPER['solve']:g} ms on an i5-1135G7.",
            f"MPC of the first row: {mpc}",
        ],
    )


def timing_printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines that `timing_table` gives."""
    from diagrams.performance.timing import RATES

    def pair(key: str, digits: int, factor: float = 1.0):
        return lambda line: f"{factor * line[key]:.{digits}f} / {factor * line[f'{key}_p95']:.{digits}f}"

    columns = (
        ("controller", "row"),
        ("solver", "solver"),
        ("predict [ms]", pair("predict", 2)),
        ("ratio", fixed("predict_ratio", 1)),
        ("solve [ms]", pair("solve", 1)),
        ("ratio", fixed("solve_ratio", 0)),
        *((f"load at {rate} Hz [%]", pair(f"load_{rate}", 0, 100)) for rate in RATES),
        ("failed", "failures"),
    )
    return tabulate(title, lines, columns)
