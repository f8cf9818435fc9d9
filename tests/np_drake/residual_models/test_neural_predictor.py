import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.lifting.model.encoders import DelayEncoder, Phi
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.model.lifted_model import DELAY_DMDC, PAPER, LiftedModel
from np_drake.lifting.model.model_file import save_model
from np_drake.residual_model import Sample
from np_drake.residual_models.neural_predictor import NeuralPredictor, PredictorOptions

D, STEP = 4, 0.02
A = np.diag([0.9, 0.8, 0.95, 0.7, 0.6, 0.5])
B = 0.1 * np.arange(36.0).reshape(6, 6) / 36
GAP = np.full(6, np.nan)


def last_sample_model(torque: bool = True) -> LiftedModel:
    """z is chi of the last sample: the true law of `sequence`."""
    E = np.zeros((6, 12 * D))
    E[:, 12 * (D - 1) : 12 * (D - 1) + 6] = np.eye(6)
    system = LiftedLinearSystem(A, B, np.eye(6), STEP)
    return LiftedModel(DELAY_DMDC, system, DelayEncoder(E, D), D, np.ones(6), np.ones(6), torque)


def paper_model() -> LiftedModel:
    """z = [chi, 0] through Phi with relu(chi) - relu(-chi)."""
    weights = (np.vstack([np.eye(6), -np.eye(6)]), np.hstack([np.eye(6), -np.eye(6)]))
    system = LiftedLinearSystem(A, B, np.eye(6), STEP)
    return LiftedModel(
        PAPER, system, Phi(weights, np.ones(6)), 40, np.ones(6), np.ones(6), True, ridge=1.0
    )


def sequence(n: int, seed: int = 0) -> list[Sample]:
    """Samples of chi+ = A chi + B zeta."""
    generator, chi, samples = np.random.default_rng(seed), np.ones(6), []
    for _ in range(n):
        x = np.concatenate(
            [generator.standard_normal(3), [1, 0, 0, 0], generator.standard_normal(6)]
        )
        samples.append(Sample(x, np.zeros(4), chi))
        chi = A @ chi + B @ x[7:]
    return samples


def fed(dut: NeuralPredictor, samples: list[Sample]) -> dict[str, np.ndarray]:
    memory = dut.initial_memory()
    for sample in samples:
        memory = dut.update(memory, sample)
    return memory


PREDICT = PredictorOptions(torque="predict")


def test_the_forecast_is_the_law_of_the_data():
    samples = sequence(30)
    forecast = NeuralPredictor(last_sample_model(), PREDICT).forecast(
        fed(NeuralPredictor(last_sample_model(), PREDICT), samples[:20]), horizon=10, stride=1
    )
    zeta = np.array([sample.x[7:] for sample in samples[19:29]])
    truth = np.array([sample.chi for sample in samples[19:29]])
    np.testing.assert_allclose(forecast.rollout(zeta), truth, atol=1e-12)


@pytest.mark.parametrize("stride", [1, 2, 5])
def test_a_long_step_is_many_short_ones_under_held_zeta(stride):
    dut = NeuralPredictor(last_sample_model(), PREDICT)
    memory, zeta = fed(dut, sequence(10)), np.random.default_rng(0).standard_normal((4, 6))
    fine = dut.forecast(memory, horizon=4 * stride, stride=1).rollout(
        np.repeat(zeta, stride, axis=0)
    )
    coarse = dut.forecast(memory, horizon=4, stride=stride).rollout(zeta)
    np.testing.assert_allclose(coarse, fine[::stride], atol=1e-12)


def test_before_any_label_the_forecast_is_zero():
    dut = NeuralPredictor(last_sample_model())
    for memory in (dut.initial_memory(), fed(dut, [dc.replace(s, chi=GAP) for s in sequence(9)])):
        assert not dut.forecast(memory, horizon=5, stride=1).rollout(np.ones((5, 6))).any()


