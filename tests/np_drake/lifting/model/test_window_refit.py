import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.lifting.model.encoders import DelayEncoder, Phi
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem, stabilized
from np_drake.lifting.model.lifted_model import DELAY_DMDC, PAPER, LiftedModel
from np_drake.lifting.model.window_refit import RADIUS, WindowRefit

SCALE = np.array([1.5, 1.5, 1.5, 0.5, 0.5, 0.5])


def paper_model(seed: int = 0, K: int = 8) -> LiftedModel:
    generator = np.random.default_rng(seed)
    phi = Phi(
        (generator.standard_normal((12, 6)), 0.3 * generator.standard_normal((K, 12))), np.ones(6)
    )
    A = np.linalg.qr(generator.standard_normal((K, K)))[0] * 0.9
    system = LiftedLinearSystem(
        A, generator.standard_normal((K, 6)), generator.standard_normal((6, K)), 0.02
    )
    return LiftedModel(PAPER, system, phi, 40, np.ones(6), SCALE, True, ridge=1.0)


def test_the_refit_is_ridge_regression_toward_the_prior():
    ridge = 0.7
    model = dc.replace(paper_model(), ridge=ridge)
    window = np.random.default_rng(1).standard_normal((40, 12))
    z = model.encoder(window[:, :6])
    prior = np.hstack([model.system.A, model.system.B * SCALE]).T
    X = np.vstack([np.hstack([z[:-1], window[:-1, 6:] / SCALE]), np.sqrt(ridge) * np.eye(14)])
    Y = np.vstack([z[1:], np.sqrt(ridge) * prior])
    expected = np.linalg.lstsq(X, Y, rcond=None)[0].T
    assert (
        np.abs(np.linalg.eigvals(expected[:, :8])).max() < RADIUS
    )  # else the projection would speak
    A, B = WindowRefit(model)(window)
    np.testing.assert_allclose(A, expected[:, :8], atol=1e-10)
    np.testing.assert_allclose(B, expected[:, 8:] / SCALE, atol=1e-10)


def test_a_window_that_says_nothing_leaves_the_prior():
    model = paper_model()
    A, B = WindowRefit(model)(np.zeros((40, 12)))
    np.testing.assert_allclose(A, model.system.A, atol=1e-12)
    np.testing.assert_allclose(B, model.system.B, atol=1e-12)


@given(st.integers(0, 1000), st.floats(1e-3, 1e3))
def test_directions_that_a_window_does_not_excite_keep_the_prior(seed, ridge):
    """Of z and of zeta; along the others the refit does move."""
    generator = np.random.default_rng(seed)
    model = dc.replace(paper_model(seed), ridge=ridge)
    window = generator.standard_normal((40, 12)) * np.repeat([1.0, 0.0, 1.0, 0.0], [1, 5, 2, 4])
    A, B = WindowRefit(model)(window)
    before, after = model.encoder(np.eye(6)[0]), model.encoder(-np.eye(6)[0])
    still = np.linalg.svd(np.stack([before, after]))[2][
        2:
    ]  # directions of z that chi along x does not reach
    prior = stabilized(model.system.A, RADIUS)
    if np.abs(np.linalg.eigvals(A)).max() < RADIUS * (
        1 - 1e-6
    ):  # else the projection moves all directions
        np.testing.assert_allclose(A @ still.T, prior @ still.T, atol=1e-8)
    np.testing.assert_allclose(B[:, 2:], model.system.B[:, 2:], atol=1e-8)
    assert np.abs(B[:, :2] - model.system.B[:, :2]).max() > 1e-6


def test_late_labels_stand_beside_the_zeta_of_their_own_time():
    model, late = paper_model(), 3
    window = np.random.default_rng(5).standard_normal((43, 12))
    in_time = np.hstack([window[late:, :6], window[: 43 - late, 6:]])
    found = WindowRefit(dc.replace(model, window=43, late=late))(window)
    for ours, theirs in zip(found, WindowRefit(model)(in_time), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)


def test_a_system_that_the_window_shows_in_full_is_found():
    generator, model = np.random.default_rng(0), paper_model()
    phi = Phi((np.eye(6),), np.ones(6))  # z = chi: nothing hidden
    system = LiftedLinearSystem(np.zeros((6, 6)), np.zeros((6, 6)), np.eye(6), 0.02)
    model = dc.replace(model, encoder=phi, system=system, ridge=1e-9)
    A, B = np.diag(np.linspace(0.3, 0.9, 6)), generator.standard_normal((6, 6))
    window = generator.standard_normal((40, 12))
    for k in range(39):
        window[k + 1, :6] = A @ window[k, :6] + B @ window[k, 6:]
    found_A, found_B = WindowRefit(model)(window)
    np.testing.assert_allclose(found_A, A, atol=1e-6)
    np.testing.assert_allclose(found_B, B, atol=1e-6)


@given(
    st.integers(0, 1000), st.sampled_from([0.0, 1e-3, 1.0, 30.0]), st.sampled_from([0.0, 0.05, 0.5])
)
def test_no_window_whatever_gives_an_unstable_system(seed, size, growth):
    generator = np.random.default_rng(seed)
    window = size * generator.standard_normal((40, 12)) * np.exp(growth * np.arange(40))[:, None]
    A, B = WindowRefit(dc.replace(paper_model(seed), ridge=1e-3))(window)
    assert np.abs(np.linalg.eigvals(A)).max() <= RADIUS + 1e-9
    assert np.all(np.isfinite(B))


def test_there_is_no_refit_without_a_prior_or_without_phi():
    with pytest.raises(ValueError, match="ridge must be positive"):
        WindowRefit(dc.replace(paper_model(), ridge=0.0))
    model = paper_model()
    delay = LiftedModel(
        DELAY_DMDC, model.system, DelayEncoder(np.zeros((8, 60)), 5), 5, SCALE, SCALE, False
    )
    with pytest.raises(ValueError, match="must be Phi"):
        WindowRefit(dc.replace(delay, ridge=1.0))


@pytest.mark.parametrize("late", [0, 2])
def test_all_windows_at_once_are_those_one_by_one(late):
    """With windows among them whose A must be made stable."""
    model = dc.replace(paper_model(K=6), ridge=1e-3, late=late)
    samples = 3.0 * np.random.default_rng(3).standard_normal((60, 12))
    samples[:, :6] *= (
        1.05 ** np.arange(60)[:, None]
    )  # growing: least squares wants |eigenvalue| > 1
    dut = WindowRefit(model)
    A, B, before = dut.along(samples, 40)
    assert np.sum(before > RADIUS) > 0
    for k in range(len(A)):
        one_A, one_B = dut(samples[k : k + 40])
        np.testing.assert_allclose(A[k], one_A, atol=1e-9)
        np.testing.assert_allclose(B[k], one_B, atol=1e-9)
    assert np.abs(np.linalg.eigvals(A)).max() <= RADIUS
