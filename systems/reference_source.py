"""Reference motion over the controller's horizon."""

import numpy as np
from pydrake.systems.framework import LeafSystem

from np_drake.checks import require
from np_drake.references.base import Reference


class ReferenceSource(LeafSystem):
    """Samples of a reference motion at t + lead, t + lead + step, …, t + lead + horizon * step.

    .. pydrake_system::

        name: ReferenceSource
        input_ports:
        - lead
        output_ports:
        - flat
        - position

    | port | size | meaning | unit |
    |---|---|---|---|
    | lead | 1 | time after which the next command acts; unconnected: 0 | s |
    | flat | 15 (N+1) | (5, N+1, 3) p, v, a, jerk, snap, flattened | m … m/s⁴ |
    | position | 3 | p now | m |

    Args:
        reference: motion.
        horizon: N [1].
        step: between samples [s].
    Raises: ValueError: on an impossible horizon or step.
    """

    def __init__(self, reference: Reference, *, horizon: int, step: float):
        super().__init__()
        require(
            horizon >= 0 and 0 < step < np.inf,
            "ReferenceSource: horizon must not be negative and step positive [s]; "
            f"got {horizon!r}, {step!r}.",
        )
        self._reference = reference
        self._times = step * np.arange(horizon + 1)
        self._lead_port = self.DeclareVectorInputPort("lead", 1)
        when = {self.time_ticket(), self.all_input_ports_ticket()}
        self.DeclareVectorOutputPort("flat", 15 * (horizon + 1), self._calc_flat, when)
        self.DeclareVectorOutputPort("position", 3, self._calc_position, {self.time_ticket()})

    def _calc_flat(self, context, output) -> None:
        lead = self._lead_port.Eval(context)[0] if self._lead_port.HasValue(context) else 0.0
        output.SetFromVector(
            self._reference.sample(context.get_time() + lead + self._times).ravel()
        )

    def _calc_position(self, context, output) -> None:
        output.SetFromVector(self._reference.sample(np.array([context.get_time()]))[0, 0])