def test_before_the_window_is_full_the_mean_of_the_labels_is_held():
    slow = PredictorOptions(cutoff=0.5)  # [Hz], so the low-pass still averages
    dut, samples = NeuralPredictor(last_sample_model(), slow), sequence(D - 1)
    forecast = dut.forecast(fed(dut, samples), horizon=5, stride=2)
    mean = np.mean([sample.chi for sample in samples], axis=0)
    np.testing.assert_allclose(forecast.rollout(np.ones((5, 6))), np.tile(mean, (5, 1)), atol=1e-12)
    full = dut.forecast(fed(dut, sequence(D)), horizon=5, stride=2)
    assert [np.shape(m) for m in (full.A, full.B, full.z)] == [
        np.shape(m) for m in (forecast.A, forecast.B, forecast.z)
    ]


def test_torque_is_held_at_its_low_pass_unless_predicted():
    dut, samples = NeuralPredictor(last_sample_model()), sequence(30)
    chi = dut.forecast(fed(dut, samples), horizon=6, stride=1).rollout(np.ones((6, 6)))
    held, blend = samples[0].chi[3:], 1 - np.exp(-2 * np.pi * 4.0 * STEP)
    for n, sample in enumerate(samples, start=1):
        held = held + max(blend, 1 / n) * (sample.chi[3:] - held)
    np.testing.assert_allclose(chi[:, 3:], np.tile(held, (6, 1)), atol=1e-12)
    np.testing.assert_allclose(chi[0, :3], samples[-1].chi[:3], atol=1e-12)
    np.testing.assert_allclose(dut.chi_hat(fed(dut, samples)), chi[0], atol=1e-12)


def test_a_dropped_label_is_filled_with_the_own_prediction():
    """The model knows the law: a few gaps change nothing."""
    dut, samples = NeuralPredictor(last_sample_model(), PREDICT), sequence(20)
    holed = [dc.replace(s, chi=GAP) if k in (9, 13, 18, 19) else s for k, s in enumerate(samples)]
    memory = fed(dut, holed)
    np.testing.assert_allclose(memory["z"], fed(dut, samples)["z"], atol=1e-12)
    assert memory["dropped"] == 4
    assert memory["labels"] == 16
    assert memory["gap"] == 2


def test_a_dropped_state_is_filled_with_the_last_zeta():
    dut, samples = NeuralPredictor(last_sample_model()), sequence(10)
    memory = fed(dut, samples[:9])
    lost = dut.update(memory, dc.replace(samples[9], x=np.full(13, np.nan)))
    np.testing.assert_array_equal(lost["window"][-1, 6:], samples[8].x[7:])
    np.testing.assert_array_equal(lost["window"][-1, :6], samples[9].chi)
    assert lost["dropped"] == 1


def test_a_long_gap_starts_the_window_afresh():
    dut, samples = NeuralPredictor(last_sample_model()), sequence(40)
    holed = [dc.replace(s, chi=GAP) if 20 <= k < 20 + D else s for k, s in enumerate(samples)]
    assert fed(dut, holed[: 20 + D - 1])["count"] == D
    assert fed(dut, holed[: 20 + D])["count"] == 0
    before = fed(dut, holed[:20])["lowpass"]
    np.testing.assert_array_equal(dut.chi_hat(fed(dut, holed[: 20 + D])), before)
    assert fed(dut, holed[: 20 + 2 * D])["count"] == D


@given(st.lists(st.sampled_from(["good", "label", "state", "both", "huge"]), max_size=60))
@settings(max_examples=40)
@pytest.mark.parametrize("model", [last_sample_model(), paper_model()], ids=[DELAY_DMDC, PAPER])
def test_no_course_of_samples_makes_the_forecast_unusable(model, course):
    dut = NeuralPredictor(model)
    memory = dut.initial_memory()
    shapes = {name: value.shape for name, value in memory.items()}
    for kind, sample in zip(course, sequence(len(course)), strict=True):
        chi = GAP if kind in ("label", "both") else sample.chi * (1e3 if kind == "huge" else 1.0)
        x = np.full(13, np.nan) if kind in ("state", "both") else sample.x
        memory = dut.update(memory, Sample(x, sample.u, chi))
        assert {name: value.shape for name, value in memory.items()} == shapes
        forecast = dut.forecast(memory, horizon=400, stride=1)
        assert np.abs(np.linalg.eigvals(forecast.A)).max() <= 1.0
    chi = dut.forecast(memory, horizon=400, stride=1).rollout(np.zeros((400, 6)))
    assert np.all(np.isfinite(chi))


