"""Reference motion as the target of the cascaded controller."""

from pydrake.systems.framework import LeafSystem

from np_drake.control.cascade import TARGET_SIZE, cascade_target
from np_drake.vehicle import Vehicle


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
        self.DeclareVectorOutputPort(
            "target", TARGET_SIZE, self._calc_target, {self._flat_port.ticket()}
        )

    def _calc_target(self, context, output) -> None:
        flat = self._flat_port.Eval(context).reshape(5, 1, 3)
        output.SetFromVector(cascade_target(self._vehicle, flat)[0])
