import dataclasses as dc

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from np_drake.lifting.model.lifted_linear_system import stabilized
from np_drake.lifting.model.lifted_model import PAPER
from np_drake.lifting.model.window_refit import RADIUS
from np_drake.lifting.training.excitation import turns
from np_drake.lifting.training.paper_training import (
    PaperConfig,
    PaperTrainer,
    most_likely_ridge,
    stable,
    window_fit,
)
from np_drake.lifting.training.train import train
from np_drake.training_data.segments import Segment

CONFIG = PaperConfig(epochs=2, spacing=20)


@pytest.fixture(scope="module")
def paper(dithered):
    return train([dithered.segment], CONFIG)


def test_the_loss_falls(paper):
    assert paper.loss[-1] < paper.loss[0]


def test_the_model_is_what_theorem_1_assumes(paper):
    assert paper.model.configuration == PAPER
    assert paper.model.encoder.lipschitz_bound <= CONFIG.gamma * (1 + 1e-12)
    assert paper.model.system.spectral_radius < 1.0
    assert paper.model.system.K == 24


def test_chi_is_read_out_of_z_without_bias(paper, lemniscate):
    error = paper.model.encoder(lemniscate.chi) @ paper.model.system.C.T - lemniscate.chi
    assert np.sqrt(np.mean(error[:, :3] ** 2)) < 0.03  # [N] of a payload's 2.5 N
    assert not paper.model.encoder(np.zeros(6)).any()


def test_runs_are_deterministic(paper, dithered):
    again = train([dithered.segment], CONFIG)
    assert again.loss == paper.loss
    for name in "ABC":
        ours, theirs = getattr(again.model.system, name), getattr(paper.model.system, name)
        np.testing.assert_array_equal(ours, theirs)


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


def linear_course(
    seed: int, A: np.ndarray, B: np.ndarray, n: int = 40
) -> tuple[torch.Tensor, torch.Tensor]:
    """z and zeta (1, n, …) of z+ = A z + B zeta."""
    generator = np.random.default_rng(seed)
    zeta, z = generator.standard_normal((1, n, 6)), np.ones((1, n, len(A)))
    for k in range(n - 1):
        z[0, k + 1] = A @ z[0, k] + B @ zeta[0, k]
    return torch.from_numpy(z), torch.from_numpy(zeta)


def bare_trainer(ridge: float = 3.0) -> PaperTrainer:
    dut = object.__new__(PaperTrainer)
    dut.config, dut.ridge = CONFIG, ridge
    return dut


@given(st.integers(0, 1000), st.floats(1e-3, 1e6))
def test_an_invertible_linear_system_costs_nothing_either_way(seed, ridge):
    """With z a lifted linear system that the priors know: z_k = A^-1 (z_(k+1) - B zeta_k) backward
    in time.
    """
    generator = np.random.default_rng(seed)
    A, B = np.linalg.qr(generator.standard_normal((4, 4)))[0], generator.standard_normal((4, 6))
    dut, (z, zeta) = bare_trainer(ridge), linear_course(seed, RADIUS * A, B)
    forward = torch.from_numpy(np.hstack([RADIUS * A, B]).T)
    assert dut._rollout_error(z, zeta, forward, backward=False).item() == pytest.approx(
        0.0, abs=1e-6
    )
    z, zeta = linear_course(seed, A, B)  # whose inverse lies on the circle
    backward = torch.from_numpy(np.hstack([A.T, -A.T @ B]).T)
    loss = dut._rollout_error(z, zeta, backward, backward=True).item()
    assert loss == pytest.approx(
        0.0, abs=2e-3 * float((z**2).mean())
    )  # A^-1 pulled in by 1e-4 a step


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


@pytest.mark.parametrize("seed", range(3))
def test_one_law_asks_for_no_refit_and_a_law_for_each_window_for_one(seed):
    """With z = chi, and a decay that is the same in all windows or one of each."""

    def learned(spread: float) -> float:
        generator = np.random.default_rng(seed)
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
    later = model.system.rollout(model.encoder(chi), np.zeros((161, 6)))[[0, 160]]
    assert np.abs(later[1, :2]).max() < np.exp(-160 / 40) * np.abs(later[0, :2]).max() + 0.02  # [N]
    assert later[1, 2] == pytest.approx(-2.5, rel=0.05)


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
    z, s = theirs.encoder(window[-1, :6]), theirs.system
    for zeta in window[-3:-1, 6:]:
        z = s.A @ z + s.B @ zeta
    np.testing.assert_allclose(ours.lift(window), z, atol=1e-12)


def test_a_circle_in_one_direction_is_learned_as_one_in_both(plain):
    """The mean over the images of a flight knows no direction: turned motion gives the turned
    force.
    """
    config = dc.replace(CONFIG, epochs=1, spacing=10)
    s = train([plain.segment], config).model
    free = train([plain.segment], dc.replace(config, symmetric=False)).model

    def asymmetry(model):
        chi, zeta, image = plain.chi[200], plain.zeta[200:240], turns(np.eye(6))[4]
        straight = model.system.rollout(model.encoder(chi), zeta)
        turned = model.system.rollout(model.encoder(chi @ image), zeta @ image) @ image
        return np.abs(straight - turned)[:, :3].max()

    assert asymmetry(s) < 0.3 * asymmetry(free)
