"""Where the controller is stepped: in a thread, or at once."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol

from diagrams.offboard.companion import Answer

Step = Callable[[], Answer]


class Worker(Protocol):
    """Steps the controller, one step at a time."""

    def submit(self, step: Step, now: float) -> bool:
        """Begin a step, and return whether it is begun; not while the last goes on.

        Args:
            step: of the controller.
            now: time [s].
        """

    def answer(self, now: float, patience: float) -> Answer | None:
        """Return the answer of the last step, once; None where there is none yet.

        Args:
            now: time [s].
            patience: longest time to wait for it [s].
        Raises: whatever the step has raised.
        """

    def close(self) -> None:
        """End it."""


class SolverThread(Worker):
    """Steps in a thread, so that a solve that takes too long stops nothing else."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="companion")
        self._pending: Future[Answer] | None = None

    def submit(self, step: Step, now: float) -> bool:
        """Begin a step; see `Worker`."""
        if self._pending is not None:
            return False
        self._pending = self._pool.submit(step)
        return True

    def answer(self, now: float, patience: float) -> Answer | None:
        """Return an answer; see `Worker`."""
        if self._pending is None:
            return None
        try:
            found = self._pending.result(timeout=patience)
        except TimeoutError:
            if not self._pending.done():
                return None
            raise
        finally:
            if self._pending.done():
                self._pending = None
        return found

    def close(self) -> None:
        """End it, without waiting for a step that hangs."""
        self._pool.shutdown(wait=False, cancel_futures=True)


class AtOnce(Worker):
    """Steps at once, in the time of a simulation.

    Args:
        takes: time that a step takes by the simulation's clock, at a time [s].
    """

    def __init__(self, takes: Callable[[float], float] = lambda now: 0.0):
        self._takes = takes
        self._pending: tuple[float, Step] | None = None

    def submit(self, step: Step, now: float) -> bool:
        """Begin a step; see `Worker`."""
        if self._pending is not None:
            return False
        self._pending = (now + self._takes(now), step)
        return True

    def answer(self, now: float, patience: float) -> Answer | None:
        """Return an answer; see `Worker`."""
        if self._pending is None or now + patience < self._pending[0]:
            return None
        _, step = self._pending
        self._pending = None
        return step()

    def close(self) -> None:
        """End it."""
