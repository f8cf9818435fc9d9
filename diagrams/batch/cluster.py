"""Cases on a Dask cluster (optional extra `cluster`, imported on use)."""

import asyncio
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.processes import DeadProcess

PATIENCE = 10.0  # until a scheduler that does not answer counts as unreachable [s]


def require_cluster(address: str) -> None:
    """Check before long work that a cluster takes cases.

    Raises: ValueError: without the extra, where no scheduler answers, or where a worker has several
    threads.
    """
    with client(address) as connected:
        _require_one_thread(connected)


def _require_one_thread(connected: Any) -> None:
    """Check that every worker has one thread: cases would share its processor time, and all die
    with one of them.
    """
    for worker, threads in connected.nthreads().items():
        if threads > 1:
            raise ValueError(
                f"--scheduler: workers must have one thread each; {worker} has {threads}. "
                "Start them with --nthreads 1 --nworkers N."
            )


@contextmanager
def client(address: str, patience: float = PATIENCE) -> Iterator[Any]:
    """Yield a `distributed.Client`.

    Args:
        patience: until it counts as unreachable [s].

    Raises: ValueError: without the extra, or where no scheduler answers.
    """
    if find_spec("distributed") is None:
        raise ValueError(
            "--scheduler: its packages must be installed; pip install 'np_drake[cluster]'."
        )
    from distributed import Client

    try:
        # A client that never connects leaves a thread, and stalls whichever thread collects it.
        with ThreadPoolExecutor(1) as pool:  # where no loop runs, as one does in a notebook
            pool.submit(asyncio.run, _reach(address, patience)).result()
        connected = Client(address, timeout=patience, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:  # unreachable, or no address at all
        raise ValueError(f"--scheduler: no Dask scheduler answers at {address!r}.") from error
    with connected:
        yield connected


async def _reach(address: str, patience: float) -> None:
    """Connect to the address and close the connection.

    Raises: OSError, ValueError, TypeError: where nothing listens, or does not answer within
    `patience` [s].
    """
    from distributed.comm import connect

    # Dask's own limit is for the connection; its handshake waits for ever.
    await (await asyncio.wait_for(connect(address, timeout=patience), patience)).close()


def on_cluster(
    work: Callable[[Any], Any], cases: Sequence[Any], address: str
) -> Iterator[tuple[int, Any]]:
    """Yield (number of the case, what `work` returns, or the error of a lost case), in the order in
    which they finish.

    Dask gives a case whose worker dies to another (`allowed-failures` of its configuration, three
    times at its own default; `retries` of `submit` counts raised errors alone). It then runs once
    more, alone, before it counts as lost. Workers under a nanny come back.
    Raises: ValueError: as `require_cluster`; FailedRun: where the connection to the scheduler is
        lost.
    """
    from distributed import as_completed

    with client(address) as connected:
        _require_one_thread(connected)
        futures = connected.map(work, cases, key="case", pure=False)
        numbers = {future: number for number, future in enumerate(futures)}
        suspects: list[int] = []
        for future in as_completed(futures, loop=connected.loop):
            number, outcome = numbers.pop(future), _outcome(future)
            if isinstance(outcome, DeadProcess):
                suspects.append(number)
            else:
                yield number, outcome
        # Dask reports all cases of a dead worker; run alone, only the one that killed it does so
        # again.
        for number in suspects:
            alone = connected.submit(work, cases[number], pure=False)
            alone.exception()  # waits for its end
            yield number, _outcome(alone)


def _outcome(future: Any) -> Any:
    """Return the value of a future that has ended, or the error with which its case is lost.

    Raises: FailedRun: where the scheduler gave it up.
    """
    from distributed import KilledWorker

    if future.status in ("lost", "pending"):
        return DeadProcess("lost: its worker died with the answer, twice.")
    if future.status not in ("finished", "error"):
        raise FailedRun(
            f"the scheduler gave a case up ({future.status}); is the cluster still there?"
        )
    try:
        return future.result()
    except KilledWorker:
        return DeadProcess("lost: its workers died, one after the other; is the memory exhausted?")
    except Exception as error:  # a worker that cannot load the work
        return error
