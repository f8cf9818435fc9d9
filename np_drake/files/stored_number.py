"""Numbers of a file that this project wrote: text is none, though it may be read as one."""

from collections.abc import Iterator
from typing import Any

import numpy as np


def stored_numbers(value: Any, what: str) -> np.ndarray:
    """Return a stored number, or nested lists of numbers, as an array; what is null is NaN.
    Raises: ValueError: one line, if anything else is among them.
    """
    wrong = next(
        (
            one
            for one in _leaves(value)
            if isinstance(one, bool) or not isinstance(one, int | float)
        ),
        None,
    )
    if wrong is not None:
        raise ValueError(
            f"{what} must be {_numbers(value)}; got {wrong!r:.40}. Diagnose again, or mend "
            f"the file."
        )
    try:
        return np.array(value, float)
    except (ValueError, OverflowError):
        raise ValueError(
            f"{what} must be a rectangle of numbers. Diagnose again, or mend the file."
        ) from None


def _numbers(value: Any) -> str:
    return "numbers" if isinstance(value, list | tuple) else "a number"


def _leaves(value: Any) -> Iterator[Any]:
    if isinstance(value, list | tuple):
        for one in value:
            yield from _leaves(one)
    elif value is not None:
        yield value
