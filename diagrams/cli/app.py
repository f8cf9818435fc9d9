"""The verbs of `np-drake`, and the outcome of a run: an exit code and, for every failure, one line
on stderr.
"""

import errno
import os
import traceback
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Option
from typer.core import TyperGroup

from diagrams.batch.run import FailedRun, one_line, require
from diagrams.cli import reproduce
from diagrams.cli.verb import EPILOG, HELP, Verbs, console, discard_output, say
from np_drake.files.file_access import FULL, guard_inputs
from np_drake.files.interruption import Ended, last_signal, line

PROGRAM = "np-drake"
BAD_INPUT = 2
FAILED = 1
FAULT = 70
INTERRUPTED = 130
DEBUG = "--debug"  # anywhere on the command line
OUTPUTS = ("--out", "--json", "--markdown", "--mcap")  # options whose file is written
REPORT = (
    "Please report it with this line and the command to the maintainers; --debug shows the "
    "traceback"
)

VERBS = {  # verb: module of diagrams.cli, name there, summary; modules are loaded on use
    "demo": ("demo", "demo", "Fly, learn, fly again, diagnose, correct the simulator: one page."),
    "fly": ("fly", "fly", "Simulate an experiment with one controller, or with several."),
    "certify": ("certify", "certify", "Where may a vehicle be flown, and how sure is that?"),
    "node": ("fly", "node", "Fly a vehicle through its autopilot, by MAVLink."),
    "train": ("train", "train", "Train a predictor from flight logs."),
    "evaluate": ("train", "evaluate", "Score predictors on flights."),
    "import": ("import_logs", "import_logs", "Import flight logs of other formats."),
    "doctor": ("diagnose", "doctor", "Is a flight log usable, and what can it tell?"),
    "identify": ("identify", "identify", "Identify a vehicle from its flights: a vehicle file."),
    "diagnose": ("diagnose", "diagnose", "What a simulator lacks, from flight logs: a report."),
    "reproduce": ("reproduce", "reproduce", "Make a table of the paper or of the docs anew."),
    "vehicle": ("vehicle", "vehicle", "Vehicle files: new, list, show."),
    "export": ("vehicle", "export", "Write a vehicle as SDF (Gazebo, Drake) or MJCF (MuJoCo)."),
    "bench": ("reproduce", "bench", "Compare speeds, measured in one run."),
    "challenge": ("challenge", "challenge", "Withheld-effect challenge sets: make, solve, score."),
}
GROUPS = ("reproduce", "vehicle", "challenge")  # behind whose name another stands


class _Lazy(TyperGroup):
    """Group of the verbs, whose modules take seconds to load."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the verbs."""
        return list(VERBS)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the summary of every verb."""
        with formatter.section("Commands"):
            formatter.write_dl([(verb, summary) for verb, (_, _, summary) in VERBS.items()])

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of a verb; None where there is none."""
        if cmd_name not in VERBS:
            return None
        module, name, _ = VERBS[cmd_name]
        verb = getattr(import_module(f"diagrams.cli.{module}"), name)
        if not isinstance(verb, typer.Typer):
            body = verb
            verb = Verbs(add_completion=False)
            rest = cmd_name == "reproduce"  # what follows the study's name is the study's
            verb.command(
                cmd_name,
                context_settings=HELP
                | {"allow_extra_args": rest, "allow_interspersed_args": not rest},
            )(body)
        command = typer.main.get_command(verb)
        command.name = cmd_name
        return command


app = Verbs(
    name=PROGRAM,
    cls=_Lazy,
    help="Neural Predictor, payload filter and MPC for a quadrotor with a payload, on Drake.",
    epilog=EPILOG,
)


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


def run_app(app: typer.Typer, arguments: list[str]) -> int:
    """Run an application and return its exit code; every failure is one line on stderr."""
    debug = DEBUG in arguments or bool(os.environ.get("NP_DRAKE_TRACEBACK"))
    arguments = [argument for argument in arguments if argument != DEBUG]
    try:
        _require_words(arguments)
        with guard_inputs(inputs_of(arguments)):
            code = app(arguments, prog_name=PROGRAM, standalone_mode=False)
        if code == INTERRUPTED:
            raise KeyboardInterrupt
        return int(code or 0)
    except BrokenPipeError:  # of who reads the help
        discard_output()
        return 0
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else FAILED
    except (
        BaseException
    ) as error:  # MemoryError, RecursionError and panics of native code among them
        if debug:
            traceback.print_exc()
        message, code = _line_of(error)
        _report(arguments, " ".join(message.split()))
        return code


def _require_words(arguments: list[str]) -> None:
    """Check that no argument is empty, as a path it would be the current folder, and that no option
    stands for a file that is written.
    """
    for before, argument in pairwise([PROGRAM, *arguments]):
        require(
            argument and (not argument.startswith("--") or argument.find("=") != len(argument) - 1),
            f"an argument must not be empty; got '{argument}' behind {before}. Name a file, a "
            f"folder or a value, or leave it out.",
        )
        require(
            before not in OUTPUTS or not argument.startswith("--"),
            f"{before}: must be followed by a file or a folder; got the option {argument}.",
        )


def inputs_of(arguments: list[str]) -> list[Path]:
    """Return the files that are named on the command line, but for options that write."""
    files: list[Path] = []
    for before, argument in pairwise([PROGRAM, *arguments]):
        name, _, value = argument.rpartition("=") if argument[:2] == "--" else ("", "", argument)
        if before in OUTPUTS or name in OUTPUTS:
            continue
        if os.path.isfile(value) or os.path.islink(value):
            files.append(Path(value))
    return files


def _line_of(error: BaseException) -> tuple[str, int]:
    """Return what is said of an error, and the exit code."""
    if (number := last_signal()) is not None or isinstance(error, KeyboardInterrupt | Ended):
        number = number or INTERRUPTED - 128
        return line(number), 128 + number
    usage = getattr(error, "format_message", None)  # of a wrong option or argument
    if usage is not None:
        return usage(), BAD_INPUT
    if isinstance(error, ValueError | OSError):
        return text_of(error), BAD_INPUT
    if isinstance(error, FailedRun):
        return str(error), FAILED
    if isinstance(error, typer.Abort) and isinstance(error.__cause__, Exception):
        error = error.__cause__  # an EOFError, which typer takes for the end of the terminal
    what = one_line(error) if isinstance(error, Exception) else f"{type(error).__name__}: {error}"
    return f"internal error: {what}. {REPORT}.", FAULT


def text_of(error: Exception) -> str:
    """Return the message; for a bare operating-system error, the file and the reason."""
    if isinstance(error, OSError) and error.strerror:
        full = error.errno in (*FULL, errno.EFBIG)
        remedy = " Free some room, or choose another folder." if full else ""
        return f"{error.filename or 'writing'}: {error.strerror}.{remedy}"
    return str(error) or type(error).__name__


def _report(arguments: list[str], message: str) -> None:
    """Print a line that begins with the verb."""
    words = [argument for argument in arguments if argument and not argument.startswith("-")]
    verbs = words[: 2 if words[:1] and words[0] in GROUPS else 1]
    if verbs[:1] == ["reproduce"] and verbs[-1] not in reproduce.STUDIES:
        verbs = verbs[:1]
    for verb in verbs:
        message = message.removeprefix(f"{verb}: ")
    console(stderr=True).print(f"{' '.join([PROGRAM, *verbs])}: {message}", soft_wrap=True)
