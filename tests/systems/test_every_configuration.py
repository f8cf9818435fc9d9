"""Every configuration of the Neural Predictor is one LeafSystem."""

import numpy as np
import pytest

from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, NEURAL
from np_drake.lifting.training.train import CONFIGURATIONS, make_config, train
from np_drake.residual_model import Sample
from np_drake.residual_models.neural_predictor import NeuralPredictor as NeuralPredictorModel
from np_drake.training_data.segments import Segment
from np_drake.vehicle import Vehicle
from systems.neural_predictor import NeuralPredictor

STEP, HORIZON, STRIDE = 0.02, 5, 2
U = Vehicle().hover_input
SMALL = {"paper": {"epochs": 1}, "lifted": {"steps": 20}, "neural": {"steps": 20, "updates": 5}}
TRAINED: dict[str, NeuralPredictorModel] = {}


def swinging(seed: int, n: int = 500) -> Segment:
    """A level and a drag in force, motion of a few sines."""
    t, generator = STEP * np.arange(n)[:, None], np.random.default_rng(seed)
    zeta = sum(np.sin(w * t + generator.uniform(0, 6.3, 6)) for w in (0.9, 2.1, 4.7))
    chi = np.hstack([[0, 0, -2.5] - 0.4 * zeta[:, :3], 0.02 * np.roll(zeta, 5, axis=0)[:, 3:]])
    return Segment(chi + 0.01 * generator.standard_normal((n, 6)), zeta, STEP)


@pytest.fixture(params=CONFIGURATIONS)
def model(request) -> NeuralPredictorModel:
    """The configuration of that name, trained once."""
    name = request.param
    if name not in TRAINED:
        frame = "body" if name == MODE_DICTIONARY else "world"
        config = make_config(name, frame=frame, **SMALL.get(name, {}))
        TRAINED[name] = NeuralPredictorModel(
            train([swinging(i) for i in range(10 if name == NEURAL else 1)], config).model
        )
    return TRAINED[name]


def samples(seed: int, n: int) -> list[Sample]:
    made = swinging(seed, n)
    return [
        Sample(np.concatenate([[0, 0, 1.0, 1, 0, 0, 0], v]), U, c)
        for c, v in zip(made.chi, made.zeta, strict=True)
    ]


def feed(dut: NeuralPredictor, context, sample: Sample) -> None:
    """Fixes the ports and runs the periodic update once."""
    for port, value in (("x", sample.x), ("u", sample.u), ("label", sample.chi)):
        dut.GetInputPort(port).FixValue(context, value)
    context.SetDiscreteState(dut.EvalUniquePeriodicDiscreteUpdate(context))


def test_it_is_its_model_in_a_context(model):
    dut = NeuralPredictor(model, horizon=HORIZON, stride=STRIDE)
    context, memory = dut.CreateDefaultContext(), model.initial_memory()
    flown = samples(1, model.model.window + 4)
    for sample in flown:
        memory = model.update(memory, sample)
        feed(dut, context, sample)
    expected = model.forecast(memory, horizon=HORIZON, stride=STRIDE)
    np.testing.assert_allclose(
        dut.GetOutputPort("chi_hat").Eval(context), expected.first, atol=1e-12
    )
    state = dut.memory(context)
    assert {name: value.shape for name, value in state.items()} == {
        k: np.shape(v) for k, v in memory.items()
    }
    np.testing.assert_allclose(state["z"], memory["z"], atol=1e-12)
    np.testing.assert_array_equal(
        state["window"][:, :6], [s.chi for s in flown[-model.model.window :]]
    )
