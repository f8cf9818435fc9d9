"""What a run raises that had good input and failed all the same, and how an error is told in one line."""

import traceback
from pathlib import Path


class FailedRun(RuntimeError):
    """One line for people: who failed, when, and why."""


def one_line(error: Exception) -> str:
    """What went wrong, and where if it was not foreseen."""
    text = " ".join(str(error).split()) or "no message"
    foreseen = isinstance(error, FailedRun | ValueError | OSError) and type(error) is not UnicodeDecodeError
    if foreseen or error.__traceback__ is None:
        return text
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {text} ({Path(last.filename).name}:{last.lineno})"
