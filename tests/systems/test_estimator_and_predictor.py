"""Laws of the estimator of the wrench and of predictors as systems."""

import dataclasses as dc
from pathlib import Path

import numpy as np
import pytest

from np_drake import rigid_body
from np_drake.labels import LabelConfig, LabelFilter
from np_drake.lifting.model.lifted_linear_system import Encoder, LiftedLinearSystem
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, PAPER, LiftedModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_model import Plan, ReadsPlan, Sample, constant_forecast
from np_drake.residual_models.hold import Hold
from np_drake.residual_models.lifted_predictor import LiftedLinearPredictor, LiftedPredictor
from np_drake.vehicle import Vehicle
from systems.neural_predictor import NeuralPredictor
from systems.residual_predictor import ResidualPredictor
from systems.wrench_estimator import WrenchEstimator
from tests.systems.conftest import event

PACKAGED = Path(__file__).parents[2] / "diagrams" / "models" / "payload_filter.safetensors"
VEHICLE = Vehicle()
LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0])
CHI = np.array([0.5, -0.3, -2.5, 0.01, -0.02, 0.005])


def estimator():
    dut = WrenchEstimator(VEHICLE, LabelConfig(), step=0.02)
    context = dut.CreateDefaultContext()
    rate = rigid_body.state_derivative(VEHICLE, LEVEL, VEHICLE.hover_input, CHI)
    dut.GetInputPort("x").FixValue(context, LEVEL)
    dut.GetInputPort("acceleration").FixValue(context, np.concatenate([rate[7:10], rate[10:13]]))
    dut.GetInputPort("u").FixValue(context, VEHICLE.hover_input)
    return dut, context


def test_estimator_is_the_label_filter_in_a_context():
    dut, context = estimator()
    pure, rng = LabelFilter(VEHICLE, LabelConfig(), step=0.02), np.random.default_rng(0)
    memory = pure.initial_memory()
    good = dut.GetInputPort("acceleration").Eval(context).copy()
    for acceleration in (good, good, np.full(6, np.nan), good, good):
        u = VEHICLE.hover_input + rng.normal(size=4)
        dut.GetInputPort("u").FixValue(context, u)
        dut.GetInputPort("acceleration").FixValue(context, acceleration)
        memory, expected = pure.step(memory, x=LEVEL, a=acceleration[:3], al=acceleration[3:], u=u)
        event(dut, context)
        np.testing.assert_allclose(
            dut.GetOutputPort("last_label").Eval(context), expected, atol=1e-14
        )


def on_labels(dut):
    context = dut.CreateDefaultContext()
    dut.GetInputPort("x").FixValue(context, LEVEL)
    dut.GetInputPort("u").FixValue(context, VEHICLE.hover_input)
    dut.GetInputPort("label").FixValue(context, CHI)
    return dut, context


def hold_on_labels():
    return on_labels(ResidualPredictor(Hold(step=0.02), horizon=4, stride=2))


def test_forecast_feeds_through_and_chi_hat_waits_for_the_event():
    dut, context = hold_on_labels()
    np.testing.assert_allclose(dut.GetOutputPort("forecast").Eval(context).first, CHI)
    np.testing.assert_allclose(dut.GetOutputPort("chi_hat").Eval(context), 0.0)
    event(dut, context)
    np.testing.assert_allclose(dut.GetOutputPort("chi_hat").Eval(context), CHI)


D, N, STRIDE = 3, 4, 2
HOVER = np.tile(LEVEL, (N + 1, 1)), np.tile(VEHICLE.hover_input, (N, 1))


def lifted_predictor():
    """Of the last samples; its model keeps a window of D."""
    rng = np.random.default_rng(0)
    system = LiftedLinearSystem(0.9 * np.eye(6), 0.1 * np.eye(6), np.eye(6), 0.02)
    encoder = Encoder(rng.normal(size=(6, 12 * D)))
    return LiftedPredictor(LiftedModel(MODE_DICTIONARY, system, encoder))


def packaged():
    return PayloadFilter.load(PACKAGED)


