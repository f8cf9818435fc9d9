"""Dead time on a held command."""

import math

import numpy as np
from pydrake.systems.framework import BasicVector, LeafSystem

# A command is read this long after it may change, and no later than this before it may again.
SOONEST = 1e-5  # [s]
# Drake may lose an event whose time is one rounding error from another's: readings keep off all
# decimal times.
_OFF_GRID = 3.7e-7  # [s]


class CommandBuffer(LeafSystem):
    """Delay that outputs what came in `dead_time` ago.

    Reads at k period + offset and hands on what it read `periods` readings before, with
    dead_time = periods * period + offset: exact for a command that changes at multiples of `period`
    only, else late by up to one period. Before the start `resting` holds.
    Source: own choice; one event a period.

    .. pydrake_system::

        name: CommandBuffer
        input_ports:
        - command
        output_ports:
        - delayed

    | port | size | meaning | unit |
    |---|---|---|---|
    | command, delayed | n | rotor thrusts, now and `dead_time` ago | N |

    Discrete state: the readings, oldest first. Event: every `period` from `offset` on.
    """

    def __init__(
        self, resting: np.ndarray, *, dead_time: float, period: float, onset: float = -math.inf
    ):
        """Declare ports and state.

        Args:
            resting: (n,) command before the first [N].
            dead_time: [s].
            period: between readings [s].
            onset: before which commands pass at once [s].
        """
        super().__init__()
        self._onset = onset
        if not dead_time >= SOONEST or not period > 2 * SOONEST:
            raise ValueError(
                f"CommandBuffer: dead_time must be at least {SOONEST:g} and period above "
                f"{2 * SOONEST:g} [s]; got {dead_time} and {period}."
            )
        self._size = len(resting)
        periods = math.floor(dead_time / period)
        offset = min(max(dead_time - periods * period, SOONEST), period - SOONEST) + _OFF_GRID
        self._command_port = self.DeclareVectorInputPort("command", self._size)
        state = self.DeclareDiscreteState(BasicVector(np.tile(resting, periods + 1)))
        needed = {self.discrete_state_ticket(state)}
        if onset > -math.inf:
            needed |= {self.time_ticket(), self._command_port.ticket()}
        self.DeclareVectorOutputPort("delayed", self._size, self._calc_delayed, needed)
        self.DeclarePeriodicDiscreteUpdateEvent(period, offset, self._update_readings)

    def _update_readings(self, context, discrete_state) -> None:
        readings = context.get_discrete_state(0).value()
        command = self._command_port.Eval(context)
        discrete_state.set_value(0, np.concatenate([readings[self._size :], command]))

    def _calc_delayed(self, context, output) -> None:
        if context.get_time() < self._onset:
            output.SetFromVector(self._command_port.Eval(context))
            return
        output.SetFromVector(context.get_discrete_state(0).value()[: self._size])
