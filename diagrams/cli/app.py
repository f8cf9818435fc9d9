"""The verbs of `np-drake`."""

from typing import Annotated

import typer
from typer import Option

from diagrams.cli import (
    bench,
    demo,
    diagnose,
    doctor,
    evaluate,
    export,
    fly,
    identify,
    import_logs,
    node,
    options,
    train,
    vehicle,
)
from diagrams.cli.challenge import challenge
from diagrams.cli.outcome import PROGRAM
from diagrams.cli.output import say
from diagrams.cli.reproduce import VERB, reproduce
from diagrams.cli.verbs import Verbs

app = Verbs(
    name=PROGRAM,
    help="Neural Predictor and NP-MPC for a quadrotor with a tethered payload, on Drake.",
    epilog=options.EPILOG,
)
app.command("demo")(demo.demo)
app.command("fly")(fly.fly)
app.command("node")(node.node)
app.command("train")(train.train)
app.command("evaluate")(evaluate.evaluate)
app.command("import")(import_logs.import_logs)
app.command("doctor")(doctor.doctor)
app.command("identify")(identify.identify)
app.command("diagnose")(diagnose.diagnose)
app.command(
    VERB,  # what follows the study's name is the study's
    context_settings={"allow_extra_args": True, "allow_interspersed_args": False},
)(reproduce)
app.add_typer(vehicle.vehicle, name="vehicle")
app.command("export")(export.export)
app.command("bench")(bench.bench)
app.add_typer(challenge, name="challenge")


@app.callback(invoke_without_command=True)
def about(
    context: typer.Context,
    version: Annotated[bool, Option("--version", help="Print the version and leave.")] = False,
    debug: Annotated[
        bool, Option("--debug", help="Print the traceback of an error, behind any verb too.")
    ] = False,  # read before the others, by `run_app`
) -> None:
    """Print the version or the help, where no verb is given."""
    if version:
        from importlib.metadata import version as installed

        say(f"{PROGRAM} {installed('np_drake')}")
    elif context.invoked_subcommand is None:
        say(context.get_help())
