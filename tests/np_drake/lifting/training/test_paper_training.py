"""Laws of Algorithm 1: of Phi, of its windows, and of what comes of them."""

import dataclasses as dc

import numpy as np
import pytest
import torch
from hypothesis import example, given
from hypothesis import strategies as st

from np_drake.lifting.model.lifted_linear_system import RADIUS, advance, stabilized
from np_drake.lifting.model.lifted_model import PAPER
from np_drake.lifting.training.paper_training import (
    PaperConfig,
    PaperTrainer,
    PhiModule,
    most_likely_ridge,
    stable,
    window_fit,
)
from np_drake.lifting.training.train import train
from np_drake.training_data.segments import Segment

CONFIG = PaperConfig(epochs=2, spacing=20)
SCALE = np.array([2.0, 2.0, 2.0, 0.1, 0.1, 0.1])


def phi_module(seed: int = 0, gamma: float = 1.0, shake: float = 0.3) -> PhiModule:
    """Away from its initial weights, as after training."""
    dut = PhiModule(width=16, layers=2, K=8, gamma=gamma, scale=SCALE, seed=seed)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for raw in dut.raw:
            raw += shake * torch.randn(raw.shape, generator=generator, dtype=raw.dtype)
    return dut


def lipschitz_bound(phi):
    return np.prod([np.linalg.norm(W, 2) for W in phi.weights])


@given(st.integers(0, 1000), st.floats(0.1, 100.0), st.floats(0.0, 3.0))
@example(217, 1.0, 0.005859375)  # two singular values 1e-4 apart
def test_the_product_of_singular_values_is_at_most_gamma(seed, gamma, shake):
    flown = phi_module(seed, gamma, shake).export()
    assert lipschitz_bound(flown) <= gamma * (1 + 1e-12)  # rounding


