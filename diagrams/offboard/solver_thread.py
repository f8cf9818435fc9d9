"""Where the controller is stepped: in a thread, or at once."""

from collections.abc import Callable
from queue import Empty, Queue, SimpleQueue
from threading import Thread
from typing import Protocol

from diagrams.offboard.companion import Answer

Step = Callable[[], Answer]


class Worker(Protocol):
    """Steps the controller, one step at a time."""

    def submit(self, step: Step, now: float) -> None:
        """Begin a step; nothing is begun while the last goes on.

        Args:
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
    """Steps in a thread, so that a solve that takes too long stops nothing else, nor the end of the
    process.
    """

    def __init__(self) -> None:
        self._steps: SimpleQueue[Step | None] = SimpleQueue()
        self._answers: Queue[Answer | Exception] = Queue()
        self._is_busy = False
        Thread(target=self._work, name="companion", daemon=True).start()

    def submit(self, step: Step, now: float) -> None:
        """Begin a step; see `Worker`."""
        if not self._is_busy:
            self._is_busy = True
            self._steps.put(step)

    def answer(self, now: float, patience: float) -> Answer | None:
        """Return an answer; see `Worker`."""
        if not self._is_busy:
            return None
        try:
            found = (
                self._answers.get(timeout=patience) if patience > 0 else self._answers.get_nowait()
            )
        except Empty:
            return None
        self._is_busy = False
        if isinstance(found, Exception):
            raise found
        return found

    def close(self) -> None:
        """End it, without waiting for a step that hangs."""
        self._steps.put(None)

    def _work(self) -> None:
        while (step := self._steps.get()) is not None:
            try:
                self._answers.put(step())
            except Exception as error:
                self._answers.put(error)


class AtOnce(Worker):
    """Steps at once, in the time of a simulation.

    Args:
        takes: time that a step takes by the simulation's clock, at a time [s].
    """

    def __init__(self, takes: Callable[[float], float] = lambda now: 0.0):
        self._takes = takes
        self._pending: tuple[float, Step] | None = None

    def submit(self, step: Step, now: float) -> None:
        """Begin a step; see `Worker`."""
        if self._pending is None:
            self._pending = (now + self._takes(now), step)

    def answer(self, now: float, patience: float) -> Answer | None:
        """Return an answer; see `Worker`."""
        if self._pending is None or now + patience < self._pending[0]:
            return None
        _, step = self._pending
        self._pending = None
        return step()

    def close(self) -> None:
        """End it."""
