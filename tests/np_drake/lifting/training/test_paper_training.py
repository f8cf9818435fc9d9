"""Laws of Algorithm 1: of Phi, of its windows, and of what comes of them."""

import dataclasses as dc

import numpy as np
import pytest
import torch
from hypothesis import example, given
from hypothesis import strategies as st

from np_drake.lifting.model.lifted_linear_system import Encoder
from np_drake.lifting.model.lifted_model import PAPER
from np_drake.lifting.training import paper_training
from np_drake.lifting.training.excitation import turns
from np_drake.lifting.training.paper_training import (
    IMAGES,
    LAGS,
    RIDGE,
    PaperConfig,
    PhiModule,
    foreseeing,
    rollout_error,
    window_fit,
)
from np_drake.lifting.training.train import train
from np_drake.residual_models.lifted_predictor import LiftedPredictor
from np_drake.skill.skill import skill_table

CONFIG = PaperConfig(epochs=2, spacing=20)


def phi_module(seed: int = 0, gamma: float = 1.0, shake: float = 0.3) -> PhiModule:
    """Away from its initial weights, as after training."""
    start = np.linalg.qr(np.random.default_rng(seed).standard_normal((20, 8)))[0].T
    dut = PhiModule(start=start, K=8, width=24, layers=2, gamma=gamma, seed=seed)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for raw in dut.raw:
            raw += shake * torch.randn(raw.shape, generator=generator, dtype=raw.dtype)
    return dut


def lipschitz_bound(weights):
    return np.prod([np.linalg.norm(W, 2) for W in weights])


def flies(dut: PhiModule, samples: np.ndarray) -> np.ndarray:
    """z (n, 8) of samples (n, 20), by what is exported."""
    window = np.pad(samples, ((0, 0), (0, 4))).reshape(-1, 2, 12)
    return Encoder(np.eye(20, 24), dut.export())(window)


@given(st.integers(0, 1000), st.floats(0.1, 100.0), st.floats(0.0, 3.0))
@example(217, 1.0, 0.005859375)  # two singular values 1e-4 apart
def test_the_product_of_singular_values_is_at_most_gamma(seed, gamma, shake):
    flown = phi_module(seed, gamma, shake).export()
    assert lipschitz_bound(flown) <= gamma * (1 + 1e-12)  # rounding


def test_what_flies_is_what_was_trained_without_bias():
    dut, x = phi_module(), np.random.default_rng(0).standard_normal((50, 20))
    trained, z = dut(torch.from_numpy(x)).detach().numpy(), flies(dut, x)
    np.testing.assert_allclose(z, trained, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(flies(dut, 3.0 * x), 3.0 * z, rtol=1e-12)
    distance = np.linalg.norm(x[:25] - x[25:], axis=1)
    assert np.all(np.linalg.norm(z[:25] - z[25:], axis=1) <= distance * (1 + 1e-12))


def test_fresh_weights_carry_what_they_start_from():
    dut, x = phi_module(shake=0.0), np.random.default_rng(0).standard_normal((100, 20))
    start = np.linalg.qr(np.random.default_rng(0).standard_normal((20, 8)))[0].T
    ratio = flies(dut, x) / (x @ start.T)
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-9)


def test_the_directions_that_foresee_are_found_beside_a_louder_drive():
    """In closed form: the future is one direction of the past, and ten times the drive."""
    generator = np.random.default_rng(0)
    past, drive = generator.standard_normal((500, 6)), generator.standard_normal((500, 2))
    past[:, 5] *= 100.0  # loud, and says nothing
    wanted = np.array([0.6, 0.8, 0.0, 0.0, 0.0, 0.0])
    found = foreseeing(past, drive, (past @ wanted + 10 * drive[:, 0])[:, None], 1)
    np.testing.assert_allclose(np.abs(found[0] / np.linalg.norm(found[0])), wanted, atol=1e-3)
    assert np.std(past @ found[0]) == pytest.approx(1.0, rel=0.01)


