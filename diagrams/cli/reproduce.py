"""`np-drake reproduce STUDY`: a table of the paper or of the docs, made anew.

A study is a function `run(run, options: Options) -> Report`; `Options` is a dataclass.
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
    """Study by its module, loaded on use, and its function there.

    seed: default of `--seed`; None: nothing is drawn.
    many: works on many cases, in several processes.
    """

    module: str
    summary: str
    seed: int | None = 1000
    many: bool = True
    function: str = "run"

    def verb(self) -> Callable[..., None]:
        """Return the study as a verb with all its options."""
        study = getattr(import_module(f"diagrams.{self.module}"), self.function)
        options_of = get_type_hints(study)["options"]
        keyword, hints = (
            inspect.Parameter.KEYWORD_ONLY,
            get_type_hints(options_of, include_extras=True),
        )

        def body(run: Run, **given: Any) -> Report:
            return study(run, options_of(**given))

        own = [
            inspect.Parameter(
                field.name, keyword, default=field.default, annotation=hints[field.name]
            )
            for field in dc.fields(options_of)
        ]
        run = inspect.Parameter("run", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=Run)
        body.__signature__ = inspect.Signature([run, *own])  # type: ignore[attr-defined]
        body.__doc__ = study.__doc__.split("Args:")[0].rstrip()  # what `--help` says
        out = options.OutOfCases if self.many else options.Out
        return reports(VERB, seed=self.seed, out=out, many=self.many)(body)

    def command(self, name: str) -> Any:
        """Return the study as a command, named as it is called."""
        app = Verbs(add_completion=False)
        app.command(name)(self.verb())
        return typer.main.get_command(app)


STUDIES = {
    "tracking": Study("studies.tracking", "Every controller on circle and lemniscate."),
    "hover": Study("studies.payload", "Hover while the payload swings.", function="hover"),
    "attach": Study("studies.payload", "100 g more are hung on in flight.", function="attach"),
    "robustness": Study(
        "studies.robustness", "Payload, tether, speed, air, noise, lag, delay, battery."
    ),
    "estimation": Study("studies.estimation", "The paper's table, one step ahead."),
    "sample-efficiency": Study(
        "studies.estimation", "Error against training samples.", function="sample_study"
    ),
    "timing": Study("studies.speed", "What a period costs.", many=False),
    "gap": Study("gap.real_flights", "The diagnosis on agile real flights.", seed=None, many=False),
    "real": Study(
        "challenge.real_score", "The diagnosis on real flights with known causes.", seed=None
    ),
    "payload-flights": Study(
        "challenge.forecast", "Forecasts on real flights with a payload.", seed=None
    ),
    "identification": Study(
        "identification.simulated", "Simulated vehicles identified from their logs.", 5800
    ),
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
    """Return the study of this name; ValueError where there is none."""
    if name not in STUDIES:
        raise ValueError(f"STUDY must be one of {', '.join(STUDIES)}; got {name!r}.")
    return STUDIES[name]
