"""Study `hover`: hover while the payload swings."""

import dataclasses as dc

from diagrams.batch.columns import MISSING, percent, spread, tabulate
from diagrams.batch.flown import FlownOptions, FlownRun, choose_rows
from diagrams.batch.options import Only
from diagrams.batch.run import Report, Run, Table
from diagrams.batch.workers import failures
from diagrams.payload import figures, hover_swing
from diagrams.payload.hover_swing import EARLY, PAPER


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    only: Only = None


def run(run: Run, options: Options) -> Report:
    """Hover while the payload swings. --out DIR: models, and the payload's distance as a figure.

    Args:
        run: seed, folders, workers and progress.
        options: of the study.
    """
    run = FlownRun.of(run, options)
    rows = choose_rows(hover_swing.ROWS, options.only)
    runs = hover_swing.run_hover(run, rows)
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
    """Return the table of the lines; errors in cm.

    Args:
        lines: of `hover_table`.
        title: what was flown.
    """

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
