"""`np-drake challenge`: sets of flights with an effect that whoever diagnoses them does not know."""

from pathlib import Path
from typing import Annotated

import typer
from typer import Option
from typer.core import TyperGroup

from diagrams.cli.challenge import compare, score, solve
from diagrams.cli.output import require_folder
from diagrams.cli.runner import Report, Run, counting, reports

RETIRED = {
    "golden": "the frozen cases are tests: `make golden`",
    "logs": "round trips through files are tests: `pytest tests/diagrams/challenge/imported`",
    "active": "`np-drake next-flight` writes a random multisine",
}


class Challenge(TyperGroup):
    """Verbs of challenge sets; one that is gone says what took its place."""

    def resolve_command(self, context, arguments):
        """Return the verb.

        Args:
            context: of the command line.
            arguments: words that follow.
        Raises: ValueError: on a verb that is gone.
        """
        if arguments and arguments[0] in RETIRED:
            raise ValueError(f"{arguments[0]} is gone: {RETIRED[arguments[0]]}.")
        return super().resolve_command(context, arguments)


challenge = typer.Typer(
    cls=Challenge, help="Withheld-effect challenge sets.", add_completion=False, rich_markup_mode=None
)
challenge.command("solve")(solve.solve)
challenge.command("score")(score.score)
challenge.command("compare")(compare.compare)


@challenge.command("make")
@reports("challenge_make", seed=0, markdown=False, many=True, holds=("truth",))
def make(
    run: Run,
    out: Annotated[Path, Option(metavar="DIR", help="Folder for the case folders.")],
    truth: Annotated[Path, Option(metavar="DIR", help="Folder for their truth; not inside --out.")],
    simulator: Annotated[str, Option(metavar="NAME", help="Who flies: drake | rotorpy.")] = "drake",
    quality: Annotated[str, Option(metavar="NAME", help="Sensors: clean (ideal) | real | wild.")] = "clean",
    cases: Annotated[int, Option(min=0, max=100_000, help="Cases with effects.")] = 44,
    clean: Annotated[int, Option(min=0, max=100_000, help="Clean controls: cases without.")] = 20,
    seconds: Annotated[float, Option(help="Length of every flight [s].")] = 20.0,
    unseen: Annotated[
        bool, Option("--unseen", help="Out-of-library effects alone, of kinds in no other set.")
    ] = False,
) -> Report:
    """Fly and write a set: about half single effects, then pairs, triples, onsets in flight, out-of-library effects.

    Cases of the same request that are there already stay, so that an interrupted run goes on.
    """
    from diagrams.challenge.generate.make import check_request, require_no_other_set
    from diagrams.challenge.generate.make import make as fly_set

    check_request(out, truth, simulator=simulator, quality=quality, seconds=seconds, cases=cases + clean)
    for folder in (out, truth):
        require_folder(folder)
    require_no_other_set(out, truth, seed=run.seed, cases=cases + clean)
    config = {"simulator": simulator, "quality": quality, "cases": cases, "clean": clean, "seconds": seconds}
    config["unseen"] = unseen
    with counting("flying", "cases") as on_progress:
        result = fly_set(out, truth, seed=run.seed, workers=run.workers, on_progress=on_progress, **config)  # type: ignore[arg-type]
    kinds = ", ".join(f"{count} {kind}" for kind, count in result["kinds"].items())
    said = f"cases: {out} ({kinds}); truth: {truth}; redrawn: {result['redrawn']}"
    return Report([], config=config, metrics=result, lines=[said])
