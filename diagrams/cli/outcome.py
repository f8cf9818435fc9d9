"""Outcome of a run: an exit code and, for every failure, one line on stderr; the one place that
catches all errors.
"""

import errno
import os
import traceback
from pathlib import Path

import typer

from diagrams.batch.failed_run import FailedRun, one_line
from diagrams.cli.output import console
from diagrams.cli.reproduce import STUDIES, VERB
from np_drake.files.atomic_file import FULL
from np_drake.files.input_file import guard_inputs
from np_drake.files.interruption import Ended, last_signal, line

PROGRAM = "np-drake"
BAD_INPUT, FAILED, FAULT, INTERRUPTED = 2, 1, 70, 130
DEBUG = "--debug"  # anywhere on the command line
CASE_FILES = ("vehicle.yaml", "train_*", "heldout*")  # that a verb reads of a case folder
OUTPUTS = ("--out", "--json", "--markdown", "--mcap")  # options whose file is written
REPORT = (
    "Please report it with this line and the command to the maintainers; --debug shows the "
    "traceback"
)


def run_app(app: typer.Typer, arguments: list[str]) -> int:
    """Run an application and return its exit code; every failure is one line on stderr."""
    debug = DEBUG in arguments or bool(os.environ.get("NP_DRAKE_TRACEBACK"))
    arguments = [argument for argument in arguments if argument != DEBUG]
    empty = _empty(arguments)
    if empty is not None:
        say = (
            f"an argument must not be empty; got {empty}. Name a file, a folder or a value, "
            f"or leave it out."
        )
        return _report(app, arguments, say, BAD_INPUT)
    try:
        with guard_inputs(inputs_of(arguments)):
            code = app(arguments, prog_name=PROGRAM, standalone_mode=False)
        return (
            _report(app, arguments, "interrupted.", code) if code == INTERRUPTED else int(code or 0)
        )
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else FAILED
    except (
        BaseException
    ) as error:  # MemoryError, RecursionError and panics of native code among them
        if debug:
            traceback.print_exc()
        return _report(app, arguments, *_line_of(error))


def inputs_of(arguments: list[str]) -> list[Path]:
    """Return the files that are named on the command line, and those of case folders, but for
    options that write.
    """
    before = [PROGRAM, *arguments]
    found: list[Path] = []
    for option, argument in zip(before, arguments, strict=False):
        name, _, value = (
            argument.partition("=") if argument.startswith("--") else ("", "", argument)
        )
        if not value or option in OUTPUTS or name in OUTPUTS:
            continue
        if os.path.isdir(value):
            found += _case_files(Path(value))
        elif os.path.exists(value):
            found.append(Path(value))
    return found


def _case_files(folder: Path) -> list[Path]:
    """Return the files of a case folder, or of all case folders in a folder; processes of their own
    may read them.
    """
    return [
        path for name in CASE_FILES for depth in ("", "*/") for path in folder.glob(depth + name)
    ]


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


def _empty(arguments: list[str]) -> str | None:
    """Return the first empty argument and where it stands; as a path it would be the current
    folder.
    """
    for before, argument in zip([PROGRAM, *arguments], arguments, strict=False):
        if not argument:
            return f"'' behind {before}"
        if argument.startswith("--") and argument.find("=") == len(argument) - 1:
            return f"{argument} with nothing behind it"
    return None


def text_of(error: Exception) -> str:
    """Return the message; for a bare operating-system error, the file and the reason."""
    if isinstance(error, OSError) and error.strerror:
        remedy = (
            " Free some room, or choose another folder."
            if error.errno in (*FULL, errno.EFBIG)
            else ""
        )
        return f"{error.filename or 'writing'}: {error.strerror}.{remedy}"
    return str(error) or type(error).__name__


def _report(app: typer.Typer, arguments: list[str], message: str, code: int) -> int:
    verbs = [argument for argument in arguments if argument and not argument.startswith("-")][:1]
    groups = {group.name: group.typer_instance for group in app.registered_groups}
    within = groups.get(verbs[0]) if verbs else None
    if within is not None and len(arguments) > 1:
        verbs += [
            command.name for command in within.registered_commands if command.name == arguments[1]
        ]
    if verbs == [VERB] and arguments[1:2] and arguments[1] in STUDIES:
        verbs.append(arguments[1])
    message = " ".join(message.split())
    for verb in verbs:
        message = message.removeprefix(f"{verb}: ")
    text = " ".join([PROGRAM, *verbs]) + ": " + message
    console(stderr=True).print(text, markup=False, soft_wrap=True)
    return code
