"""Which command acts now, and which are on their way."""

import numpy as np

from np_drake.command_delay import KEPT, DelayFilter, acting_command, newest_first
from systems.residual_predictor import MemorySystem


class DelayEstimator(MemorySystem):
    """LeafSystem that runs `np_drake.command_delay.DelayFilter` on measurements and commands.

    .. pydrake_system::

        name: DelayEstimator
        input_ports:
        - x
        - acceleration
        - u
        output_ports:
        - acting
        - sent
        - delay

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | measured state | |
    | acceleration | 6 | measured [a in W, al in B] | m/s², rad/s² |
    | u | 4 | command that was sent up to now | N, N·m |
    | acting | 4 | command that acted up to now, mean of a period | N, N·m |
    | sent | 4 KEPT | commands, the newest first | N, N·m |
    | delay | 1 | of a command, as of the last event | s |

    State: the filter's memory. Event: periodic, every `delay_filter.step`.
    """

    def __init__(self, delay_filter: DelayFilter):
        super().__init__()
        self._filter = delay_filter
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._acceleration_port = self.DeclareVectorInputPort("acceleration", 6)
        self._u_port = self.DeclareVectorInputPort("u", 4)
        self._declare_memory(delay_filter.initial_memory())
        known = {self._u_port.ticket(), self.xd_ticket()}
        self.DeclareVectorOutputPort("acting", 4, self._calc_acting, known)
        self.DeclareVectorOutputPort("sent", 4 * KEPT, self._calc_sent, known)
        self.DeclareVectorOutputPort("delay", 1, self._calc_delay, {self.xd_ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(delay_filter.step, 0.0, self._update_memory)

    def _sent(self, context) -> np.ndarray:
        """Return the commands sent up to now, the newest first, (KEPT, 4); see `newest_first` for
        NaN.
        """
        return newest_first(self.memory(context)["sent"], self._u_port.Eval(context))

    def _calc_acting(self, context, output) -> None:
        periods = self._filter.delay(self.memory(context)) / self._filter.step
        output.SetFromVector(acting_command(self._sent(context), periods))

    def _calc_sent(self, context, output) -> None:
        output.SetFromVector(self._sent(context).ravel())

    def _calc_delay(self, context, output) -> None:
        output.SetFromVector([self._filter.delay(self.memory(context))])

    def _update_memory(self, context, discrete_state) -> None:
        memory = self._filter.update(
            self.memory(context),
            x=self._x_port.Eval(context),
            acceleration=self._acceleration_port.Eval(context),
            u=self._u_port.Eval(context),
        )
        self._store_memory(memory, discrete_state)
