"""Cases in processes of this machine, by joblib; a process that dies costs only the case that
killed it.
"""

import re
import threading
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from diagrams.batch.failed_run import FailedRun


class DeadProcess(FailedRun):
    """Loss of a case with the process that worked on it, twice: out of memory, a fault in native
    code, or an exit.
    """


def as_they_finish(
    work: Callable[[Any], Any], cases: Sequence[Any], jobs: int
) -> Iterator[tuple[int, Any]]:
    """Yield (number of the case, what `work` returns, or DeadProcess), in the order in which they
    finish.

    The work never runs in this process. joblib gives up all that it has taken when a process dies,
    at most twice as many cases as there are jobs: these run once more, each in a process of its
    own, and what dies again is lost.

    Args:
        work: function of a case alone; what it raises ends all.
    """
    waiting = iter(enumerate(cases))
    suspects: dict[int, Any] | None = None
    while suspects is None or suspects:
        suspects, _ = yield from _until_one_dies(work, waiting, jobs)
        for suspect in sorted(suspects.items()):
            guilty, reason = yield from _until_one_dies(work, iter([suspect]), 1)
            yield from ((number, DeadProcess(reason)) for number in guilty)


def _until_one_dies(
    work: Callable[[Any], Any], waiting: Iterator[tuple[int, Any]], jobs: int
) -> Generator[tuple[int, Any], None, tuple[dict[int, Any], str]]:
    """Take numbered cases from `waiting` until none is left or a process dies.

    Returns: the cases that were taken and have no outcome, by number, and what is known about the
    process's end.
    """
    from joblib import Parallel, delayed, parallel_config  # takes a while: not where nothing is run

    # Of processes that have grown and are replaced between two cases, and of a campaign that ends
    # early.
    warnings.filterwarnings("ignore", module="joblib")
    taken: dict[int, Any] = {}

    def tasks() -> Iterator[Any]:
        for number, case in waiting:
            taken[number] = case
            yield delayed(_numbered)(work, number, case)

    with parallel_config("loky", inner_max_num_threads=1):
        parallel = Parallel(
            max(
                jobs, 2
            ),  # of which one idles where jobs is 1: Parallel(1) would work in this process
            pre_dispatch=jobs,
            batch_size=1,
            max_nbytes=None,
            return_as="generator_unordered",
        )
    outcomes = parallel(tasks())
    try:
        for number, value in outcomes:
            del taken[number]
            yield number, value
    except BrokenProcessPool as error:
        return taken, _reason(error)
    finally:
        with _quiet_threads():
            outcomes.close()
    return {}, ""


@contextmanager
def _quiet_threads() -> Iterator[None]:
    """Drop what joblib's managing thread raises: it may look for a case that is gone when its pool
    ends early.
    """
    from joblib.externals.loky.process_executor import _ExecutorManagerThread

    before = threading.excepthook
    threading.excepthook = lambda failed: (
        None if isinstance(failed.thread, _ExecutorManagerThread) else before(failed)
    )
    try:
        yield
    finally:
        threading.excepthook = before


def _numbered(work: Callable[[Any], Any], number: int, case: Any) -> tuple[int, Any]:
    return number, work(case)


def _reason(error: BrokenProcessPool) -> str:
    """Return the exit code where there is one, in one line; a process with an unreadable answer
    counts as dead too.
    """
    text = " ".join(str(error).split())
    code = re.search(r"exit codes? of the workers? (?:are|is) \{(.*?)\}", text)
    why = f"({code[1]}); is the memory exhausted?" if code else f"({text})."
    return f"lost: its process died twice {why}"
