"""Observation of a policy that learns to track."""

import numpy as np
from pydrake.systems.framework import LeafSystem

from np_drake.control.tracking_task import TrackingTask, observe
from np_drake.references.base import Reference


class TrackingObservation(LeafSystem):
    """Tracking error, motion and the reference ahead (`np_drake.control.tracking_task.observe`).

    .. pydrake_system::

        name: TrackingObservation
        input_ports:
        - x
        output_ports:
        - observation

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | state as read | |
    | observation | 18 + 3 n | see `observe`, for n times ahead | m … rad/s |

    Args:
        reference: motion that is tracked.
        task: times ahead that are observed.
    """

    def __init__(self, reference: Reference, task: TrackingTask):
        super().__init__()
        self._reference, self._times = reference, np.array([0.0, *task.ahead])
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self.DeclareVectorOutputPort(
            "observation", task.observation_size, self._calc_observation, {self.time_ticket(), self._x_port.ticket()}
        )

    def _calc_observation(self, context, output) -> None:
        flat = self._reference.sample(context.get_time() + self._times)
        output.SetFromVector(observe(self._x_port.Eval(context), flat))
