"""Common parts of all programs on Drake's solvers: a program, options, and a quiet log."""

import contextlib
import logging
from collections.abc import Iterator, Mapping
from typing import Any

from pydrake.solvers import MathematicalProgram, SolverId, SolverOptions


def new_program() -> Any:
    """Return a MathematicalProgram.

    Its type is `Any`, because the stubs' array types do not admit NumPy's own.
    """
    return MathematicalProgram()


def solver_options(options: Mapping[SolverId, Mapping[str, float | int | str]]) -> Any:
    """Return Drake's SolverOptions from options by solver and name."""
    result = SolverOptions()
    for solver, entries in options.items():
        for name, value in entries.items():
            result.SetOption(solver, name, value)
    return result


class _ExpectedEarlyEnds(logging.Filter):
    """Filter that drops Drake's warnings while `muted`."""

    muted = False

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether the record passes."""
        return not self.muted or record.levelno >= logging.ERROR


_FILTER = _ExpectedEarlyEnds()
logging.getLogger("drake").addFilter(_FILTER)


@contextlib.contextmanager
def expected_early_ends() -> Iterator[None]:
    """Mute Drake's log below ERROR: an iteration limit that the caller handles is no warning.

    It uses a filter, because setting the logger's level empties every logger's cache at each solve.
    """
    before, _FILTER.muted = _FILTER.muted, True
    try:
        yield
    finally:
        _FILTER.muted = before
