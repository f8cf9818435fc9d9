"""Entry point `np-drake`: the verbs and their exit codes.

Exit code 0; 2 for bad input (one clear line on stderr, nothing half-written); 1 for a failed run. With
NP_DRAKE_TRACEBACK=1 in the environment the line gives way to the traceback.
"""

import logging
import os
import sys
from collections.abc import Sequence
from typing import Annotated

import typer
from typer import Option

from diagrams.batch.failed_run import FailedRun
from diagrams.cli import (
    bench,
    demo,
    diagnose,
    doctor,
    evaluate,
    export,
    fly,
    import_logs,
    next_flight,
    options,
    train,
    vehicle,
)
from diagrams.cli.challenge import app as challenge
from diagrams.cli.output import console, say
from diagrams.cli.reproduce import app as reproduce

# Before NumPy is loaded: its threads cost more than they bring on matrices of this size.
os.environ.setdefault("OMP_NUM_THREADS", "1")

PROGRAM = "np-drake"
BAD_INPUT, FAILED, INTERRUPTED = 2, 1, 130

app = typer.Typer(
    name=PROGRAM,
    help="Neural Predictor and NP-MPC for a quadrotor with a tethered payload, on Drake.",
    epilog=options.EPILOG,
    rich_markup_mode=None,  # units stand in brackets, which markup would swallow
    pretty_exceptions_enable=False,
)
app.command("demo")(demo.demo)
app.command("fly")(fly.fly)
app.command("train")(train.train)
app.command("evaluate")(evaluate.evaluate)
app.command("import")(import_logs.import_logs)
app.command("doctor")(doctor.doctor)
app.command("diagnose")(diagnose.diagnose)
app.command("next-flight")(next_flight.next_flight)
app.add_typer(reproduce.reproduce, name="reproduce")
app.add_typer(vehicle.vehicle, name="vehicle")
app.command("export")(export.export)
app.command("bench")(bench.bench)
app.add_typer(challenge.challenge, name="challenge")

GROUPS = {
    group.name: {command.name for command in group.typer_instance.registered_commands}
    for group in app.registered_groups
    if group.typer_instance is not None
}


@app.callback(invoke_without_command=True)
def about(
    context: typer.Context,
    version: Annotated[bool, Option("--version", help="Print the version and leave.")] = False,
) -> None:
    """Print the version or the help, where no verb is given."""
    if version:
        from importlib.metadata import version as installed

        say(f"{PROGRAM} {installed('np_drake')}")
    elif context.invoked_subcommand is None:
        say(context.get_help())


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s: %(message)s")
    logging.getLogger("drake").setLevel(logging.WARNING)
    sys.exit(run(arguments))


def run(arguments: list[str]) -> int:
    """Run the command line and return its exit code."""
    return run_app(app, arguments)


def run_app(app: typer.Typer, arguments: list[str]) -> int:
    """Run an application and return its exit code; an expected failure is one line on stderr."""
    empty = _empty(arguments)
    if empty is not None:
        line = (
            f"an argument must not be empty; got {empty}. Name a file, a folder or a value, or leave it out."
        )
        return _report(arguments, line, BAD_INPUT)
    try:
        code = app(arguments, prog_name=PROGRAM, standalone_mode=False)
        return _report(arguments, "interrupted.", code) if code == INTERRUPTED else int(code or 0)
    except Exception as error:
        if os.environ.get("NP_DRAKE_TRACEBACK"):
            raise
        usage = getattr(error, "format_message", None)  # of a wrong option or argument
        if usage is not None:
            return _report(arguments, usage(), BAD_INPUT)
        if isinstance(error, ValueError | OSError):
            return _report(arguments, _text(error), BAD_INPUT)
        if isinstance(error, FailedRun):
            return _report(arguments, str(error), FAILED)
        raise


def _empty(arguments: list[str]) -> str | None:
    """Return the first empty argument and where it stands; as a path it would be the current folder."""
    for before, argument in zip([PROGRAM, *arguments], arguments, strict=False):
        if not argument:
            return f"'' behind {before}"
        if argument.startswith("--") and argument.find("=") == len(argument) - 1:
            return f"{argument} with nothing behind it"
    return None


def _text(error: Exception) -> str:
    """Return the message; for a bare operating-system error, the file and the reason."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}." if error.filename else f"{error.strerror}."
    return str(error) or type(error).__name__


def _report(arguments: list[str], message: str, code: int) -> int:
    verbs = [argument for argument in arguments if argument and not argument.startswith("-")][:1]
    if verbs and verbs[0] in GROUPS and len(arguments) > 1 and arguments[1] in GROUPS[verbs[0]]:
        verbs.append(arguments[1])
    message = " ".join(message.split())
    for verb in verbs:
        message = message.removeprefix(f"{verb}: ")
    line = " ".join([PROGRAM, *verbs]) + ": " + message
    console(stderr=True).print(line, markup=False, soft_wrap=True)
    return code
