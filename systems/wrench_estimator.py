"""Wrench labels in flight: eq. (1) inverted from the vehicle's measurements."""

import numpy as np
from pydrake.systems.framework import BasicVector

from np_drake.labels import LabelConfig, LabelFilter
from np_drake.vehicle import Vehicle
from systems.residual_predictor import MemorySystem


class WrenchEstimator(MemorySystem):
    """LeafSystem that runs `np_drake.labels.LabelFilter` on the measurements.

    .. pydrake_system::

        name: WrenchEstimator
        input_ports:
        - x
        - acceleration
        - u
        output_ports:
        - label
        - last_label

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | measured state | |
    | acceleration | 6 | measured [a in W, al in B] | m/s², rad/s² |
    | u | 4 | command that acted up to now | N, N·m |
    | label | 6 | chi with the sample at hand taken in; NaN where a reading is; feeds through | N, N·m |
    | last_label | 6 | chi as of the last event | N, N·m |

    State: the filter's memory, then last_label (6). Event: periodic, every `step`.

    Args:
        vehicle: nominal.
        config: low-pass of the labels.
        step: between samples [s].
    """  # noqa: E501

    def __init__(self, vehicle: Vehicle, config: LabelConfig, *, step: float):
        super().__init__()
        self._filter = LabelFilter(vehicle, config, step=step)
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._acceleration_port = self.DeclareVectorInputPort("acceleration", 6)
        self._u_port = self.DeclareVectorInputPort("u", 4)
        self._declare_memory(self._filter.initial_memory())
        self._label_index = self.DeclareDiscreteState(BasicVector(np.zeros(6)))
        self._step = self._declare_step(self._take_sample)
        self.DeclareVectorOutputPort("label", 6, self._calc_label, {self._step.ticket()})
        self.DeclareStateOutputPort("last_label", self._label_index)
        self.DeclarePeriodicDiscreteUpdateEvent(step, 0.0, self._update_memory)

    def _take_sample(self, context):
        acceleration = self._acceleration_port.Eval(context)
        return self._filter.step(
            self.memory(context),
            x=self._x_port.Eval(context),
            a=acceleration[:3],
            al=acceleration[3:],
            u=self._u_port.Eval(context),
        )

    def _calc_label(self, context, output) -> None:
        output.SetFromVector(self._step.Eval(context)[1])

    def _update_memory(self, context, discrete_state) -> None:
        memory, label = self._step.Eval(context)
        self._store_memory(memory, discrete_state)
        discrete_state.set_value(self._label_index, label)
