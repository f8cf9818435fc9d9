"""Cascaded flight controller in a diagram, and the target that a reference motion is for it."""

import numpy as np
from pydrake.systems.framework import BasicVector, LeafSystem

from np_drake.control.cascade import TARGET_SIZE, CascadeGains, cascade, cascade_target
from np_drake.vehicle import Vehicle


class CascadedController(LeafSystem):
    """Discrete system that holds the command of `np_drake.control.cascade` between two updates.

    .. pydrake_system::

        name: CascadedController
        input_ports:
        - x
        - target
        output_ports:
        - u

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | state | |
    | target | 16 | p, v, a in W, w, dw/dt in B, heading | m … rad |
    | u | 4 | command after saturation | N, N·m |

    Discrete state: u (4), integrals (6) of the errors [m·s, rad·s], time of the last update (1)
    [s]. Event: periodic every `period` [s]. A state with NaN leaves command and integrals as they
    were.

    Args:
        vehicle: nominal.
        period: of the updates [s].
    """

    def __init__(self, vehicle: Vehicle, *, period: float):
        super().__init__()
        self._vehicle = vehicle
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._target_port = self.DeclareVectorInputPort("target", TARGET_SIZE)
        # Hovering, and no update yet.
        start = np.concatenate([vehicle.hover_input, np.zeros(6), [np.nan]])
        self.DeclareDiscreteState(BasicVector(start))
        self.DeclareVectorOutputPort("u", 4, self._calc_u, {self.xd_ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _calc_u(self, context, output) -> None:
        output.SetFromVector(context.get_discrete_state(0).value()[:4])

    def _update(self, context, discrete_state) -> None:
        state = context.get_discrete_state(0).CopyToVector()
        t = context.get_time()
        x = self._x_port.Eval(context)
        if not np.all(np.isfinite(x)):  # the integral would never be a number again
            discrete_state.set_value(0, np.concatenate([state[:10], [t]]))
            return
        u, integral = cascade(
            self._vehicle,
            CascadeGains(),
            x=x,
            target=self._target_port.Eval(context),
            integral=state[4:10],
            step=0.0 if np.isnan(state[10]) else t - state[10],
        )
        discrete_state.set_value(0, np.concatenate([u, integral, [t]]))


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
