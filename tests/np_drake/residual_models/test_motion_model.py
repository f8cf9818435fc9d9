import numpy as np
import pytest

from np_drake.residual_model import Sample
from np_drake.residual_models.motion_model import GaussianProcess, MotionModel, WrenchNetwork
from np_drake.trained_model import Perceptron

RNG = np.random.default_rng(0)
PROCESS = GaussianProcess(
    RNG.normal(size=(9, 6)),
    RNG.normal(size=(9, 6)),
    RNG.uniform(0.5, 2.0, size=(6, 6)),
    RNG.normal(size=6),
)
NETWORK = WrenchNetwork(
    Perceptron(
        (RNG.normal(size=(8, 6)), RNG.normal(size=(6, 8))), (RNG.normal(size=8), RNG.normal(size=6))
    ),
    np.ones(6),
    np.ones(6),
)
MODELS = {"gp": PROCESS, "knode": NETWORK}


@pytest.fixture(params=MODELS)
def dut(request) -> MotionModel:
    return MotionModel(request.param, MODELS[request.param], 0.02, {"samples": 9})


def sample(zeta, chi=(0, 0, 0, 0, 0, 0)) -> Sample:
    return Sample(
        np.concatenate([[0, 0, 1.0, 1, 0, 0, 0], zeta]), np.zeros(4), np.array(chi, float)
    )


def test_every_step_of_the_forecast_is_the_function_at_its_own_motion(dut):
    zeta = RNG.normal(size=(5, 6))
    forecast = dut.forecast(dut.update(dut.initial_memory(), sample(zeta[0])), horizon=5, stride=2)
    expected = np.stack([dut.reaction(z) for z in zeta])
    np.testing.assert_allclose(forecast.rollout(zeta), expected, atol=1e-12)  # round-off
    np.testing.assert_allclose(forecast.first, expected[0], atol=1e-12)


def test_the_jacobian_is_that_of_finite_differences(dut):
    g, zeta, eps = dut.reaction, RNG.normal(size=(50, 6)), 1e-6
    slopes = [(g(zeta + e) - g(zeta - e)) / (2 * eps) for e in eps * np.eye(6)]
    np.testing.assert_allclose(g.jacobian(zeta), np.stack(slopes, axis=-1), atol=1e-6)


def test_the_file_gives_the_model_back(dut, tmp_path):
    path = tmp_path / "model.safetensors"
    dut.save(path)
    found, zeta = MotionModel.load(path), RNG.normal(size=(4, 6))
    assert (found.name, found.step, found.summary) == (dut.name, dut.step, dut.summary)
    np.testing.assert_array_equal(found.reaction(zeta), dut.reaction(zeta))
