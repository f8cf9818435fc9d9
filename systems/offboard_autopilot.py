"""Autopilot of a simulated vehicle that a process outside commands by MAVLink."""

from pydrake.systems.framework import BasicVector, LeafSystem

from np_drake.autopilot.mavlink import MavlinkLink
from np_drake.autopilot.simulated import SimulatedAutopilot
from np_drake.vehicle import Vehicle

# between two looks at the link [s]; source: own choice, 400 Hz as of an autopilot's attitude loop
PERIOD = 0.0025


class OffboardAutopilot(LeafSystem):
    """LeafSystem that sends the vehicle's state and takes commands, with the modes of
    `SimulatedAutopilot`.

    .. pydrake_system::

        name: OffboardAutopilot
        input_ports:
        - x
        - acceleration
        output_ports:
        - rates_thrust

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | measured state | |
    | acceleration | 6 | measured [a in W, al in B] | m/s², rad/s² |
    | rates_thrust | 4 | collective thrust and body rates in force | N, rad/s |

    State: rates_thrust (4). Event: periodic, every 2.5 ms. Its modes and the link are outside the
    Context: one system flies one flight, forward in time.

    Args:
        vehicle: that flies, with a `rate_loop`.
        link: to whoever commands it; whoever made it closes it.
    """

    def __init__(self, vehicle: Vehicle, link: MavlinkLink):
        super().__init__()
        self.link = link
        self.autopilot = SimulatedAutopilot(vehicle)
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._acceleration_port = self.DeclareVectorInputPort("acceleration", 6)
        state = self.DeclareDiscreteState(BasicVector(vehicle.hover_input))
        self.DeclareStateOutputPort("rates_thrust", state)
        self.DeclarePeriodicDiscreteUpdateEvent(PERIOD, 0.0, self._step)

    def _step(self, context, discrete_state) -> None:
        t = context.get_time()
        x = self._x_port.Eval(context)
        for data in self.link.receive():
            self.autopilot.take(data, t)
        discrete_state.set_value(self.autopilot.step(t, x))
        if out := self.autopilot.messages(t, x, self._acceleration_port.Eval(context)):
            self.link.send(out)