def predictor_on_labels(make=packaged):
    model = make()
    system = NeuralPredictor if isinstance(model, LiftedLinearPredictor) else ResidualPredictor
    dut, context = on_labels(system(model, horizon=N, stride=STRIDE))
    for name, values in zip(("plan_x", "plan_u"), HOVER, strict=True):
        if dut.HasInputPort(name):
            dut.GetInputPort(name).FixValue(context, values.ravel())
    return dut, context


@pytest.mark.parametrize("make", [packaged, lifted_predictor])
def test_a_predictor_is_its_model_in_a_context(make):
    dut, context = predictor_on_labels(make)
    model = make()
    memory, rng = model.initial_memory(), np.random.default_rng(1)
    for chi in CHI + 0.1 * rng.normal(size=(60, 6)):
        memory = model.update(memory, Sample(LEVEL, VEHICLE.hover_input, chi))
        dut.GetInputPort("label").FixValue(context, chi)
        event(dut, context)
    if isinstance(model, ReadsPlan):
        expected = model.forecast_along(memory, Plan(*HOVER), horizon=N, stride=STRIDE).first
    else:
        expected = model.forecast(memory, horizon=N, stride=STRIDE).first
    np.testing.assert_allclose(dut.GetOutputPort("chi_hat").Eval(context), expected, atol=1e-12)
    state = dut.memory(context)
    assert {n: v.shape for n, v in state.items()} == {n: np.shape(v) for n, v in memory.items()}
    if isinstance(dut, NeuralPredictor):
        for index, name in ((dut.z_index, "z"), (dut.window_index, "window")):
            found = context.get_discrete_state(index).value()
            np.testing.assert_allclose(found, memory[name].ravel(), atol=1e-12)


def test_one_step_of_the_context_is_a_step_of_the_lifted_linear_system():
    """Labels of an exact lifted linear system, through a network, refit in flight."""
    rng, eye = np.random.default_rng(0), np.eye(6)
    law = LiftedLinearSystem(np.diag(rng.uniform(0.5, 0.9, 6)), rng.normal(size=(6, 6)), eye, 0.02)
    E, weights = np.eye(6, 12 * D, 12 * (D - 1)), (np.vstack([eye, -eye]), np.hstack([eye, -eye]))
    encoder = Encoder(E, weights)
    model = LiftedPredictor(LiftedModel(PAPER, law, encoder, refit=8, ridge=1.0))
    dut, context = on_labels(NeuralPredictor(model, horizon=2, stride=1))
    chi, before = CHI, np.zeros(6)
    for k, zeta in enumerate(rng.normal(size=(20, 6))):
        system = dut.GetOutputPort("lifted_linear_system").Eval(context)
        chi = law.A @ chi + law.B @ before
        if k > D:
            z = context.get_discrete_state(dut.z_index).value()
            np.testing.assert_allclose(system.A @ z + system.B @ before, chi, atol=1e-12)
        before = zeta
        dut.GetInputPort("x").FixValue(context, np.concatenate([LEVEL[:7], zeta]))
        dut.GetInputPort("label").FixValue(context, chi)
        event(dut, context)
    np.testing.assert_allclose(context.get_discrete_state(dut.z_index).value(), chi, atol=1e-12)


@pytest.mark.parametrize(
    "make, port, output",
    [
        (estimator, "u", "last_label"),
        (hold_on_labels, "label", "chi_hat"),
        (predictor_on_labels, "label", "chi_hat"),
    ],
)
def test_two_contexts_of_one_system_never_influence_each_other(make, port, output):
    def fly(context, inputs):
        for value in inputs:
            dut.GetInputPort(port).FixValue(context, value)
            event(dut, context)
            yield dut.GetOutputPort(output).Eval(context).copy()

    dut, first = make()
    second = dut.CreateDefaultContext()
    for i in range(dut.num_input_ports()):
        dut.get_input_port(i).FixValue(second, dut.get_input_port(i).Eval(first))
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(2, 70, dut.GetInputPort(port).size()))
    alone = list(fly(first.Clone(), one))
    interleaved = [a for a, _ in zip(fly(first, one), fly(second, other), strict=True)]
    np.testing.assert_array_equal(interleaved, alone)


@dc.dataclass
class FollowsThePlan:
    """Forecasts what is planned: the force is the velocity, the torque that of the command."""

    name: str = "follower"
    step: float = 0.02

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
