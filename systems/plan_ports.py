"""Input ports for the controller's last plan, which is one period old when it is read."""

import numpy as np

from np_drake.mpc.plan import shift
from np_drake.mpc.problem import MpcSolution, MpcStatus
from np_drake.residual_model import Plan


class PlanPorts:
    """Ports plan_u (4 N) and plan_x (13 (N+1)) of a LeafSystem.

    Args:
        system: that gets the ports.
        horizon: N.
        step: of the plan [s].
        age: of the plan when it is read [s].
    """

    def __init__(self, system, *, horizon: int, step: float, age: float):
        self._horizon, self._step, self._age = horizon, step, age
        self._u_port = system.DeclareVectorInputPort("plan_u", 4 * horizon)
        self._x_port = system.DeclareVectorInputPort("plan_x", 13 * (horizon + 1))

    def read(self, context) -> Plan:
        """Return the plan from now on, held beyond its end."""
        N = self._horizon
        u = self._u_port.Eval(context).reshape(N, 4)
        x = self._x_port.Eval(context).reshape(N + 1, 13)
        plan = MpcSolution(u, x, np.zeros((N, 6)), MpcStatus.OPTIMAL, 0.0, 0.0, 0.0, 0)
        plan = shift(plan, elapsed=self._age, step=self._step)
        return Plan(plan.x, plan.u)
