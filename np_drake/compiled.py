"""Compilation of inner loops, and the compiled functions that many of them share."""

import logging
import sys
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core import caching, event

_log = logging.getLogger(__name__)


NOTICE = "compiling inner loops, once on this machine; a minute or two."
FLOORS = ("np_drake", "systems", "diagrams")  # packages whose loops these are


class Notice(event.Listener):
    """Says once why the user waits, where loops of this project are compiled.

    On a terminal it is a warning; elsewhere, where stderr is for errors alone, information, which
    the verbs print.
    """

    def __init__(self) -> None:
        self._shown = False

    def on_start(self, event: Any) -> None:
        """Take note that a function is being compiled."""
        module = event.data["dispatcher"].py_func.__module__
        if not self._shown and module.partition(".")[0] in FLOORS:
            self._shown = True
            _log.log(logging.WARNING if sys.stderr.isatty() else logging.INFO, NOTICE)

    def on_end(self, event: Any) -> None:
        """Do nothing."""


event.register("numba:compile", Notice())


class Cache(caching.FunctionCache):
    """Cache of one compiled function, without which it goes on where its files are damaged or the
    disk takes none.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function for a signature; None where there is none, or its files are
        damaged.
        """
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # unpickling damaged bytes raises nearly anything
            _log.debug("cache of %s: %s", self._name, error)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the compiled function, where the disk takes it."""
        try:
            super().save_overload(sig, data)
        except Exception as error:  # it reads the index, which may be damaged
            _log.debug("cache of %s: %s", self._name, error)
            self.disable()


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function compiled, once for all processes; where no cache can be written, once for
    each.
    """
    dispatcher: Any = njit(error_model="numpy")(function)
    try:
        dispatcher._cache = Cache(function)
    except RuntimeError:
        _log.debug("no folder takes the compiled code of %s", function)
    return dispatcher


@compiled
def finite(values):
    """Return whether all entries of a contiguous array of any shape are finite."""
    nothing = 0.0
    for value in values.ravel():
        nothing += 0.0 * value
    return nothing == 0.0


@compiled
def turned(w, x, y, z, a, b, c):
    """Return a vector in B turned to W; the conjugate quaternion turns back."""
    i = y * c - z * b
    j = z * a - x * c
    k = x * b - y * a
    return (
        a + 2 * (w * i + y * k - z * j),
        b + 2 * (w * j + z * i - x * k),
        c + 2 * (w * k + x * j - y * i),
    )


@compiled
def times(M, a, b, c):
    """Return a matrix (3, 3) times a vector, entry by entry."""
    return (
        M[0, 0] * a + M[0, 1] * b + M[0, 2] * c,
        M[1, 0] * a + M[1, 1] * b + M[1, 2] * c,
        M[2, 0] * a + M[2, 1] * b + M[2, 2] * c,
    )
