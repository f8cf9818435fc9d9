"""Betaflight's firmware as a LeafSystem between the controller and the rotors."""

import numpy as np
from pydrake.systems.framework import BasicVector, LeafSystem

from np_drake import attitude
from np_drake.autopilot.betaflight import PERIOD, Betaflight, Sensed
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle


class BetaflightAutopilot(LeafSystem):
    """Firmware that runs in lock-step with the Simulator.

    .. pydrake_system::

        name: BetaflightAutopilot
        input_ports:
        - x
        - acceleration
        - rates_thrust
        output_ports:
        - u
        - motors

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | true state, of which the gyro sees the body rates | |
    | acceleration | 6 | true [a in W, al in B], of which the accelerometer sees the first | m/s², rad/s² |
    | rates_thrust | 4 | collective thrust and commanded body rates | N, rad/s |
    | u | 4 | thrust and torque of the rotors at the motor outputs, before the rotors' own effects | N, N·m |
    | motors | 4 | motor outputs | 1 |

    State: motors (4). Event: periodic, every millisecond. The firmware's own state is in its
    process, not in the Context: one system flies one flight, forward in time. It is armed at hover
    by the initialization event. An input that is not finite raises RuntimeError.

    Args:
        vehicle: that flies.
        firmware: set up for it; whoever made it closes it.
    """  # noqa: E501

    def __init__(self, vehicle: Vehicle, firmware: Betaflight):
        super().__init__()
        self._vehicle = vehicle
        self.firmware = firmware
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._acceleration_port = self.DeclareVectorInputPort("acceleration", 6)
        self._command_port = self.DeclareVectorInputPort("rates_thrust", 4)
        motors = self.DeclareDiscreteState(BasicVector(np.zeros(4)))
        self.DeclareVectorOutputPort("u", 4, self._calc_u, {self.xd_ticket()})
        self.DeclareStateOutputPort("motors", motors)
        self.DeclareInitializationDiscreteUpdateEvent(self._arm)
        self.DeclarePeriodicDiscreteUpdateEvent(PERIOD, 0.0, self._step)

    def _arm(self, context, discrete_state) -> None:
        x = self._x_port.Eval(context)
        g = self._vehicle.gravity
        level = np.array([1.0, 0.0, 0.0, 0.0])
        at_rest = Sensed(np.zeros(3), np.array([0.0, 0.0, g]), level, x[P], np.zeros(3))
        discrete_state.set_value(self.firmware.arm(at_rest, self._command_port.Eval(context)[0]))

    def _step(self, context, discrete_state) -> None:
        x = self._x_port.Eval(context)
        a = self._acceleration_port.Eval(context)[:3]
        q = x[Q] / np.linalg.norm(x[Q])
        f = attitude.rotate_back(q, a + [0.0, 0.0, self._vehicle.gravity])
        command = self._command_port.Eval(context)
        if not (np.isfinite(x).all() and np.isfinite(f).all() and np.isfinite(command).all()):
            raise RuntimeError(
                "BetaflightAutopilot: x, acceleration and rates_thrust must be finite; one is NaN."
            )
        discrete_state.set_value(self.firmware.step(Sensed(x[W], f, q, x[P], x[V]), command))

    def _calc_u(self, context, output) -> None:
        motors = context.get_discrete_state(0).value()
        output.SetFromVector(self._vehicle.mixer @ self.firmware.rotor_thrust(motors))
