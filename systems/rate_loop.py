"""Rate loop of an autopilot as a system without memory: the torque by which it turns the vehicle."""

import numpy as np
from pydrake.systems.framework import LeafSystem

from np_drake.rigid_body import W
from np_drake.vehicle import Vehicle


class RateLoopTorque(LeafSystem):
    """Thrust and torque of a vehicle whose autopilot follows commanded body rates as its file says.

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

    In the plant's place it is an ideal autopilot; before an estimator it says what the autopilot is assumed to do.

    Args:
        vehicle: with a `rate_loop`.
    Raises: ValueError: where the vehicle's file names none.
    """

    def __init__(self, vehicle: Vehicle):
        super().__init__()
        if vehicle.rate_loop is None:
            raise ValueError(f"RateLoopTorque: vehicle {vehicle.name!r} must have a rate_loop; its file names none.")
        self._vehicle, self._loop = vehicle, vehicle.rate_loop
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._command_port = self.DeclareVectorInputPort("rates_thrust", 4)
        inputs = {self._x_port.ticket(), self._command_port.ticket()}
        self.DeclareVectorOutputPort("u", 4, self._calc_u, inputs)

    def _calc_u(self, context, output) -> None:
        command = self._command_port.Eval(context)
        tau = self._loop.torque(self._vehicle.J, self._x_port.Eval(context)[W], command[1:])
        output.SetFromVector(np.concatenate([command[:1], tau]))
