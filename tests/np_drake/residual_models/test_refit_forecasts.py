"""Laws of the forecasts of a whole flight with a refit at every sample."""

import numpy as np
import pytest

from np_drake.lifting.model.encoders import Phi
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.model.lifted_model import PAPER, LiftedModel
from np_drake.residual_models.neural_predictor import NeuralPredictor, PredictorOptions
from np_drake.skill.flight_skill import window_stability
from np_drake.skill.skill import model_predictions

W = 12  # samples of the window


def model(late: int = 0) -> LiftedModel:
    generator = np.random.default_rng(0)
    phi = Phi(
        (generator.standard_normal((12, 6)), 0.3 * generator.standard_normal((8, 12))), np.ones(6)
    )
    A = np.linalg.qr(generator.standard_normal((8, 8)))[0] * 0.98
    system = LiftedLinearSystem(
        A, generator.standard_normal((8, 6)), generator.standard_normal((6, 8)), 0.02
    )
    return LiftedModel(PAPER, system, phi, W, np.ones(6), np.ones(6), True, ridge=0.1, late=late)


@pytest.fixture(scope="module")
def flight():
    """chi, zeta (60, 6)"""
    t = 0.02 * np.arange(60)[:, None]
    return np.sin(t * np.arange(1, 7)), np.cos(t * np.arange(7, 13))


@pytest.mark.parametrize("torque", ["hold", "predict"])
@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("late, refit", [(0, True), (2, True), (2, False)])
def test_the_flight_at_once_is_the_flight_sample_by_sample(flight, torque, known, late, refit):
    dut = NeuralPredictor(model(late), PredictorOptions(torque=torque, refit=refit))
    origins, horizons = np.arange(W - 1, 50), [0, 1, 7]
    at_once = model_predictions(dut, *flight, origins, horizons, zeta_known=known)
    one_by_one = model_predictions(dut, *flight, origins, horizons, zeta_known=known, at_once=False)
    np.testing.assert_allclose(at_once, one_by_one, atol=1e-8)


def test_every_window_is_counted_and_none_is_unstable(flight):
    found = window_stability(NeuralPredictor(model()), *flight)
    assert (found.windows, found.unstable) == (60 - W + 1, 0)
    assert 0 < found.largest <= 1.0
    assert 0 <= found.pulled <= found.windows


def test_an_offline_operator_is_one_and_the_same_in_every_window(flight):
    dut = NeuralPredictor(model(), PredictorOptions(refit=False))
    found = window_stability(dut, *flight)
    assert (found.windows, found.unstable, found.pulled) == (60 - W + 1, 0, 0)
    assert found.largest == pytest.approx(0.98)


def test_an_unstable_operator_is_counted(flight):
    """The law can fail."""
    broken = model()
    broken.system.A[:] *= 1.05 / 0.98
    found = window_stability(NeuralPredictor(broken, PredictorOptions(refit=False)), *flight)
    assert found.unstable == found.windows == 60 - W + 1
