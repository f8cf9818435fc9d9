"""LeafSystem whose discrete state holds a dictionary of arrays."""

import itertools
from collections.abc import Callable

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, CacheEntry, LeafSystem, ValueProducer

from np_drake.residual_model import Memory


class MemorySystem(LeafSystem):
    """LeafSystem that keeps a pure algorithm's memory in the Context: one discrete group of all arrays, sorted by name.

    The step of the algorithm runs once per sampling instant: the feed-through output and the event that stores
    the new memory read the same cache entry.
    """

    def _declare_memory(self, initial: Memory) -> None:
        self._shapes = {name: np.shape(initial[name]) for name in sorted(initial)}
        ends = np.cumsum([0] + [int(np.prod(shape)) for shape in self._shapes.values()]).tolist()
        self._parts = [slice(a, b) for a, b in itertools.pairwise(ends)]
        self._memory_index = self.DeclareDiscreteState(BasicVector(self._packed(initial)))

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
        values = context.get_discrete_state(self._memory_index).CopyToVector()
        shapes = self._shapes.items()
        return {
            name: values[part].reshape(shape) for (name, shape), part in zip(shapes, self._parts, strict=True)
        }

    def _packed(self, memory: Memory) -> np.ndarray:
        parts = (np.ravel(memory[name]) for name in self._shapes)
        return np.concatenate([np.zeros(0), *parts], dtype=float)  # a model may remember nothing

    def _store_memory(self, memory: Memory, discrete_state) -> None:
        discrete_state.set_value(self._memory_index, self._packed(memory))
