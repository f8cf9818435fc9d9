"""`np-drake reproduce STUDY`: a table of the paper or of the docs, made anew.

A study is a module with `Options`, a dataclass of its options, and `run(run, options) -> Report`.
What all of them share (seed, processes, cluster, files) is added by `reports`.
"""

import dataclasses as dc
import inspect
from collections.abc import Callable
from importlib import import_module
from typing import Annotated, Any, get_type_hints

import typer
from typer import Argument, Option

from diagrams.batch.run import Report, Run
from diagrams.cli import options
from diagrams.cli.output import print_table, say
from diagrams.cli.runner import Verbs, reports

VERB = "reproduce"


@dc.dataclass(frozen=True)
class Study:
    """Study by the name of its module; the module is loaded on use.

    seed: default of `--seed`; None: nothing is drawn.
    many: works on many cases, in several processes.
    """

    module: str
    summary: str
    seed: int | None = 1000
    many: bool = True

    def verb(self) -> Callable[..., None]:
        """Return the study as a verb with all its options."""
        module: Any = import_module(f"diagrams.{self.module}")

        def body(run: Run, **given: Any) -> Report:
            return module.run(run, module.Options(**given))

        keyword, hints = (
            inspect.Parameter.KEYWORD_ONLY,
            get_type_hints(module.Options, include_extras=True),
        )
        own = [
            inspect.Parameter(
                field.name, keyword, default=field.default, annotation=hints[field.name]
            )
            for field in dc.fields(module.Options)
        ]
        run = inspect.Parameter("run", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=Run)
        body.__signature__ = inspect.Signature([run, *own])  # type: ignore[attr-defined]
        body.__doc__ = module.run.__doc__.split("Args:")[0].rstrip()  # what `--help` says
        out = options.OutOfCases if self.many else options.Out
        return reports(VERB, seed=self.seed, out=out, many=self.many)(body)

    def command(self, name: str) -> Any:
        """Return the study as a command, named as it is called."""
        app = Verbs(add_completion=False)
        app.command(name)(self.verb())
        return typer.main.get_command(app)


STUDIES = {
    "tracking": Study("tracking.study", "Every controller on circle and lemniscate."),
    "configurations": Study(
        "tracking.configurations", "Every configuration of the predictor in the loop."
    ),
    "weights": Study("tracking.tuning", "How the MPC's weights were chosen."),
    "gap": Study("gap.real_flights", "The diagnosis on agile real flights.", seed=None, many=False),
    "mhe": Study(
        "prediction.mhe_flights", "A moving-horizon estimator on real flights.", seed=None
    ),
    "theorem": Study("prediction.theorem", "Theorem 1, corrected: bound against error."),
    "tether": Study("payload.tether", "The tether's length from the payload's mode."),
    "estimation": Study("prediction.estimation", "The paper's table, one step ahead."),
    "sample-efficiency": Study("prediction.sample_efficiency", "Error against training samples."),
    "envelope": Study(
        "prediction.envelope_study", "What the network adds on fresh simulated payloads."
    ),
    "response": Study("prediction.response", "How late the prediction is."),
    "hover": Study("payload.hover_study", "Hover while the payload swings."),
    "attach": Study(
        "payload.attach_study", "The payload changes in flight: attached, cut off, taut."
    ),
    "node": Study("offboard.study", "Faults while a node flies: what is sent, when it stops."),
    "timing": Study("performance.timing", "What a period costs.", many=False),
    "robustness": Study(
        "robustness.study", "Payload, tether, speed, air, noise, lag, delay, battery."
    ),
    "margins": Study(
        "robustness.margins", "Largest delay and loop gain that each controller bears."
    ),
    "real": Study(
        "challenge.real_score", "The diagnosis on real flights with known causes.", seed=None
    ),
    "payload-flights": Study(
        "challenge.forecast", "Forecasts on real flights with a payload.", seed=None
    ),
    "vehicles": Study("robustness.vehicles.study", "35 g, 2 kg and 6 kg on four tracks."),
    "models": Study("tracking.packaged", "The packaged model files, made anew.", seed=None),
    "identification": Study(
        "identification.simulated", "Simulated vehicles identified from their logs.", 5800
    ),
    "deadlines": Study(
        "performance.deadlines", "Deadlines of the loop on this machine.", 9800, many=False
    ),
}
RETIRED = {
    "autopilot": "`np-drake fly circle --autopilot betaflight` flies on the firmware",
    "identification-flights": "`np-drake identify LOG... --held-out LOG` judges on other flights",
    "blackbox": "`np-drake identify flight.bbl --vehicle FILE` reads the firmware's own log",
    "pendulum": "it is called tether now: `np-drake reproduce tether`",
    "replay": "it is an option of another study: `np-drake reproduce real --replay`",
    "cost": "`np-drake challenge solve --json` holds time and memory of every case",
    "cooperative": "cooperative transport is an example, `python -m diagrams.payload.cooperative`",
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
    command = find(study).command(study)
    return command.main(context.args, prog_name=f"np-drake {VERB} {study}", standalone_mode=False)


def find(name: str) -> Study:
    """Return the study of this name.

    Raises: ValueError: where there is none, or no longer.
    """
    if name in RETIRED:
        raise ValueError(f"{name} is gone: {RETIRED[name]}.")
    if name not in STUDIES:
        raise ValueError(f"STUDY must be one of {', '.join(STUDIES)}; got {name!r}.")
    return STUDIES[name]
