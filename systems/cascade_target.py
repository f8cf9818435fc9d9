"""Reference motion as the target of the cascaded controller."""

import numpy as np
from pydrake.systems.framework import LeafSystem

from np_drake.control.cascade import TARGET_SIZE, cascade_target
from np_drake.references.base import Reference
from np_drake.vehicle import Vehicle


class CascadeTarget(LeafSystem):
    """Target of a reference motion for `CascadedController`, from a table made at construction.

    .. pydrake_system::

        name: CascadeTarget
        output_ports:
        - target

    | port | size | meaning | unit |
    |---|---|---|---|
    | target | 16 | p, v, a in W, w, dw/dt in B, heading | m … rad |

    Between two multiples of the period the target is that of the earlier one, after the end that of the end.

    Args:
        vehicle: nominal.
        reference: the motion.
        period: at whose multiples the controller reads its target [s].
        end: of the motion [s].
    """

    def __init__(self, vehicle: Vehicle, reference: Reference, *, period: float, end: float):
        super().__init__()
        times = period * np.arange(int(np.ceil(end / period)) + 1)
        self._table, self._period = cascade_target(vehicle, reference.sample(times)), period
        self.DeclareVectorOutputPort("target", TARGET_SIZE, self._calc_target, {self.time_ticket()})

    def _calc_target(self, context, output) -> None:
        row = int(context.get_time() / self._period + 1e-6)
        output.SetFromVector(self._table[min(row, len(self._table) - 1)])


class FlatTarget(LeafSystem):
    """Target for `CascadedController` of a reference motion that comes in.

    .. pydrake_system::

        name: FlatTarget
        input_ports:
        - flat
        output_ports:
        - target

    | port | size | meaning | unit |
    |---|---|---|---|
    | flat | 15 | p, v, a, jerk, snap now (`ReferenceSource` of horizon 0) | m … m/s⁴ |
    | target | 16 | p, v, a in W, w, dw/dt in B, heading | m … rad |
    """

    def __init__(self, vehicle: Vehicle):
        super().__init__()
        self._vehicle = vehicle
        self._flat_port = self.DeclareVectorInputPort("flat", 15)
        self.DeclareVectorOutputPort("target", TARGET_SIZE, self._calc_target, {self._flat_port.ticket()})

    def _calc_target(self, context, output) -> None:
        flat = self._flat_port.Eval(context).reshape(5, 1, 3)
        output.SetFromVector(cascade_target(self._vehicle, flat)[0])
