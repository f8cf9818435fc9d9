"""Study `faults`: flights with random faults under every controller."""

import dataclasses as dc
from typing import Annotated

from typer import Option

from diagrams.batch.campaign import Record
from diagrams.batch.columns import MISSING, Column, tabulate
from diagrams.batch.flown import FlownOptions, FlownRun, choose_rows
from diagrams.batch.run import Report, Run, Table, counted
from diagrams.batch.workers import require_result
from diagrams.robustness.faults import campaign as experiment
from diagrams.robustness.faults.figure import faults_figure
from diagrams.robustness.faults.table import by_controller, by_fault, loss_cells, ours_to_mend, verdicts
from diagrams.robustness.sweep import make_sweep, trained

Flights = Annotated[int, Option("--flights", min=1, max=100_000, help="Flights, of seeds seed + 1, …")]
SHORT = {"payload_filter": "filter"}  # names of rows that would make the table too wide
_COUNTS: tuple[Column, ...] = (
    ("flights", "flights"),
    ("errors", "exceptions"),
    ("NaN", "nan"),
    ("lost", "lost"),
    ("physics", "physics"),
    ("ours", "ours"),
    ("not back", "away"),
    ("back [s]", lambda line: _time(line["recovery"])),
    ("90 % [s]", lambda line: _time(line["recovery_90"])),
)


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    seeds: Flights = 1000
    only: Annotated[list[str] | None, Option("--only", help="Only rows of these names.")] = None


def run(run: Run, options: Options) -> Report:
    """Random faults of sensors, solver, rotors, payload, air. --out DIR: figure, and cases to resume from."""
    run = FlownRun.of(run, options)
    sweep = make_sweep(run, experiment.DURATION)
    rows = choose_rows(experiment.ROWS, options.only, always=())
    with run.progress("faults") as advance:
        trainings, flights, beside = experiment.run_faults(
            sweep,
            seeds=run.seeds,
            rows=rows,
            on_training=trained(advance),
            on_progress=counted(advance, "flights"),
            on_oracle=counted(advance, "oracle flights on the draws of lost ones"),
        )
    require_result(flights)
    verdict = verdicts(flights, beside)
    lines, kinds, cells = by_controller(flights, verdict), by_fault(flights, verdict), loss_cells(flights)
    title = f"{run.count} flights, seeds {run.seeds[0]} … {run.seeds[-1]}, {run.solver}"
    config = experiment.campaign_config(run.seed, run.solver) | {"seeds": run.seeds}
    named = ours_to_mend(flights, verdict)
    return Report(
        [controllers_printed(lines, title), faults_printed(kinds), losses_printed(cells, rows)],
        config=config,
        metrics={
            "table": lines,
            "faults": kinds,
            "losses": cells,
            "ours": named,
            "runs": [*trainings, *flights, *beside],
        },
        summary=[f"ours to mend: {line}" for line in named],
        notes=[
            *_failures([*trainings, *flights, *beside]),
            *(f"{name}: {value}" for name, value in config.items() if name != "seeds"),
        ],
        figures={"faults.png": lambda: faults_figure(kinds, title)},
    )


def _failures(records: list[Record]) -> list[str]:
    """Return a line on every case that ended with an exception or whose integrator gave up."""
    said = [f"exception: {r['case']}: {r['error']}" for r in records if "error" in r]
    ended = [r for r in records if "result" in r and r["result"].get("gave_up")]
    return [*said, *(f"exception: {r['case']}: {r['result']['lost']}" for r in ended)]


def _time(value: float | None) -> str:
    return MISSING if value is None else f"{value:.2f}"


def controllers_printed(lines: list[dict], title: str) -> Table:
    """Return the table of counts and times by controller."""
    return tabulate(f"controllers; {title}", lines, (("controller", "row"), *_COUNTS))


def faults_printed(lines: list[dict]) -> Table:
    """Return the table of counts and times by kind of fault."""
    return tabulate("faults, all controllers but the oracle", lines, (("fault", "fault"), *_COUNTS))


def losses_printed(lines: list[dict], rows: tuple) -> Table:
    """Return the table of lost of flown vehicles by kind of fault and controller."""

    def cell(name: str):
        return lambda line: f"{line['cells'][name][0]}/{line['cells'][name][1]}"

    columns: list[Column] = [("fault", "fault")]
    columns += [(SHORT.get(row.name, row.name), cell(row.name)) for row in rows]
    return tabulate("lost of flown, by fault and controller", lines, columns)
