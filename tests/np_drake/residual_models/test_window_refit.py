"""Laws of the refit of A and B on a window."""

import dataclasses as dc

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from np_drake.lifting.model.lifted_linear_system import (
    RADIUS,
    Encoder,
    LiftedLinearSystem,
    stabilized,
)
from np_drake.lifting.model.lifted_model import PAPER, LiftedModel
from np_drake.residual_models.lifted_predictor import window_refit

SCALE = np.array([1.5, 1.5, 1.5, 0.5, 0.5, 0.5])


def paper_model(seed: int = 0, K: int = 8) -> LiftedModel:
    generator = np.random.default_rng(seed)
    layers = generator.standard_normal((12, 6)), 0.3 * generator.standard_normal((K, 12))
    A = np.linalg.qr(generator.standard_normal((K, K)))[0] * 0.9
    B, C = generator.standard_normal((K, 6)), generator.standard_normal((6, K))
    system = LiftedLinearSystem(A, B, C, 0.02)
    encoder = Encoder(np.eye(6, 12), layers)
    return LiftedModel(PAPER, system, encoder, SCALE, refit=40, ridge=1)


def refit(model: LiftedModel, window: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return window_refit(model, np.hstack([model.encoder(window[:, None]), window[:, 6:] / SCALE]))


@given(st.integers(0, 1000), st.floats(1e-3, 1e3))
def test_directions_that_a_window_does_not_excite_keep_the_prior(seed, ridge):
    """Of z and of zeta; along the others the refit does move."""
    generator = np.random.default_rng(seed)
    model = dc.replace(paper_model(seed), ridge=ridge)
    window = generator.standard_normal((40, 12)) * np.repeat([1.0, 0.0, 1.0, 0.0], [1, 5, 2, 4])
    A, B = refit(model, window)
    before, after = (model.encoder(sign * np.eye(1, 12)) for sign in (1, -1))
    # Directions of z that chi along x does not reach
    still = np.linalg.svd(np.stack([before, after]))[2][2:]
    prior = stabilized(model.system.A, RADIUS)
    if np.abs(np.linalg.eigvals(A)).max() < RADIUS * (1 - 1e-6):  # not projected
        np.testing.assert_allclose(A @ still.T, prior @ still.T, atol=1e-8)
    np.testing.assert_allclose(B[:, 2:], model.system.B[:, 2:], atol=1e-8)
    assert np.abs(B[:, :2] - model.system.B[:, :2]).max() > 1e-6


def test_rows_of_zeros_say_nothing():
    """As before the first window was full."""
    model, window = paper_model(), np.random.default_rng(5).standard_normal((30, 12))
    window[:10] = 0.0
    for ours, theirs in zip(refit(model, window), refit(model, window[10:]), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)


@given(st.integers(0, 1000), st.sampled_from([0.0, 1.0, 30.0]), st.sampled_from([0.0, 0.05, 0.5]))
def test_no_window_whatever_gives_an_unstable_system(seed, size, growth):
    generator = np.random.default_rng(seed)
    window = size * generator.standard_normal((40, 12)) * np.exp(growth * np.arange(40))[:, None]
    A, B = refit(dc.replace(paper_model(seed), ridge=1e-3), window)
    assert np.abs(np.linalg.eigvals(A)).max() <= RADIUS + 1e-9
    assert np.all(np.isfinite(B))