def test_what_flies_is_what_was_trained_without_bias():
    dut = phi_module()
    chi = SCALE * np.random.default_rng(0).standard_normal((50, 6))
    trained, flies = dut(torch.from_numpy(chi)).detach().numpy(), dut.export()
    np.testing.assert_allclose(flies(chi), trained, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(flies(3.0 * chi), 3.0 * flies(chi), rtol=1e-12)
    a, b = flies(chi[:25]), flies(chi[25:])
    distance = np.linalg.norm((chi[:25] - chi[25:]) / SCALE, axis=1)
    assert np.all(np.linalg.norm(a - b, axis=1) <= distance * (1 + 1e-12))


def test_fresh_weights_carry_chi_itself():
    dut = phi_module(shake=0.0).export()
    chi = SCALE * np.random.default_rng(0).standard_normal((100, 6))
    C = np.linalg.lstsq(dut(chi), chi, rcond=None)[0]
    np.testing.assert_allclose(dut(chi) @ C, chi, atol=1e-9)


@pytest.fixture(scope="module")
def paper(dithered):
    return train([dithered.segment], CONFIG)


def test_the_model_is_what_theorem_1_assumes(paper, lemniscate):
    model = paper.model
    assert paper.loss[-1] < paper.loss[0]
    assert (model.configuration, model.system.K) == (PAPER, 24)
    assert lipschitz_bound(model.encoder) <= CONFIG.gamma * (1 + 1e-12)
    assert model.system.spectral_radius < 1.0
    error = model.encoder(lemniscate.chi) @ model.system.C.T - lemniscate.chi
    assert np.sqrt(np.mean(error[:, :3] ** 2)) < 0.03  # [N] of a payload's 2.5 N


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


def test_an_unstable_window_is_made_stable_as_in_flight():
    unstable = 1.1 * np.random.default_rng(0).standard_normal((3, 6, 6))
    found = stable(torch.from_numpy(unstable)).numpy()
    np.testing.assert_allclose(found, [stabilized(A, RADIUS) for A in unstable], atol=1e-12)


def bare_trainer(ridge: float = 3.0) -> PaperTrainer:
    dut = object.__new__(PaperTrainer)
    dut.config, dut.ridge = CONFIG, ridge
    return dut


def test_the_backward_loss_is_the_mean_square_of_the_way_back():
    """In closed form: a scalar that stands still, a prior that says half of it, and no refit."""
    dut, half = bare_trainer(ridge=1e12), torch.zeros(7, 1, dtype=torch.float64)
    half[0, 0] = 0.5
    z, zeta = torch.ones(2, 4, 1, dtype=torch.float64), torch.zeros(2, 4, 6, dtype=torch.float64)
    mu = CONFIG.mu
    expected = (mu * 0.5**2 + mu**2 * 0.75**2 + mu**3 * 0.875**2) / 3
    assert dut._rollout_error(z, zeta, half, backward=True).item() == pytest.approx(expected)
    z[:, 0] = 3.0  # forward from the first sample, backward from the last
    assert dut._rollout_error(z, zeta, half, backward=False).item() == pytest.approx(
        (mu * 0.5**2 + mu**2 * 0.25**2 + mu**3 * 0.625**2) / 3
    )
    assert dut._rollout_error(z, zeta, half, backward=True).item() == pytest.approx(
        (mu * 0.5**2 + mu**2 * 0.75**2 + mu**3 * 2.875**2) / 3
    )


def test_one_law_asks_for_no_refit_and_a_law_for_each_window_for_one():
    """With z = chi, and a decay that is the same in all windows or one of each."""

    def learned(spread: float) -> float:
        generator = np.random.default_rng(0)
        decay = 0.9 + spread * generator.uniform(-1, 1, (40, 1))
        zeta, chi = generator.standard_normal((40, 80, 6)), np.zeros((40, 80, 6))
        for k in range(79):
            chi[:, k + 1] = (
                decay * chi[:, k] + 0.3 * zeta[:, k] + 0.02 * generator.standard_normal((40, 6))
            )
        prior = torch.from_numpy(np.vstack([0.9 * np.eye(6), 0.3 * np.eye(6)]))
        z = torch.from_numpy(chi)
        return most_likely_ridge(
            z, torch.from_numpy(zeta), z, torch.eye(6, dtype=z.dtype), prior.expand(40, -1, -1)
        )

    assert learned(0.0) >= 1e3  # 39 samples of about unit size move little
    assert learned(0.09) <= 1e2


def test_only_a_weight_lasts_beyond_a_window(plain):
    """A horizontal force goes; a weight stays, also one that is less than that of the training."""
    config = dc.replace(CONFIG, epochs=1)
    model = train([plain.segment], config).model
    chi = np.array([1.0, -0.5, -2.5, 0.0, 0.0, 0.0])
    s, z = model.system, model.encoder(chi)
    later = [s.C @ advance(z, s.A, s.B, np.zeros((steps, 6))) for steps in (0, 160)]
    assert np.abs(later[1][:2]).max() < np.exp(-160 / 40) * np.abs(later[0][:2]).max() + 0.02  # [N]
    assert later[1][2] == pytest.approx(-2.5, rel=0.05)


def test_a_late_label_is_learned_as_one_in_time(dithered):
    """Two samples of delay change the model by what the ends of the flight say, and z is that of
    now.
    """
    late = Segment(dithered.chi, dithered.zeta, 0.02, late=2)
    in_time = Segment(dithered.chi[2:], dithered.zeta[:-2], 0.02)
    config = dc.replace(CONFIG, epochs=1, spacing=60)
    ours, theirs = train([late], config).model, train([in_time], config).model
    assert (ours.late, theirs.late, ours.window) == (2, 0, theirs.window + 2)
    np.testing.assert_array_equal(ours.system.A, theirs.system.A)
    window = np.hstack([dithered.chi, dithered.zeta])[100:142]
    s = theirs.system
    z = advance(theirs.encoder(window[-1, :6]), s.A, s.B, window[-3:-1, 6:])
    own = ours.system
    found = advance(ours.encoder(window[-1, :6]), own.A, own.B, ours.since_label(window))
    np.testing.assert_allclose(found, z, atol=1e-12)
