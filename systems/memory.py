"""LeafSystem whose discrete state is a dictionary of arrays."""

from collections.abc import Callable

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, CacheEntry, LeafSystem, ValueProducer

from np_drake.residual_models.base import Memory


class MemorySystem(LeafSystem):
    """LeafSystem that keeps a pure algorithm's memory in the Context, one discrete group per array (sorted by name).

    The step of the algorithm runs once per sampling instant: the feed-through output and the event that stores
    the new memory read the same cache entry.
    """

    def _declare_memory(self, initial: Memory) -> None:
        self._shapes = {name: np.shape(initial[name]) for name in sorted(initial)}
        for name in self._shapes:
            self.DeclareDiscreteState(BasicVector(np.ravel(initial[name]).astype(float)))

    def _declare_step(self, calc: Callable) -> CacheEntry:
        """Declare the cache entry that holds `calc(context)`."""

        def store(context, value) -> None:
            value.set_value(calc(context))

        return self.DeclareCacheEntry(
            "step",
            ValueProducer(allocate=Value[object], calc=store),
            {self.all_input_ports_ticket(), self.xd_ticket()},
        )

    def memory(self, context) -> Memory:
        """Return the memory as of the last event."""
        return {
            name: context.get_discrete_state(i).CopyToVector().reshape(shape)
            for i, (name, shape) in enumerate(self._shapes.items())
        }

    def _store_memory(self, memory: Memory, discrete_state) -> None:
        for i, name in enumerate(self._shapes):
            discrete_state.set_value(i, np.ravel(memory[name]))
