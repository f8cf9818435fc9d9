"""Study `hover`: hover while the payload swings."""

import dataclasses as dc

import numpy as np

from diagrams.batch.columns import percent, spread, tabulate
from diagrams.batch.flown import FlownOptions, FlownRun, choose_rows
from diagrams.batch.options import Only, Reality
from diagrams.batch.run import Report, Run, Table
from diagrams.batch.workers import failures
from diagrams.payload import figures, hover_swing
from diagrams.payload.hover_swing import DAMPED, EARLY, PAPER
from np_drake import metrics
from np_drake.files.number_text import NOTHING


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    only: Only = None
    reality: Reality = None


def run(run: Run, options: Options) -> Report:
    """Hover while the payload swings. --out DIR: models, and the payload's distance as a figure."""
    run = FlownRun.of(run, options)
    rows = choose_rows(hover_swing.ROWS, options.only)
    runs = hover_swing.run_hover(run, rows, options.reality)
    lines = hover_swing.hover_table(runs)
    said = verdict(lines)
    named = {row.name: f"trained on {row.training}" if row.training else "" for row in rows}
    configs = {
        row.name: hover_swing.hover_config(
            row, solver=run.solver, model=named[row.name], reality=options.reality
        )
        for row in rows
    }
    controllers = {name: dc.asdict(config.controller) for name, config in configs.items()}
    of_figure = f"Hover, impulse on the payload, seed {run.seeds[0]}"
    summaries = [{key: value for key, value in flown.items() if key != "course"} for flown in runs]
    return Report(
        [hover_printed(lines, f"{run.title(learner='np ')}; ± 95 % interval of the mean")],
        config={**run.settings, "controllers": controllers},
        metrics={"table": lines, "verdict": said, "runs": summaries},
        notes=[
            *said,
            *failures(run.workers.finished),
            *(f"{name}: MPC {controller['mpc']}" for name, controller in controllers.items()),
        ],
        figures={"hover_payload_distance.png": lambda: figures.payload_distance(runs, of_figure)},
    )


def hover_printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines; errors in cm.

    Args:
        lines: of `hover_table`.
    """

    def paper(line: dict) -> str:
        return f"{100 * PAPER[line['row']]:.1f}" if line["row"] in PAPER else NOTHING

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


def _sign(line: dict) -> str:
    """Return grows, decays or neither, by the interval of the rate."""
    spread = np.nan_to_num(line["rate_ci95"])
    if line["rate"] - spread > 0:
        return "grows"
    return "decays" if line["rate"] + spread < 0 else "neither"


def verdict(lines: list[dict]) -> list[str]:
    """Return the findings of the table in words: reductions, growing swings, and the effect of
    active damping.
    """
    by = {line["row"]: line for line in lines}
    said = []
    if "np" in by and "nominal" in by:
        cut, plane = by["np"]["position_rmse_cut"], by["np"]["E_xy_cut"]
        late = by["np"]["late_cut"]
        said.append(
            f"np against nominal: position RMSE cut by {100 * cut:.1f} % ({100 * late:.1f} "
            f"% from {EARLY:.0f} s "
            f"after the impulse on), E_xy by {100 * plane:.1f} %."
        )
    signs = ", ".join(f"{name} {_sign(line)}" for name, line in by.items())
    said.append(f"rate of the swing, interval against zero: {signs}.")
    growing = [
        name for name, line in by.items() if line["rate"] - np.nan_to_num(line["rate_ci95"]) > 0
    ]
    said.append(f"swing grows (interval above zero) with: {', '.join(growing) or 'no controller'}.")
    if DAMPED in by and "nominal" in by:
        damped, nominal = by[DAMPED], by["nominal"]
        said.append(
            f"active damping: below {100 * metrics.SETTLED:.0f} cm after "
            f"{damped['settling']:.1f} s, "
            f"nominal after {nominal['settling']:.1f} s; position RMSE "
            f"{damped['position_rmse']:.4f} m."
        )
    return said
