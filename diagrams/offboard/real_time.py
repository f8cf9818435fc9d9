"""Real time of a node: ticks by the clock, until its flight is over or somebody ends it."""

import signal
import time
from collections.abc import Callable
from types import FrameType

from diagrams.offboard.node import Node
from np_drake.offboard.phases import Phase

PATIENCE = 0.7  # share of a tick that a solve may take [1]; source: own choice
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LOOKS = 0.5  # between two calls of the monitor [s]


class Ended:
    """Whether the user has asked for the end, by SIGINT, SIGTERM or the end of the terminal.

    A second SIGINT ends at once. Use it as a context manager.
    """

    def __init__(self) -> None:
        self.asked = False

    def __enter__(self) -> "Ended":
        self._before = {number: signal.signal(number, self._take) for number in SIGNALS}
        return self

    def __exit__(self, *_: object) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)

    def _take(self, number: int, frame: FrameType | None) -> None:
        if self.asked and number == signal.SIGINT:
            raise KeyboardInterrupt
        self.asked = True


def fly(
    node: Node,
    *,
    wait: float = float("inf"),
    ended: Callable[[], bool] = lambda: False,
    monitor: Callable[[Node, float], None] | None = None,
) -> None:
    """Tick a node in real time until it has stopped; at the end of its motion the autopilot is
    asked to hold its place.

    On a simulated vehicle the time is the vehicle's (`NodeClock`).

    Args:
        wait: longest time until the autopilot hands over, by our clock [s].
        monitor: is shown the node every half a second of our clock, and the time on its reference
            [s].
    """
    period, end = 1 / node.config.offboard.rate, node.config.end
    begin = planned = time.monotonic()
    looked = -float("inf")
    while True:
        while (early := planned - (now := node.clock.read(time.monotonic(), node.listen()))) > 0:
            time.sleep(early)
        node.counts.delays.append(now - planned)
        node.tick(now, PATIENCE * period)
        flown = node.flown_for(now)
        if not node.leaves and (flown >= end or ended()):
            node.leave(now)
        is_idle = node.phase in (Phase.WAITING, Phase.READY)
        if node.phase is Phase.STOPPED or (
            is_idle and (node.leaves or time.monotonic() - begin > wait)
        ):
            return
        if monitor is not None and time.monotonic() - looked >= LOOKS:
            looked = time.monotonic()
            monitor(node, flown)
        planned += period
        if (behind := node.clock.read(time.monotonic(), []) - planned) > period:
            skipped = int(behind / period)
            node.counts.skipped += skipped
            planned += skipped * period
