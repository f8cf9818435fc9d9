"""LeafSystem whose discrete state holds a dictionary of arrays."""

from collections.abc import Callable

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import (
    BasicVector,
    CacheEntry,
    DiscreteStateIndex,
    LeafSystem,
    ValueProducer,
)

from np_drake.residual_model import Memory


class MemorySystem(LeafSystem):
    """LeafSystem that keeps a pure algorithm's memory in the Context: one discrete group for each
    array.

    The step of the algorithm runs once per sampling instant: the feed-through output and the event
    that stores the new memory read the same cache entry.
    """

    def __init__(self) -> None:
        super().__init__()
        self._groups: dict[
            str, tuple[DiscreteStateIndex, tuple[int, ...]]
        ] = {}  # index and shape by name

    def _declare_memory(self, initial: Memory) -> None:
        """Declare a group for each array that has none yet, sorted by name."""
        for name in sorted(set(initial) - set(self._groups)):
            self._declare_group(name, initial)

    def _declare_group(self, name: str, initial: Memory) -> DiscreteStateIndex:
        """Declare the group of one array, row by row, and return its index in the Context.

        Args:
            name: of the array in the memory.
            initial: the memory before any sample.
        """
        index = self.DeclareDiscreteState(BasicVector(np.ravel(initial[name]).astype(float)))
        self._groups[name] = index, np.shape(initial[name])
        return index

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
        state = context.get_discrete_state()
        return {
            name: state.value(index).reshape(shape).copy()
            for name, (index, shape) in self._groups.items()
        }

    def _store_memory(self, memory: Memory, discrete_state) -> None:
        for name, (index, _) in self._groups.items():
            discrete_state.set_value(index, np.ravel(memory[name]))
