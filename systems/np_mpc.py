"""Receding-horizon controller: NP-MPC, nominal MPC and the MPC with any other residual model."""

from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, LeafSystem

from np_drake.mpc.controller import ControllerMemory, MpcController
from np_drake.rigid_body import INPUT_SIZE


class NpMpc(LeafSystem):
    """MPC that solves problem (nmpc) at every period and holds the first input.

    Source: Jin et al. 2025, eq. (nmpc).

    .. pydrake_system::

        name: NpMpc
        input_ports:
        - x
        - flat
        - forecast
        output_ports:
        - u
        - rates_thrust
        - status
        - solve_time
        - plan_u
        - plan_x
        - plan_chi

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | measured state | |
    | flat | 15 (N+1) | reference motion over the horizon (`ReferenceSource`) | m … m/s⁴ |
    | forecast | WrenchForecast | residual wrench; leave it unconnected for the nominal MPC | |
    | u | 4 | command, held between events; under commanded rates with the torque that drives the rate loop | N, N·m |
    | rates_thrust | 4 | collective thrust and body rates, for an autopilot: commanded, or the plan's next | N, rad/s |
    | status | 1 | `MpcStatus` of the last event | |
    | solve_time | 1 | wall time of the last event | s |
    | plan_u, plan_x, plan_chi | 4 N, 13 (N+1), 6 N | the last plan: inputs, states, chi_hat | |

    State: plan_u, plan_x, plan_chi, [status, solve time, has a plan], thrust and torque of the
    rotors as their lag lets them act. Event: periodic, every `period`. Before the first event the output is the hover input.
    """  # noqa: E501

    def __init__(self, controller: MpcController):
        super().__init__()
        self.controller = controller
        N = controller.config.horizon
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._flat_port = self.DeclareVectorInputPort("flat", 15 * (N + 1))
        self._forecast_port = self.DeclareAbstractInputPort("forecast", Value[object]())
        start = controller.initial_memory()
        self._shapes = [start.u.shape, start.x.shape, start.chi.shape]
        arrays = (start.u, start.x, start.chi, start.flags, start.acting)
        groups = [self.DeclareDiscreteState(BasicVector(array.ravel())) for array in arrays]
        xd = {self.xd_ticket()}
        self.DeclareVectorOutputPort("u", INPUT_SIZE, self._calc_u, xd)
        self.DeclareVectorOutputPort("rates_thrust", INPUT_SIZE, self._calc_rates_thrust, xd)
        self.DeclareVectorOutputPort("status", 1, self._calc_flag(0), xd)
        self.DeclareVectorOutputPort("solve_time", 1, self._calc_flag(1), xd)
        for name, group in zip(("plan_u", "plan_x", "plan_chi"), groups, strict=False):
            self.DeclareStateOutputPort(name, group)
        self.DeclarePeriodicDiscreteUpdateEvent(controller.period, 0.0, self._update_plan)

    def _memory(self, context) -> ControllerMemory:
        values = [context.get_discrete_state(i).CopyToVector() for i in range(5)]
        u, x, chi = (v.reshape(shape) for v, shape in zip(values[:3], self._shapes, strict=True))
        return ControllerMemory(u, x, chi, flags=values[3], acting=values[4])

    def _update_plan(self, context, discrete_state) -> None:
        forecast = (
            self._forecast_port.Eval(context) if self._forecast_port.HasValue(context) else None
        )
        memory = self.controller.step(
            self._memory(context),
            x=self._x_port.Eval(context),
            flat=self._flat_port.Eval(context).reshape(5, -1, 3),
            forecast=forecast,
            t=context.get_time(),
        )
        arrays = (memory.u, memory.x, memory.chi, memory.flags, memory.acting)
        for i, array in enumerate(arrays):
            discrete_state.set_value(i, array.ravel())

    def _calc_u(self, context, output) -> None:
        output.SetFromVector(context.get_discrete_state(0).value()[:INPUT_SIZE])

    def _calc_rates_thrust(self, context, output) -> None:
        memory = self._memory(context)
        output.SetFromVector(self.controller.rates_thrust(memory))

    def _calc_flag(self, index: int):
        def calc(context, output) -> None:
            output.SetFromVector(context.get_discrete_state(3).value()[index : index + 1])

        return calc
