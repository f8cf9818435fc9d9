"""`np-drake reproduce STUDY`: a table of the paper or of the docs, made anew.
`np-drake bench`: speed, as ratios measured in one run.

A study is a function `run(run, ...) -> Report`, whose further parameters are its options.
What all of them share (seed, processes, cluster, files) is added by `reports`.
"""

import dataclasses as dc
import os
from importlib import import_module
from typing import Annotated, Any

import typer
from typer import Argument, Option

from diagrams.batch.run import require
from diagrams.cli.verb import (
    OUT,
    OUT_OF_CASES,
    Report,
    Run,
    Verbs,
    print_table,
    progress,
    reports,
    say,
    tell,
)
from diagrams.evidence.studies.options import tabulate

VERB = "reproduce"


@dc.dataclass(frozen=True)
class Study:
    """Study by its module, loaded on use, and its function there.

    seed: default of `--seed`; None: nothing is drawn.
    many: works on many cases, in several processes.
    """

    module: str
    summary: str
    seed: int | None = 1000
    many: bool = True
    function: str = "run"

    def command(self, name: str) -> Any:
        """Return the study as a command, named as it is called, with all its options."""
        study = getattr(import_module(f"diagrams.evidence.{self.module}"), self.function)
        app = Verbs(add_completion=False)
        out = OUT_OF_CASES if self.many else OUT
        app.command(name)(reports(VERB, seed=self.seed, out=out, many=self.many)(study))
        return typer.main.get_command(app)


STUDIES = {
    "tracking": Study("studies.tracking", "Every controller on circle and lemniscate."),
    "hover": Study("studies.tracking", "Hover while the payload swings.", function="hover"),
    "attach": Study("studies.tracking", "100 g more are hung on in flight.", function="attach"),
    "changes": Study(
        "studies.random_flight_studies",
        "Drawn flights with a payload hung on or cut off.",
        9000,
        function="changes",
    ),
    "beyond": Study(
        "studies.random_flight_studies", "Drawn flights beyond a pendulum.", 9100, function="beyond"
    ),
    "robustness": Study(
        "studies.robustness", "Payload, tether, speed, air, noise, lag, delay, battery."
    ),
    "estimation": Study("studies.estimation", "The paper's table, one step ahead."),
    "sample-efficiency": Study(
        "studies.estimation", "Error against training samples.", function="sample_study"
    ),
    "real": Study("real.scoring", "The diagnosis on real flights with known causes.", seed=None),
    "payload-flights": Study(
        "real.payload_flights", "Forecasts on real flights with a payload.", seed=None
    ),
    "identification": Study(
        "simulated_vehicles", "Simulated vehicles identified from their logs.", 5800
    ),
    "since": Study(
        "changed_vehicles", "Simulated vehicles changed between flights, diagnosed.", 6900
    ),
    "coverage": Study("coverage", "Certificates of simulated vehicles, flown.", 7800),
}


def reproduce(
    context: typer.Context,
    study: Annotated[str | None, Argument(metavar="STUDY", help="Name of the study.")] = None,
    listed: Annotated[bool, Option("--list", help="List the studies and leave.")] = False,
) -> int | None:
    """Make a table or figure of the paper or of the docs anew. `reproduce STUDY --help` shows the
    study's options.

    Training flights draw --seed, evaluation flights the next ones. Without STUDY, or with --list,
    the studies are listed.
    """
    if study is None or listed:
        print_table(
            "studies", ["STUDY", "what it shows"], [(n, s.summary) for n, s in STUDIES.items()]
        )
        say(f"np-drake {VERB} STUDY --help shows the options of a study.")
        return None
    require(study in STUDIES, f"STUDY must be one of {', '.join(STUDIES)}; got {study!r}.")
    command = STUDIES[study].command(study)
    return command.main(context.args, prog_name=f"np-drake {VERB} {study}", standalone_mode=False)


TIMES = (
    ("problems", "suite"),
    ("solver", "name"),
    ("median [ms]", "median_ms"),
    ("p95", "p95_ms"),
    ("p99", "p99_ms"),
    ("max", "max_ms"),
    ("to acados", "ratio_to_acados"),
    ("gap", lambda line: f"{line['gap_median']:.1e}"),
)
PREDICTIONS = (*TIMES[:1], *TIMES[2:6], ("to sqp", "ratio_to_sqp"))
ANSWERS = (
    ("problems", "suite"),
    ("solver", "name"),
    ("n", "problems"),
    ("failed", "failures"),
    ("fell back", "fallbacks"),
    ("largest gap", lambda line: f"{line['gap_max']:.1e}"),
    ("largest violation", lambda line: f"{line['violation_max']:.1e}"),
)


@reports("bench", seed=0)
def bench(
    run: Run,
    problems: Annotated[int, Option(min=10, max=100_000, help="Recorded MPC problems.")] = 200,
    seconds: Annotated[
        float, Option(min=1.0, max=3600.0, help="Simulated time of the simulator [s].")
    ] = 40.0,
) -> Report:
    """Time solvers, predictions and simulator; the peer is acados."""
    if os.environ.get("OMP_NUM_THREADS") != "1":
        tell(
            "OMP_NUM_THREADS is not 1: small matrices run two to three times slower on "
            "several threads."
        )
    from diagrams.evidence.studies import bench as measure
    from diagrams.evidence.studies.sweep import DITHERED, Row, train_row

    with progress("training, recording problems") as advance:
        paper = run.folder / "paper.safetensors"
        row = Row("", "", training=DITHERED, configuration="paper")
        train_row(row, paper, seed=run.seed, solver="sqp")
        advance(0.5, "recording")
        kinds: dict[str, dict[str, Any]] = {
            "payload_filter, K = 4": {},
            "np: paper, K = 24": {"kind": "np", "predictor": str(paper)},
            "np: paper, K = 24, N = 40": {"kind": "np", "predictor": str(paper), "horizon": 40},
        }
        recorded = {
            name: measure.record_problems(problems, seed=run.seed, **kind)
            for name, kind in kinds.items()
        }
    with run.counting("solvers") as on_progress:
        suites, predictions = measure.suite(recorded, progress=on_progress)
    with progress("simulator"):
        factor = measure.real_time_factor(seconds=seconds, seed=run.seed)
    lines = [{"suite": suite, **line} for suite, of in suites.items() for line in of]
    return Report(
        [
            tabulate("MPC solvers; to …: ratio of medians in this run; gap: median", lines, TIMES),
            tabulate("MPC solvers, answers", lines, ANSWERS),
            tabulate("predictions: label, update and forecast", predictions, PREDICTIONS),
        ],
        config=dc.asdict(next(iter(recorded.values()))[0].controller.mpc),
        metrics={
            "mpc": {name: {line["name"]: line for line in of} for name, of in suites.items()},
            "predictions": predictions,
            "simulator": {"real_time_factor": {"closed_loop": factor}},
        },
        notes=[f"simulator with sensors, payload_filter and MPC: {factor:.3g} times real time"],
    )
