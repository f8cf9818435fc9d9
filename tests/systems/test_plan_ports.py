"""Laws of a predictor that reads the controller's plan through its ports."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.residual_model import constant_forecast
from systems.residual_predictor import ResidualPredictor

N, STEP, STRIDE = 4, 0.02, 2


@dc.dataclass
class FollowsThePlan:
    """Forecasts what is planned: the force is the velocity, the torque that of the command."""

    name: str = "follower"
    step: float = STEP

    def initial_memory(self):
        return {"seen": np.zeros(1)}

    def update(self, memory, sample):
        return {"seen": memory["seen"] + 1}

    def forecast(self, memory, *, horizon, stride):
        return constant_forecast(np.zeros(6), horizon)

    def forecast_along(self, memory, plan, *, horizon, stride):
        assert plan.x.shape == (horizon + 1, 13)
        assert plan.u.shape == (horizon, 4)
        return constant_forecast(np.hstack([plan.x[:-1, 7:10], plan.u[:, 1:]]), horizon)


@pytest.fixture
def evaluated():
    system = ResidualPredictor(FollowsThePlan(), horizon=N, stride=STRIDE)
    context = system.CreateDefaultContext()
    x = np.zeros((N + 1, 13))
    x[:, 3], x[:, 7], x[:, 9] = 1.0, np.arange(N + 1), -1.0
    u = np.column_stack([np.full(N, 20.0), np.zeros((N, 2)), 0.1 * np.arange(N)])
    values = {"x": x[0], "u": u[0], "label": np.zeros(6), "plan_x": x.ravel(), "plan_u": u.ravel()}
    for name, value in values.items():
        system.GetInputPort(name).FixValue(context, value)
    return system.GetOutputPort("forecast").Eval(context).rollout(np.zeros((N, 6)))


def test_a_plan_is_read_as_of_now_one_period_after_it_was_made(evaluated):
    half = 0.5  # of a step of the plan is one period
    np.testing.assert_allclose(evaluated[:, 0], np.arange(N) + half)
    np.testing.assert_allclose(evaluated[:, 2], -1.0)


def test_commands_are_averaged_over_the_shifted_steps_and_the_last_is_held(evaluated):
    np.testing.assert_allclose(evaluated[:, 5], [0.05, 0.15, 0.25, 0.3])
