"""Laws of the Neural Predictor in flight: of its window, its gaps, and each way of lifting."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.lifting.model.lifted_linear_system import Encoder, LiftedLinearSystem
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, PAPER, LiftedModel
from np_drake.lifting.model.lpv_model import NEURAL_LPV, PARAMETERS, LpvModel
from np_drake.residual_model import Sample
from np_drake.residual_models.lifted_predictor import LiftedLinearPredictor, LiftedPredictor
from np_drake.trained_model import Perceptron

D, STEP = 4, 0.02
A = np.diag([0.9, 0.8, 0.95, 0.7, 0.6, 0.5])
B = 0.1 * np.arange(36.0).reshape(6, 6) / 36
GAP = np.full(6, np.nan)


def last_sample_model() -> LiftedModel:
    """z is chi of the last sample: the true law of `sequence`."""
    E = np.zeros((6, 12 * D))
    E[:, 12 * (D - 1) : 12 * (D - 1) + 6] = np.eye(6)
    system = LiftedLinearSystem(A, B, np.eye(6), STEP)
    return LiftedModel(MODE_DICTIONARY, system, Encoder(E))


def paper_model() -> LiftedModel:
    """z = chi of the last of D samples, through Phi with relu(chi) - relu(-chi)."""
    weights = (np.vstack([np.eye(6), -np.eye(6)]), np.hstack([np.eye(6), -np.eye(6)]))
    model = last_sample_model()
    encoder = Encoder(model.encoder.E, weights)
    return dc.replace(model, configuration=PAPER, encoder=encoder, refit=40, ridge=1.0)


def sequence(n: int) -> list[Sample]:
    """Samples of chi+ = A chi + B zeta."""
    generator, chi, samples = np.random.default_rng(0), np.ones(6), []
    for _ in range(n):
        place, zeta = generator.standard_normal(3), generator.standard_normal(6)
        samples.append(Sample(np.concatenate([place, [1, 0, 0, 0], zeta]), np.zeros(4), chi))
        chi = A @ chi + B @ zeta
    return samples


def fed(dut: LiftedLinearPredictor, samples: list[Sample]) -> dict[str, np.ndarray]:
    memory = dut.initial_memory()
    for sample in samples:
        memory = dut.update(memory, sample)
    return memory


def without(samples: list[Sample], numbers) -> list[Sample]:
    return [dc.replace(s, chi=GAP) if k in numbers else s for k, s in enumerate(samples)]


def test_the_forecast_is_the_law_of_the_data():
    samples, dut = sequence(30), LiftedPredictor(last_sample_model())
    forecast = dut.forecast(fed(dut, samples[:20]), horizon=10, stride=1)
    zeta, truth = (
        np.array([part(s) for s in samples[19:29]]) for part in (lambda s: s.x[7:], lambda s: s.chi)
    )
    np.testing.assert_allclose(forecast.rollout(zeta), truth, atol=1e-12)


def test_what_is_not_lifted_yet_or_not_read_is_held():
    model, samples = last_sample_model(), sequence(30)
    C = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    dut = LiftedPredictor(dc.replace(model, system=dc.replace(model.system, C=C)))
    held, blend = samples[0].chi, 1 - np.exp(-2 * np.pi * 4.0 * STEP)
    for n, sample in enumerate(samples, start=1):
        held = held + max(blend, 1 / n) * (sample.chi - held)
        forecast = dut.forecast(fed(dut, samples[:n]), horizon=6, stride=2)
        chi = forecast.rollout(np.ones((6, 6)))
        own = 6 if n < D else 3
        np.testing.assert_allclose(chi[:, -own:], np.tile(held[-own:], (6, 1)), atol=1e-12)
        if n >= D:
            np.testing.assert_allclose(chi[0, :3], sample.chi[:3], atol=1e-12)


def test_a_dropped_label_is_filled_with_the_own_prediction():
    """The model knows the law: a few gaps change nothing."""
    dut, samples = LiftedPredictor(last_sample_model()), sequence(20)
    memory = fed(dut, without(samples, (9, 13, 18, 19)))
    np.testing.assert_allclose(memory["z"], fed(dut, samples)["z"], atol=1e-12)
    assert (memory["labels"], memory["gap"]) == (16, 2)


def test_a_long_gap_starts_the_window_afresh():
    dut, holed = LiftedPredictor(last_sample_model()), without(sequence(40), range(20, 20 + D))
    counts = [fed(dut, holed[:n])["count"][0] for n in (20 + D - 1, 20 + D, 20 + 2 * D)]
    assert counts == [D, 0, D]
    before, after = fed(dut, holed[:20]), fed(dut, holed[: 20 + D])
    held = dut.forecast(after, horizon=1, stride=1).first
    np.testing.assert_array_equal(held, before["lowpass"])


def lpv_model() -> LpvModel:
    """Of random weights."""
    draw = np.random.default_rng(0).normal
    arrays = [draw(size=s) for s in ((2, 7, 80), (2, 3, 40), 80, 7, (2, 3, 20), (4, 80))]
    network = Perceptron((draw(size=(2 + PARAMETERS, 55)),), (draw(size=2 + PARAMETERS),))
    return LpvModel(STEP, np.ones(12), *arrays, network)


MODELS = {"delay": last_sample_model(), PAPER: paper_model(), NEURAL_LPV: lpv_model()}
EVERY = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


@given(st.lists(st.sampled_from(["good", "label", "state", "both", "huge"]), max_size=60))
@settings(max_examples=20)
@EVERY
def test_no_samples_make_the_forecast_unusable_or_change_a_memory(model, course):
    dut = LiftedLinearPredictor.of(model)
    memory = dut.initial_memory()
    for kind, sample in zip(course, sequence(len(course)), strict=True):
        chi = GAP if kind in ("label", "both") else sample.chi * (1e3 if kind == "huge" else 1.0)
        x = np.full(13, np.nan) if kind in ("state", "both") else sample.x
        before = {name: value.copy() for name, value in memory.items()}
        new = dut.update(memory, Sample(x, sample.u, chi))
        for name, value in before.items():
            np.testing.assert_array_equal(memory[name], value)
            assert new[name].shape == value.shape
        memory = new
        assert np.abs(np.linalg.eigvals(dut.system(memory).A)).max() <= 1.0
    chi = dut.forecast(memory, horizon=400, stride=1).rollout(np.zeros((400, 6)))
    assert np.all(np.isfinite(chi))


def test_a_scheduled_model_forecasts_through_a_gap():
    dut, samples = LiftedLinearPredictor.of(lpv_model()), without(sequence(101), range(1, 101))
    first, zeta = fed(dut, samples[:1]), np.array([s.x[7:] for s in samples[:100]])
    assert not dut.forecast(dut.initial_memory(), horizon=100, stride=1).rollout(zeta).any()
    ahead = dut.forecast(first, horizon=100, stride=1).rollout(zeta)[1:]
    np.testing.assert_allclose(fed(dut, samples[:100])["window"][1:, :6], ahead, rtol=1e-9)
    afresh = fed(dut, [*samples, samples[0]])
    for name in ("window", "z", "theta", "energy", "count"):
        np.testing.assert_array_equal(afresh[name], first[name])


def test_what_flies_is_the_batch_solution_of_the_last_window():
    """Ridge regression of forty samples, holes filled, each lifted once and long ago."""
    dut, samples = LiftedPredictor(paper_model()), sequence(150)
    memory = fed(dut, without(samples, (60, 61, 130)))
    z, zeta = memory["rows"][:, :6], memory["rows"][:, 6:]  # zeta unscaled
    np.testing.assert_allclose(z, [sample.chi for sample in samples[-40:]], atol=1e-9)
    np.testing.assert_array_equal(zeta, [sample.x[7:] for sample in samples[-40:]])
    X, prior = np.vstack([np.hstack([z[:-1], zeta[:-1]]), np.eye(12)]), np.hstack([A, B]).T
    expected = np.linalg.lstsq(X, np.vstack([z[1:], prior]), rcond=None)[0].T
    np.testing.assert_allclose(np.hstack([memory["A"], memory["B"]]), expected, atol=1e-10)
    np.testing.assert_allclose(memory["z"], z[-1], atol=1e-12)
