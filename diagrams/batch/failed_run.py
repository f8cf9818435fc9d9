"""Error of a run with good input that failed, and errors as one line of text."""

import traceback
from pathlib import Path


class FailedRun(RuntimeError):
    """Failure of a run, in one line for people: who failed, when, and why."""


def require(condition: bool, otherwise: str) -> None:
    """Check a condition of the user's input.

    Raises: ValueError: with the line `otherwise`, where it does not hold.
    """
    if not condition:
        raise ValueError(otherwise)


def one_line(error: Exception) -> str:
    """Return what went wrong, and where if the error was not expected."""
    text = " ".join(str(error).split()) or "no message"
    foreseen = (
        isinstance(error, FailedRun | ValueError | OSError)
        and type(error) is not UnicodeDecodeError
    )
    if foreseen or error.__traceback__ is None:
        return text
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {text} ({Path(last.filename).name}:{last.lineno})"
