"""Rate loop of an autopilot: the torque that a controller assumes of it, and an ideal autopilot
that follows it.
"""

import numpy as np
from pydrake.systems.framework import LeafSystem

from np_drake.rigid_body import W
from np_drake.vehicle import Vehicle


class RateLoopTorque(LeafSystem):
    """Thrust and torque that an estimator assumes, of a vehicle whose autopilot follows its file's
    rate loop.

    .. pydrake_system::

        name: RateLoopTorque
        input_ports:
        - x
        - rates_thrust
        output_ports:
        - u

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | state | |
    | rates_thrust | 4 | collective thrust and commanded body rates | N, rad/s |
    | u | 4 | collective thrust and torque | N, N·m |

    Args:
        vehicle: with a `rate_loop`.
    Raises: ValueError: where the vehicle's file names none.
    """

    def __init__(self, vehicle: Vehicle):
        super().__init__()
        if vehicle.rate_loop is None:
            raise ValueError(
                f"{type(self).__name__}: vehicle {vehicle.name!r} must have a rate_loop; "
                f"it has none."
            )
        self._J = vehicle.J
        self._loop = vehicle.rate_loop
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._command_port = self.DeclareVectorInputPort("rates_thrust", 4)
        sources = {self.all_input_ports_ticket(), self.xc_ticket()}
        self.DeclareVectorOutputPort("u", 4, self._calc_u, sources)

    def _calc_u(self, context, output) -> None:
        command = self._command_port.Eval(context)
        tau = self._loop.torque(self._J, self._x_port.Eval(context)[W], command[1:])
        output.SetFromVector(np.concatenate([command[:1], tau]))


class RateLoopAutopilot(RateLoopTorque):
    """Autopilot that follows the rate loop of a vehicle's file whatever torque disturbs it.

    Ports are those of `RateLoopTorque`. Continuous state: w_r (3,) [rad/s], s (3,) [rad], with

        dw_r/dt = (gain w_c - w_r) / lag,
        ds/dt = w_r - w,
        al = (gain w_c - w) / lag + s / (4 lag²)

    Undisturbed w is w_r, and s is zero; a steady torque is made up for with both poles at -1 / (2
    lag). Source: own choice, model following with critical damping.
    """

    def __init__(self, vehicle: Vehicle):
        super().__init__(vehicle)
        self._lag, self._gain = np.array(self._loop.lag), np.array(self._loop.gain)
        self.DeclareContinuousState(6)

    def DoCalcTimeDerivatives(self, context, derivatives) -> None:
        """Write the rates of w_r and s."""
        w_r = context.get_continuous_state_vector().CopyToVector()[:3]
        rate = (self._gain * self._command_port.Eval(context)[1:] - w_r) / self._lag
        derivatives.SetFromVector(np.concatenate([rate, w_r - self._x_port.Eval(context)[W]]))

    def _calc_u(self, context, output) -> None:
        super()._calc_u(context, output)
        u = output.CopyToVector()
        s = context.get_continuous_state_vector().CopyToVector()[3:]
        u[1:] += self._J @ (s / (4 * self._lag**2))
        output.SetFromVector(u)
