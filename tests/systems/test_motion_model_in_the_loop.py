"""GP and KNODE through the Context: predictor and controller as they fly."""

import numpy as np
import pytest
from pydrake.common.value import Value

from np_drake.mpc.controller import MpcController
from np_drake.mpc.problem import MpcConfig, MpcStatus
from np_drake.mpc.solvers import make_solver
from np_drake.references.config import ReferenceConfig, make_reference
from np_drake.residual_models.motion_model import GaussianProcess, MotionModel
from np_drake.vehicle import Vehicle
from systems.np_mpc import NpMpc
from systems.residual_predictor import ResidualPredictor

RNG, N, VEHICLE = np.random.default_rng(0), 6, Vehicle()
DRAG = GaussianProcess(
    RNG.normal(size=(20, 6)),
    0.2 * RNG.normal(size=(20, 6)) * np.repeat([1.0, 0.02], 3),
    np.full((6, 6), 2.0),
    np.array([0.3, 0.0, -2.0, 0.0, 0.0, 0.0]),
)
LEVEL = np.array([0, 0, 1.0, 1, 0, 0, 0, 0.2, -0.1, 0.1, 0.1, 0, 0])


@pytest.fixture
def dut() -> ResidualPredictor:
    return ResidualPredictor(MotionModel("gp", DRAG, 0.02), horizon=N, stride=2)


def fed(dut, x):
    context = dut.CreateDefaultContext()
    for port, value in (("x", x), ("u", VEHICLE.hover_input), ("label", np.full(6, np.nan))):
        dut.GetInputPort(port).FixValue(context, value)
    return context


def test_the_port_carries_the_function_and_the_motion_of_now(dut):
    context, zeta = fed(dut, LEVEL), RNG.normal(size=(N, 6))
    forecast = dut.GetOutputPort("forecast").Eval(context)
    np.testing.assert_allclose(forecast.rollout(zeta), DRAG(zeta), atol=1e-12)
    context.SetDiscreteState(dut.EvalUniquePeriodicDiscreteUpdate(context))
    np.testing.assert_allclose(
        dut.GetOutputPort("chi_hat").Eval(context), DRAG(LEVEL[7:]), atol=1e-12
    )


def test_the_controller_plans_with_the_wrench_of_its_own_plan(dut):
    config = MpcConfig(horizon=N)
    mpc = NpMpc(
        MpcController(VEHICLE, config, make_solver("sqp", VEHICLE, config, time_limit=np.inf))
    )
    context = mpc.CreateDefaultContext()
    reference = make_reference(ReferenceConfig(track="hover", height=1.0))
    flat = reference.sample(20.0 + config.step * np.arange(N + 1))
    mpc.GetInputPort("x").FixValue(context, LEVEL)
    mpc.GetInputPort("flat").FixValue(context, np.ravel(flat))
    forecast = dut.GetOutputPort("forecast").Eval(fed(dut, LEVEL))
    mpc.GetInputPort("forecast").FixValue(context, Value[object](forecast))
    context.SetDiscreteState(mpc.EvalUniquePeriodicDiscreteUpdate(context))
    x, chi = (mpc.GetOutputPort(name).Eval(context) for name in ("plan_x", "plan_chi"))
    planned = DRAG(x.reshape(N + 1, 13)[:-1, 7:])
    np.testing.assert_allclose(chi.reshape(N, 6), planned, atol=1e-10)  # [N, N·m]
    assert mpc.GetOutputPort("status").Eval(context)[0] < MpcStatus.SQP_FALLBACK
