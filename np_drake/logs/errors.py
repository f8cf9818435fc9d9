"""Error of a reader whose log is not usable, and the place that it names."""

import contextlib
from collections.abc import Iterator
from typing import Any


class LogError(ValueError):
    """One line with file, column, row (1 is the first data row; line counts the header) and the
    remedy.
    """


def optional_package(module: str, path: object, needs: str) -> Any:
    """Return the package of a module that an extra of np_drake installs.

    Args:
        path: of the file for which it is needed, for the message.
    Raises: LogError: where it is not installed.
    """
    try:
        return __import__(module)
    except ImportError as error:
        raise LogError(f"{path}: {needs}") from error


def one_line(error: BaseException) -> str:
    """Return what an error says in one line, without a point at its end; its type where it says
    nothing.
    """
    return " ".join((str(error) or type(error).__name__).split())[:200].rstrip(".")


@contextlib.contextmanager
def refusing_damage(path: object, what: str, remedy: str) -> Iterator[None]:
    """Make a refusal of whatever a library raises where a file is damaged.

    Args:
        what: the file must be, whole.
    Raises: LogError, OSError: as they are raised; LogError: in place of all others.
    """
    try:
        yield
    except (LogError, OSError):
        raise
    except Exception as error:
        raise LogError(f"{path}: must be a whole {what}; {one_line(error)}. {remedy}") from error


def place(
    path: object, *, column: str | None = None, row: int | None = None, header_lines: int = 1
) -> str:
    """Return text like 'flight.csv, column vx, row 57 (line 58)'.

    Args:
        row: counts from 0 as arrays do.
        header_lines: lines before the first row, 0 where the file has no lines.
    """
    text = str(path)
    if column is not None:
        text += f", column {column}"
    if row is not None:
        text += f", row {row + 1}" + (f" (line {row + 1 + header_lines})" if header_lines else "")
    return text