@pytest.fixture(scope="module")
def paper(dithered):
    return train([dithered.segment], dc.replace(CONFIG, spacing=5))


def test_the_model_is_what_theorem_1_assumes(paper, lemniscate):
    model = paper.model
    assert paper.loss[-1] < paper.loss[0]
    assert (model.configuration, model.system.K) == (PAPER, 24)
    assert lipschitz_bound(model.encoder.weights) <= CONFIG.gamma * (1 + 1e-12)
    assert (model.encoder.delay, model.refit, model.ridge) == (LAGS[-1] + 1, CONFIG.window, RIDGE)
    assert model.system.spectral_radius < 1.0
    samples = np.hstack([lemniscate.chi, lemniscate.zeta])
    windows = np.stack([samples[k - LAGS[-1] : k + 1] for k in range(LAGS[-1], len(samples))])
    error = model.encoder(windows) @ model.system.C.T - lemniscate.truth[LAGS[-1] :]
    assert np.sqrt(np.mean(error[:, :3] ** 2)) < 0.2  # [N] of a payload's 2.5 N


def test_half_a_second_ahead_the_swing_is_foreseen(paper, lemniscate):
    """Along an unseen track, from offline A and B; persistence is wrong by the swing."""
    dut = LiftedPredictor(dc.replace(paper.model, refit=0))
    options = {"horizons": [25], "mean": np.zeros(6), "warm_up": 40, "motion": "known"}
    rows = skill_table({"np": dut}, lemniscate.segment, **options)
    error = {row["model"]: row["force_rmse"] for row in rows}
    assert error["np"] < 0.6 * error["persistence"]


def test_a_window_fit_is_ridge_regression_toward_the_prior():
    generator = torch.Generator().manual_seed(0)
    X = torch.randn(3, 39, 10, generator=generator, dtype=torch.float64)
    Y = torch.randn(3, 39, 4, generator=generator, dtype=torch.float64)
    prior = 0.1 * torch.randn(10, 4, generator=generator, dtype=torch.float64)
    A, B = window_fit(X, Y, prior, 2.0)
    for i in range(3):
        stacked = np.vstack([X[i], np.sqrt(2.0) * np.eye(10)])
        target = np.vstack([Y[i], np.sqrt(2.0) * prior])
        expected = np.linalg.lstsq(stacked, target, rcond=None)[0]
        np.testing.assert_allclose(torch.cat([A[i], B[i]]), expected, atol=1e-10)


def test_the_backward_loss_is_the_mean_square_of_the_way_back(monkeypatch):
    """In closed form: a scalar that stands still, a prior that says half of it, and no refit."""
    monkeypatch.setattr(paper_training, "RIDGE", 1e12)
    half, mu = torch.zeros(7, 1, dtype=torch.float64), 0.999
    half[0, 0] = 0.5
    z, zeta = torch.ones(2, 4, 1, dtype=torch.float64), torch.zeros(2, 4, 6, dtype=torch.float64)
    expected = (mu * 0.5**2 + mu**2 * 0.75**2 + mu**3 * 0.875**2) / 3
    assert rollout_error(z, zeta, half, mu, backward=True).item() == pytest.approx(expected)
    z[:, 0] = 3.0  # forward from the first sample, backward from the last
    assert rollout_error(z, zeta, half, mu, backward=False).item() == pytest.approx(
        (mu * 0.5**2 + mu**2 * 0.25**2 + mu**3 * 0.625**2) / 3
    )
    assert rollout_error(z, zeta, half, mu, backward=True).item() == pytest.approx(
        (mu * 0.5**2 + mu**2 * 0.75**2 + mu**3 * 2.875**2) / 3
    )


def test_images_are_the_turns_of_wrench_and_motion_alike():
    chi, zeta = np.random.default_rng(0).standard_normal((2, 5, 6))
    for image, *turned in zip(IMAGES, turns(chi), turns(zeta), strict=True):
        np.testing.assert_allclose(np.hstack([chi, zeta]) @ image, np.hstack(turned))
