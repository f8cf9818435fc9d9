"""Simulators that are drawn once and used again."""

from collections.abc import Callable

import numpy as np

from diagrams.gym.simulator import TrackingSimulator
from diagrams.loop.flight import FlightConfig

Draw = Callable[[np.random.Generator], FlightConfig]


class SimulatorPool:
    """At most `size` simulators, each built when it is first asked for and kept.

    Drake never frees a diagram with callbacks in Python, 1.5 to 2.5 MB each. A pool bounds their number whatever the
    number of episodes. The configurations are drawn at once, so that an impossible one is refused before any episode.

    Args: make: simulator of a configuration.   seed: of the draws, each of which has a generator of its own.
    Raises: ValueError: on a size below one or an impossible configuration.
    """

    def __init__(
        self, draw: Draw, make: Callable[[FlightConfig], TrackingSimulator], *, size: int, seed: int = 0
    ):
        if size < 1:
            raise ValueError(f"SimulatorPool: simulators must be at least 1; got {size}.")
        self.configs = [draw(np.random.default_rng([seed, i])).check() for i in range(size)]
        self._make = make
        self._built: dict[int, TrackingSimulator] = {}

    def __len__(self) -> int:
        return len(self.configs)

    def __getitem__(self, index: int) -> TrackingSimulator:
        if index not in self._built:
            self._built[index] = self._make(self.configs[index])
        return self._built[index]

    @property
    def built(self) -> int:
        """Number of simulators that exist."""
        return len(self._built)
