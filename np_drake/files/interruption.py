"""Signals that end a run: one line on stderr and exit code 128 + number, also while modules are
being imported.
"""

import os
import signal
from types import FrameType
from typing import NoReturn

ENDING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
_seen: list[int] = []  # numbers of the signals of this process


class Ended(BaseException):
    """End of a run by a signal other than that of Ctrl-C, which is a KeyboardInterrupt."""


def line(number: int) -> str:
    """Return what is said of a signal."""
    return "interrupted." if number == signal.SIGINT else f"ended by {signal.Signals(number).name}."


def end_at_once() -> None:
    """Let signals end the process at once: nothing is open yet, and an exception would end in half
    an import.
    """
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:  # nohup
            signal.signal(number, _leave)


def end_in_order() -> None:
    """Let the first signal raise in the main thread, so that temporary files and processes are
    cleared away; a second one ends at once. It holds for signals that ended the process at once.
    """
    _seen.clear()
    for number in ENDING:
        if signal.getsignal(number) is _leave:
            signal.signal(number, _raise)


def last_signal() -> int | None:
    """Return the number of the last signal since `end_in_order`; None where there was none.

    An exception that is raised inside an import or a callback may come out as another one.
    """
    return _seen[-1] if _seen else None


def _leave(number: int, frame: FrameType | None) -> NoReturn:
    os.write(2, f"np-drake: {line(number)}\n".encode())
    os._exit(128 + number)


def _raise(number: int, frame: FrameType | None) -> NoReturn:
    _seen.append(number)
    end_at_once()
    raise KeyboardInterrupt if number == signal.SIGINT else Ended(line(number))
