"""Cases on a Dask cluster (optional extra `cluster`, imported on use)."""

import asyncio
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.processes import DeadProcess, Outcome

PATIENCE = 10.0  # until a scheduler that does not answer counts as unreachable [s]


def require_cluster(address: str) -> None:
    """Check before long work that a cluster takes cases.

    Raises: ValueError: without the extra, where no scheduler answers, or where a worker has several threads.
    """
    with client(address) as connected:
        _require_one_thread(connected)


def _require_one_thread(connected: Any) -> None:
    """Check that every worker has one thread: cases would share its processor time, and all die with one of them."""
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
        address: of the scheduler.
        patience: until it counts as unreachable [s].

    Raises: ValueError: without the extra, or where no scheduler answers.
    """
    if find_spec("distributed") is None:
        raise ValueError("--scheduler: its packages must be installed; pip install 'np_drake[cluster]'.")
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

    Raises: OSError, ValueError, TypeError: where nothing listens.
    """
    from distributed.comm import connect

    await (await connect(address, timeout=patience)).close()


def on_cluster(
    work: Callable[[Any], Any], cases: Sequence[Any], address: str
) -> Iterator[tuple[int, Outcome]]:
    """Yield (number of the case, its outcome), in the order in which they finish.

    `work` travels to the scheduler once. Dask gives a case whose worker dies to another (`allowed-failures` of its
    configuration, three times at its own default); it then runs once more alone before it counts as lost. Workers under
    a nanny come back.

    Raises: ValueError: as `require_cluster`; FailedRun: where the connection to the scheduler is lost.
    """
    from distributed import as_completed

    suspects: list[int] = []

    with client(address) as connected:
        _require_one_thread(connected)
        shared = connected.submit(_same, work, pure=False)  # made anew where the worker that holds it dies
        numbers = {
            connected.submit(_call, shared, case, pure=False): number for number, case in enumerate(cases)
        }
        for future in as_completed(list(numbers), loop=connected.loop):
            number, outcome = numbers.pop(future), _outcome(future)
            if isinstance(outcome.error, DeadProcess):
                suspects.append(number)
            else:
                yield number, outcome
        # Dask reports all cases of a dead worker; run alone, only the one that killed it does so again.
        for number in suspects:
            alone = connected.submit(_call, work, cases[number], pure=False)
            alone.exception()  # waits for its end
            yield number, _outcome(alone)


def _same(work: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return work


def _call(work: Callable[[Any], Any], case: Any) -> Any:
    return work(case)


def _outcome(future: Any) -> Outcome:
    from distributed import KilledWorker

    status = future.status
    if status == "finished":
        return Outcome(future.result())
    if status in ("lost", "pending"):
        return Outcome(error=DeadProcess("lost: its worker died with the answer, twice."))
    if status != "error":
        raise FailedRun(f"the scheduler gave a case up ({status}); is the cluster still there?")
    error = future.exception()
    if isinstance(error, KilledWorker):
        return Outcome(
            error=DeadProcess("lost: its workers died, one after the other; is the memory exhausted?")
        )
    return Outcome(error=error)
