"""Signals that end a run: one line on stderr and exit code 128 + number, also while modules are
being imported.
"""

import os
import signal
import sys
import threading
from types import FrameType
from typing import Any, NoReturn

ENDING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
PATIENCE = 3  # signals after which a run ends without clearing up
AGAIN = 0.02  # after which a lost signal comes again [s]; own choice
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
    _handle(_leave)


def end_in_order() -> None:
    """Let signals raise in the main thread, so that temporary files and processes are cleared
    away.
    """
    _seen.clear()
    _handle(_raise)
    sys.unraisablehook = _without_signals


def last_signal() -> int | None:
    """Return the number of the last signal since `end_in_order`; None where there was none.

    An exception that is raised inside an import or a callback may come out as another one.
    """
    return _seen[-1] if _seen else None


def raise_again() -> None:
    """Raise for a signal whose exception was lost, as one raised inside a finaliser is; call it as
    work goes on.
    """
    if _seen:
        raise _exception(_seen[-1])


def _without_signals(lost: Any) -> None:
    """Report an exception that nothing can catch; a signal that is lost in a callback or finaliser
    comes again.
    """
    if not isinstance(lost.exc_value, KeyboardInterrupt | Ended) or not _seen:
        sys.__unraisablehook__(lost)
        return
    again = threading.Timer(AGAIN, os.kill, (os.getpid(), _seen.pop()))  # which counts it, once
    again.daemon = True
    again.start()


def _handle(handler) -> None:
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:  # nohup
            signal.signal(number, handler)


def _leave(number: int, frame: FrameType | None) -> NoReturn:
    os.write(2, f"np-drake: {line(number)}\n".encode())
    os._exit(128 + number)


def _raise(number: int, frame: FrameType | None) -> NoReturn:
    _seen.append(number)
    if len(_seen) >= PATIENCE:
        _leave(number, frame)
    raise _exception(number)


def _exception(number: int) -> BaseException:
    return KeyboardInterrupt() if number == signal.SIGINT else Ended(line(number))
