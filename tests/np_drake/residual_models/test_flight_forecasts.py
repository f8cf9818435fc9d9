"""Laws of the walk along a flight."""

import numpy as np
import pytest

from np_drake.residual_model import constant_forecast
from np_drake.residual_models.flight_forecasts import flight_forecasts, held_plan
from np_drake.residual_models.hold import Hold
from np_drake.training_data.segments import SampledFlight

STEP = 0.02


def flight(n=60):
    draw = np.random.default_rng(0)
    x = draw.normal(size=(n, 13))
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    return SampledFlight(STEP, x, draw.normal(size=(n, 4)), draw.normal(size=(n, 6)))


class ReadsThePlan:
    """Forecasts [velocity, command] of the plan, so that a test sees what came in."""

    name, step = "spy", STEP

    def initial_memory(self):
        return {}

    def update(self, memory, sample):
        return {"x": sample.x}

    def forecast(self, memory, *, horizon, stride):
        raise AssertionError("a model that reads a plan is given one")

    def forecast_along(self, memory, plan, *, horizon, stride):
        assert (plan.x.shape, plan.u.shape) == ((horizon + 1, 13), (horizon, 4))
        np.testing.assert_array_equal(plan.x[0], memory["x"])
        return constant_forecast(np.hstack([plan.x[1:, 7:10], plan.u[:, :3]]), horizon)


@pytest.mark.parametrize("averaged", [True, False])
def test_a_model_that_reads_a_plan_gets_the_coming_motion(averaged):
    """A label of an instant lies between the steps before and after it."""
    data, horizons = flight(), [1, 5, 20]
    options = {"first": 10, "motion": "known", "averaged": averaged}
    chi_hat = flight_forecasts(ReadsThePlan(), data, horizons, **options)
    of_step = np.hstack([data.x[:, 7:10], data.u[:, :3]])  # of the step that ends at a sample
    label = of_step.copy() if averaged else 0.5 * (of_step + np.vstack([of_step[1:], of_step[-1:]]))
    for i, h in enumerate(horizons):
        count = len(data) - 10 - h
        np.testing.assert_allclose(chi_hat[:count, i], label[10 + h :], atol=1e-12)
        assert np.isnan(chi_hat[count:, i]).all()


def test_a_held_plan_keeps_velocity_attitude_and_command_and_turns_no_more():
    data = flight()
    chi_hat = flight_forecasts(ReadsThePlan(), data, [1, 20], first=10, motion="held")
    now = np.hstack([data.x[10:40, 7:10], data.u[10:40, :3]])
    np.testing.assert_array_equal(chi_hat[:30], np.repeat(now[:, None], 2, axis=1))
    plan = held_plan(data.x[3], data.u[3], steps=5, step=0.1)
    np.testing.assert_allclose(plan.x[5, :3], data.x[3, :3] + 0.5 * data.x[3, 7:10], atol=1e-12)
    np.testing.assert_array_equal(plan.x[5, 3:10], data.x[3, 3:10])
    np.testing.assert_array_equal(plan.x[1:, 10:], 0.0)


def test_persistence_is_the_last_label_there_was():
    data, expected = flight(), flight().chi
    data.chi[20:22], expected[20:22] = np.nan, expected[19]
    chi_hat = flight_forecasts(Hold(step=STEP), data, [1, 7], first=10, motion="known")
    np.testing.assert_allclose(chi_hat[:40], np.stack([expected[10:50]] * 2, axis=1), atol=1e-12)
