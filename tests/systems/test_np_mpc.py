import time

import numpy as np
from pydrake.common.value import Value

from np_drake.mpc.controller import MpcController
from np_drake.mpc.problem import MpcConfig, MpcStatus
from np_drake.mpc.sqp import SqpSolver
from np_drake.references.base import Hover
from np_drake.vehicle import Vehicle
from systems.np_mpc import NpMpc
from tests.systems.conftest import evaluate, event

VEHICLE, CONFIG = Vehicle(), MpcConfig(horizon=10)
LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0])


def mpc_at(x, *, solver=None, forecast=None, **options):
    dut = NpMpc(
        MpcController(VEHICLE, CONFIG, solver or SqpSolver(VEHICLE, CONFIG, steps=5), **options)
    )
    context = dut.CreateDefaultContext()
    flat = Hover(np.array([0.0, 0.0, 1.0])).sample(np.arange(11))
    dut.GetInputPort("x").FixValue(context, x)
    dut.GetInputPort("flat").FixValue(context, flat.ravel())
    if forecast is not None:
        dut.GetInputPort("forecast").FixValue(context, Value[object](forecast))
    return dut, context


def test_an_autopilot_gets_the_plans_thrust_and_its_next_rates():
    dut, context = mpc_at(LEVEL + 0.2 * np.eye(13)[0])
    event(dut, context)
    thrust, *rates = evaluate(dut, context, "rates_thrust")
    assert thrust == evaluate(dut, context, "u")[0]
    np.testing.assert_array_equal(rates, evaluate(dut, context, "plan_x").reshape(-1, 13)[1, 10:])
    assert rates[1] < -0.1  # it leans back to where it belongs


class Slow:
    """A solver that takes its time, and sometimes more."""

    name = "slow"

    def __init__(self, *delays):
        self._inner, self._delays = SqpSolver(VEHICLE, CONFIG), list(delays)

    def solve(self, problem, warm_start=None):
        time.sleep(self._delays.pop(0))
        return self._inner.solve(problem, warm_start)


def test_a_late_answer_is_discarded_and_its_time_is_told():
    dut, context = mpc_at(LEVEL, solver=Slow(0.0, 0.6, 0.0), deadline=0.5)
    statuses, times = [], []
    for _ in range(3):
        event(dut, context)
        statuses.append(int(evaluate(dut, context, "status")[0]))
        times.append(evaluate(dut, context, "solve_time")[0])
    assert statuses[1] == MpcStatus.SHIFTED_PLAN
    assert max(statuses[0], statuses[2]) <= MpcStatus.ITERATION_LIMIT
    assert times[1] >= 0.6  # [s]
    assert max(times[0], times[2]) < 0.5


def test_two_contexts_of_one_controller_never_influence_each_other():
    dut, first = mpc_at(LEVEL)
    second = first.Clone()
    low = LEVEL.copy()
    low[2] = 0.5
    first_port = dut.GetInputPort("x")
    first_port.FixValue(first, low)
    event(dut, first)
    event(dut, second)
    np.testing.assert_allclose(evaluate(dut, second, "u"), VEHICLE.hover_input, atol=1e-6)
    assert evaluate(dut, first, "u")[0] > VEHICLE.hover_input[0] + 1.0
