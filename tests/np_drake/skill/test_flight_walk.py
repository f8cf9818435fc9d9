import numpy as np
import pytest

from np_drake.residual_model import constant_forecast
from np_drake.residual_models.hold import Hold
from np_drake.residual_models.linear_baselines import fit_dmdc
from np_drake.skill.skill import flight_forecasts, held_plan
from np_drake.training_data.segments import Segment
from np_drake.training_data.training_segments import SampledFlight

STEP = 0.02


def flight(n=60, seed=0):
    draw = np.random.default_rng(seed)
    x = draw.normal(size=(n, 13))
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    return SampledFlight(STEP, x, draw.normal(size=(n, 4)), draw.normal(size=(n, 6)))


class ReadsThePlan:
    """Forecasts [velocity, command, its own zeta] of the plan, so that a test sees what came in."""

    name, step = "spy", STEP

    def initial_memory(self):
        return {}

    def update(self, memory, sample):
        return {"x": sample.x}

    def forecast(self, memory, *, horizon, stride):
        raise AssertionError("a model that reads a plan is given one")

    def forecast_along(self, memory, plan, *, horizon, stride):
        assert plan.x.shape == (horizon + 1, 13)
        assert plan.u.shape == (horizon, 4)
        np.testing.assert_array_equal(plan.x[0], memory["x"])
        return constant_forecast(np.hstack([plan.x[1:, 7:10], plan.u[:, :3]]), horizon)


def test_a_model_that_reads_a_plan_gets_the_coming_motion():
    data, horizons = flight(), [1, 5, 20]
    chi_hat = flight_forecasts(ReadsThePlan(), data, horizons, first=10, motion="known")
    for i, h in enumerate(horizons):  # chi_(h - 1) is of the step that ends h samples ahead
        coming = slice(10 + h, len(data))
        got = chi_hat[: len(data) - 10 - h, i]
        np.testing.assert_array_equal(got, np.hstack([data.x[coming, 7:10], data.u[coming, :3]]))
        assert np.isnan(chi_hat[len(data) - 10 - h :, i]).all()


def test_a_label_of_an_instant_lies_between_the_steps_before_and_after_it():
    data, horizons = flight(), [1, 5, 20]
    chi_hat = flight_forecasts(
        ReadsThePlan(), data, horizons, first=10, motion="known", averaged=False
    )
    of_step = np.hstack([data.x[:, 7:10], data.u[:, :3]])  # of the step that ends at a sample
    for i, h in enumerate(horizons):
        got = chi_hat[: len(data) - 11 - h, i]  # the last has no step after it
        np.testing.assert_allclose(
            got, 0.5 * (of_step[10 + h : -1] + of_step[11 + h :]), atol=1e-12
        )
        np.testing.assert_array_equal(chi_hat[len(data) - 11 - h, i], of_step[-1])


def test_a_plan_tells_nothing_of_the_label_of_now():
    with pytest.raises(ValueError, match="must be 1 or more"):
        flight_forecasts(ReadsThePlan(), flight(), [0, 1], first=10, motion="known")


def test_a_held_plan_keeps_velocity_attitude_and_command_and_turns_no_more():
    data = flight()
    chi_hat = flight_forecasts(ReadsThePlan(), data, [1, 20], first=10, motion="held")
    now = np.hstack([data.x[10:40, 7:10], data.u[10:40, :3]])
    np.testing.assert_array_equal(chi_hat[:30], np.repeat(now[:, None], 2, axis=1))
    plan = held_plan(data.x[3], data.u[3], steps=5, step=0.1)
    np.testing.assert_allclose(plan.x[5, :3], data.x[3, :3] + 0.5 * data.x[3, 7:10], atol=1e-12)
    np.testing.assert_array_equal(plan.x[5, 3:10], data.x[3, 3:10])
    np.testing.assert_array_equal(plan.x[1:, 10:], 0.0)


def test_persistence_is_the_label_of_the_origin():
    data = flight()
    chi_hat = flight_forecasts(Hold(step=STEP), data, [1, 7], first=10, motion="known")
    np.testing.assert_allclose(
        chi_hat[:40], np.repeat(data.chi[10:50, None], 2, axis=1), atol=1e-12
    )


def test_in_a_gap_persistence_keeps_the_last_label():
    data = flight()
    data.chi[20:22] = np.nan
    chi_hat = flight_forecasts(Hold(step=STEP), data, [1], first=10, motion="known")
    np.testing.assert_allclose(chi_hat[[10, 11], 0], data.chi[[19, 19]], atol=1e-12)


@pytest.mark.parametrize("motion", ["known", "held"])
def test_a_flight_at_once_is_a_flight_sample_by_sample(motion):
    data = flight()
    dut = fit_dmdc(
        [Segment(data.chi, data.zeta, STEP), Segment(data.chi[::-1], data.zeta[::-1], STEP)],
        delays=2,
    )
    assert dut.along(data.chi, data.zeta) is not None
    at_once = flight_forecasts(dut, data, [1, 5], first=10, motion=motion)
    one_by_one = flight_forecasts(_Fed(dut), data, [1, 5], first=10, motion=motion)
    np.testing.assert_allclose(at_once, one_by_one, rtol=1e-9, atol=1e-12)


class _Fed:
    """A model without its shortcut for whole flights."""

    def __init__(self, model):
        self.name, self.step = model.name, model.step
        self.initial_memory, self.update, self.forecast = (
            model.initial_memory,
            model.update,
            model.forecast,
        )


def test_an_unknown_motion_is_refused():
    with pytest.raises(ValueError, match="must be known"):
        flight_forecasts(Hold(step=STEP), flight(), [1], first=10, motion="guessed")
