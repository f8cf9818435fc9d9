"""Cases in other processes: of this machine by joblib, or of a Dask cluster (extra `cluster`).

A process that dies costs only the case that killed it.
"""

import asyncio
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from diagrams.batch.failed_run import FailedRun

PATIENCE = 10.0  # until a scheduler that does not answer counts as unreachable [s]


def as_they_finish(
    work: Callable[[Any], Any], cases: Sequence[Any], jobs: int
) -> Iterator[tuple[int, Any]]:
    """Yield (number of the case, what `work` returns), in the order in which they finish.

    The work never runs in this process; what it raises ends all. When a process dies, the oldest
    cases run once more, each alone, and what dies again has a FailedRun in place of a value.
    """
    left = dict(enumerate(cases))
    while left:
        try:
            yield from _together(work, left, jobs)
        except BrokenProcessPool:
            for suspect in list(left)[: 2 * jobs]:  # more are not dispatched
                alone = {suspect: left.pop(suspect)}
                try:
                    yield from _together(work, alone, 1)
                except BrokenProcessPool as error:
                    why = " ".join(str(error).split())
                    yield suspect, FailedRun(f"lost: its process died twice; {why}")


def _together(
    work: Callable[[Any], Any], left: dict[int, Any], jobs: int
) -> Iterator[tuple[int, Any]]:
    """Yield what finishes, and take it from the cases that are left."""
    from joblib import Parallel, delayed, parallel_config  # takes a while: not where nothing is run

    # Of processes that have grown and are replaced between two cases, and of a campaign that ends.
    warnings.filterwarnings("ignore", module="joblib")
    tasks = [delayed(_numbered)(work, number, case) for number, case in left.items()]
    with parallel_config("loky", inner_max_num_threads=1):
        parallel = Parallel(
            max(jobs, 2),  # of which one idles where jobs is 1: Parallel(1) would work here
            pre_dispatch=jobs,
            batch_size=1,
            max_nbytes=None,
            return_as="generator_unordered",
        )
    for number, value in parallel(tasks):
        del left[number]
        yield number, value


def _numbered(work: Callable[[Any], Any], number: int, case: Any) -> tuple[int, Any]:
    return number, work(case)


def on_cluster(
    work: Callable[[Any], Any], cases: Sequence[Any], address: str
) -> Iterator[tuple[int, Any]]:
    """Yield as `as_they_finish`; Dask itself tries a case again whose worker dies.

    Raises: ValueError: as `connect`.
    """
    from distributed import KilledWorker, as_completed

    with connect(address) as client:
        futures = client.map(work, cases, pure=False)
        numbers = {future: number for number, future in enumerate(futures)}
        suspects = []
        for future in as_completed(futures, loop=client.loop):
            try:
                yield numbers[future], future.result()
            except KilledWorker:
                suspects.append(numbers[future])
        for number in suspects:  # alone, only the one that killed its workers does so again
            try:
                yield number, client.submit(work, cases[number], pure=False).result()
            except KilledWorker as error:
                yield number, FailedRun(f"lost: its workers died; {error}")


@contextmanager
def connect(address: str, patience: float = PATIENCE) -> Iterator[Any]:
    """Yield a `distributed.Client`.

    Raises: ValueError: without the extra, or where no scheduler answers within `patience` [s], or
        where a worker has several threads, of which all cases die with one.
    """
    if find_spec("distributed") is None:
        raise ValueError(
            "--scheduler: its packages must be installed; pip install 'np_drake[cluster]'."
        )
    from distributed import Client
    from distributed.comm import connect as reach

    async def answers() -> None:  # Dask's own limit does not hold for its handshake
        await (await asyncio.wait_for(reach(address, timeout=patience), patience)).close()

    try:
        asyncio.run(answers())  # first: a client that never connects leaves a thread
        connected = Client(address, timeout=patience, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:  # unreachable, or no address at all
        raise ValueError(f"--scheduler: no Dask scheduler answers at {address!r}.") from error
    with connected:
        if max(connected.nthreads().values(), default=1) > 1:
            raise ValueError(
                "--scheduler: workers must have one thread each; start them with --nthreads 1."
            )
        yield connected
