"""One function on many cases in several processes; a process that dies costs only the case that killed it."""

import dataclasses as dc
import re
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from diagrams.batch.failed_run import FailedRun

# Small matrices are slower on several threads, and the processes run side by side.
ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
Numbered = tuple[int, Any]  # a case and its place in the sequence


class DeadProcess(FailedRun):
    """Loss of a case with the process that worked on it, twice: out of memory, a fault in native code, or an exit."""


@dc.dataclass(frozen=True)
class Outcome:
    """Outcome of a case: a value, or the error that it ended with."""

    value: Any = None
    error: Exception | None = None

    def unwrap(self) -> Any:
        """Return the value.

        Raises: the error, where the case ended with one.
        """
        if self.error is not None:
            raise self.error
        return self.value


def in_order(
    work: Callable[[Any], Any],
    cases: Sequence[Any],
    *,
    jobs: int,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Any]:
    """Return [work(case), …] from `jobs` processes.

    Raises: what `work` raises; DeadProcess: where a process died.
    """
    values: list[Any] = [None] * len(cases)
    for done, (number, outcome) in enumerate(as_they_finish(work, cases, jobs=jobs), start=1):
        values[number] = outcome.unwrap()
        on_progress(done, len(cases))
    return values


def as_they_finish(
    work: Callable[[Any], Any], cases: Sequence[Any], *, jobs: int, isolated: bool = False
) -> Iterator[tuple[int, Outcome]]:
    """Yield (number of the case, its outcome), in the order in which they finish.

    Cases whose process dies are run once more, each in a process of its own; what dies again is lost.

    Args:
        jobs: processes. With one, the cases run in this process, which a case can take down with it.
        isolated: never work in this process.
    """
    if jobs == 1 and not isolated:
        for number, case in enumerate(cases):
            try:
                yield number, Outcome(work(case))
            except Exception as error:
                yield number, Outcome(error=error)
        return
    waiting = deque(enumerate(cases))
    while waiting:
        suspects, _ = yield from _pool(work, waiting, jobs)
        for suspect in suspects:  # which of them killed its process shows when each has one to itself
            guilty, reason = yield from _pool(work, deque([suspect]), 1)
            yield from ((number, Outcome(error=DeadProcess(reason))) for number, _ in guilty)


def _pool(
    work: Callable[[Any], Any], waiting: deque[Numbered], jobs: int
) -> Generator[tuple[int, Outcome], None, tuple[list[Numbered], str]]:
    """Take cases from `waiting` until none is left or a process dies, at most as many at once as there are processes.

    Returns: the cases that were in work when a process died, and what is known about its end.
    """
    from joblib.externals.loky import ProcessPoolExecutor  # takes a while: not where one process is enough

    # A process that has grown is replaced between two cases, which loses none.
    warnings.filterwarnings("ignore", "A worker stopped while some jobs")
    pool = ProcessPoolExecutor(max_workers=min(jobs, len(waiting)), env=ONE_THREAD)
    running: dict[Future, Numbered] = {}
    suspects: list[Numbered] = []
    reason = ""
    try:
        while running or (waiting and not suspects):
            while waiting and len(running) < jobs and not suspects:
                number, case = waiting.popleft()
                running[pool.submit(work, case)] = (number, case)
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                number, case = running.pop(future)
                error = future.exception()
                if isinstance(error, BrokenProcessPool):
                    suspects.append((number, case))
                    reason = _reason(error)
                elif isinstance(error, Exception):
                    yield number, Outcome(error=error)
                else:
                    yield number, Outcome(future.result())
        return sorted(suspects, key=lambda suspect: suspect[0]), reason
    finally:
        pool.shutdown(wait=True, kill_workers=bool(running or suspects))


def _reason(error: BrokenProcessPool) -> str:
    """Return the exit code where there is one, in one line; a process with an unreadable answer counts as dead too."""
    text = " ".join(str(error).split())
    code = re.search(r"exit codes? of the workers? (?:are|is) \{(.*?)\}", text)
    why = f"({code[1]}); is the memory exhausted?" if code else f"({text})."
    return f"lost: its process died twice {why}"