@pytest.mark.parametrize("model", [last_sample_model(), paper_model()], ids=[DELAY_DMDC, PAPER])
def test_updates_are_pure(model):
    dut, samples = NeuralPredictor(model), sequence(60)
    memory = fed(dut, samples[:50])
    copy = {name: value.copy() for name, value in memory.items()}
    once, again = dut.update(memory, samples[50]), dut.update(memory, samples[50])
    for name in memory:
        np.testing.assert_array_equal(memory[name], copy[name])
        np.testing.assert_array_equal(once[name], again[name])


def test_on_its_own_prior_the_refit_changes_nothing():
    dut = NeuralPredictor(paper_model(), PREDICT)
    memory = fed(dut, sequence(60))
    np.testing.assert_allclose(memory["A"], A, atol=1e-9)
    np.testing.assert_allclose(memory["B"], B, atol=1e-9)


def test_what_flies_is_the_batch_solution_of_the_last_window():
    """Ridge regression of the window as it stands, holes filled, though every sample was lifted
    once and long ago.
    """
    model, samples = paper_model(), sequence(150)
    holed = [dc.replace(s, chi=GAP) if k in (60, 61, 130) else s for k, s in enumerate(samples)]
    memory = fed(NeuralPredictor(model, PREDICT), holed)
    window, prior = memory["window"], np.hstack([A, B]).T
    z = model.encoder(window[:, :6])
    X = np.vstack([np.hstack([z[:-1], window[:-1, 6:]]), np.eye(12)])  # ridge 1, zeta unscaled
    expected = np.linalg.lstsq(X, np.vstack([z[1:], prior]), rcond=None)[0].T
    np.testing.assert_allclose(np.hstack([memory["A"], memory["B"]]), expected, atol=1e-10)
    np.testing.assert_allclose(memory["z"], z[-1], atol=1e-12)


def test_the_refit_follows_a_changed_law():
    wrong = dc.replace(paper_model(), system=LiftedLinearSystem(0.5 * A, 0 * B, np.eye(6), STEP))
    samples, dut = sequence(60), NeuralPredictor(dc.replace(wrong, ridge=1e-6), PREDICT)
    np.testing.assert_allclose(fed(dut, samples)["A"], A, atol=5e-3)  # the ridge still pulls
    fixed = NeuralPredictor(wrong, PredictorOptions("predict", refit=False))
    np.testing.assert_array_equal(fixed.system(fed(fixed, samples)).A, 0.5 * A)


@pytest.mark.parametrize("late", [1, 3])
@pytest.mark.parametrize("refit", [True, False])
def test_a_label_that_is_late_gives_the_wrench_of_now(late, refit):
    """Labels of an exact lifted linear system come late, one of them not at all."""
    model = dc.replace(paper_model(), window=40 + late, late=late)
    now = sequence(60)
    late_ones = [dc.replace(s, chi=now[max(k - late, 0)].chi) for k, s in enumerate(now)]
    late_ones[55] = dc.replace(late_ones[55], chi=GAP)
    dut = NeuralPredictor(model, PredictorOptions("predict", refit=refit))
    np.testing.assert_allclose(dut.chi_hat(fed(dut, late_ones)), now[-1].chi, atol=1e-9)


def test_a_model_file_flies(tmp_path):
    save_model(last_sample_model(), tmp_path / "m.safetensors")
    dut, samples = NeuralPredictor.load(tmp_path / "m.safetensors"), sequence(10)
    expected = NeuralPredictor(last_sample_model()).chi_hat(fed(dut, samples))
    np.testing.assert_array_equal(dut.chi_hat(fed(dut, samples)), expected)


def test_impossible_options_are_refused():
    with pytest.raises(ValueError, match=r"hold \| predict; got none"):
        NeuralPredictor(last_sample_model(), PredictorOptions(torque="none"))
    with pytest.raises(ValueError, match="trained without"):
        NeuralPredictor(last_sample_model(torque=False), PREDICT)
    with pytest.raises(ValueError, match="must be Phi"):
        NeuralPredictor(last_sample_model(), PredictorOptions(refit=True))
