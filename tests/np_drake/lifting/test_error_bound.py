"""Laws of Theorem 1, corrected: what it bounds, and what it says where an assumption fails."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.lifting.error_bound import check_flight, largest_changes
from np_drake.lifting.model.encoders import DelayEncoder, Phi
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.model.lifted_model import DELAY_DMDC, PAPER, LiftedModel
from np_drake.lifting.training.family_training import LiftedConfig
from np_drake.lifting.training.train import train

ONES = np.ones(6)
CHI_SCALE, ZETA_SCALE = np.repeat([2.0, 0.1], 3), np.repeat([3.0, 0.5], 3)


def plain_model(a: float = 0.5, b: float = 0.0, L: float = 1.0, scale=ONES) -> LiftedModel:
    """z = L chi / scale, z+ = a z + b zeta, chi = z / L; A and B fixed."""
    system = LiftedLinearSystem(a * np.eye(6), b * np.eye(6), np.diag(scale) / L, 0.02)
    phi = Phi((L * np.eye(6),), scale)
    return LiftedModel(PAPER, system, phi, 4, ONES, ONES, True, {"gamma": L}, ridge=1e12)


def random_model(seed: int, kind: str, K: int = 8) -> LiftedModel:
    """Any weights, any stable A, far from normal."""
    generator = np.random.default_rng(seed)
    A = np.triu(generator.standard_normal((K, K)), k=1) + np.diag(generator.uniform(-0.99, 0.99, K))
    C, B = generator.standard_normal((6, K)), generator.standard_normal((K, 6))
    system, scales = LiftedLinearSystem(A, B, C, 0.02), (CHI_SCALE, ZETA_SCALE)
    if kind == "delay":
        E = DelayEncoder(generator.standard_normal((K, 12 * 5)), 5)
        return LiftedModel(DELAY_DMDC, system, E, 5, *scales, bool(seed % 2))
    phi = Phi((generator.standard_normal((12, 6)), generator.standard_normal((K, 12))), CHI_SCALE)
    return LiftedModel(PAPER, system, phi, 12, *scales, True, ridge=0.5)


def walk(seed: int, n: int, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """chi and zeta (n, 6) that wander."""
    steps = size * np.random.default_rng(seed).standard_normal((n, 12))
    course = np.cumsum(steps * np.concatenate([CHI_SCALE, ZETA_SCALE]), axis=0)
    return course[:, :6], course[:, 6:]


def steady(alpha_chi: float, alpha_zeta: float, horizon: int):
    return np.full(horizon, alpha_chi), np.full(horizon, alpha_zeta)


def test_at_rest_c_is_what_one_step_can_do():
    still = np.zeros((12, 6))
    found = check_flight(
        plain_model(a=0.5, b=2.0), still, still, alpha=steady(0.1, 0.3, 3), horizon=3
    )
    np.testing.assert_allclose(found.c, 1.5 * 0.1 + 2.0 * 0.3)
    np.testing.assert_allclose(found.residual, 0.0)
    assert (found.violated, found.holds) == ({}, 1.0)


@pytest.mark.parametrize("scale", [ONES, CHI_SCALE])
def test_a_wrench_that_runs_off_steadily_reaches_the_bound(scale):
    """At rest, then alpha a step along one axis: A z stays zero, E_n = n alpha."""
    model, horizon = plain_model(a=0.5, scale=scale), 7
    chi = np.zeros((4 + horizon, 6))
    chi[4:, 1] = 0.1 * scale[1] * np.arange(1, horizon + 1)
    alpha = 0.1 * np.arange(1, horizon + 1), np.zeros(horizon)
    found = check_flight(model, chi, np.zeros_like(chi), alpha=alpha, horizon=horizon)
    for kind in ("z", "chi"):
        np.testing.assert_allclose(found.ratio[kind], 1.0)


def test_the_residual_of_the_windows_own_fit_is_in_c():
    chi = np.zeros((7, 6))
    chi[3:, 0] = 1.0  # the last step of the first window is all residual
    found = check_flight(
        plain_model(a=0.5), chi, np.zeros_like(chi), alpha=steady(1.0, 0, 3), horizon=3
    )
    assert found.residual[0] == pytest.approx(1.0)
    assert found.c[0] == pytest.approx(1.0 + 1.5)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10_000), st.sampled_from(["refit", "delay"]), st.floats(0.01, 3.0))
def test_no_error_exceeds_its_bound(seed, kind, size):
    model, (chi, zeta) = random_model(seed, kind), walk(seed + 1, 40, size)
    found = check_flight(model, chi, zeta, horizon=10)
    assert (found.premise, found.holds, found.holds_on_premise) == (1.0, 1.0, 1.0)
    one_step = largest_changes(model, chi, zeta, 10)
    assert (found.alpha_chi, found.alpha_zeta) == (one_step[0][0], one_step[1][0])


def test_an_unstable_operator_and_a_steep_phi_are_named():
    chi, zeta = walk(0, 50, 0.1)
    unstable = check_flight(
        dc.replace(random_model(0, "delay"), system=_grown(random_model(0, "delay").system)),
        chi,
        zeta,
        horizon=10,
    )
    assert (unstable.violated, unstable.holds) == ({"stability": 1.0}, 1.0)
    assert unstable.spectral_radius == pytest.approx(1.1)
    steep = dc.replace(plain_model(), encoder=Phi((2.0 * np.eye(6),), ONES))
    assert check_flight(steep, chi, zeta, horizon=10).violated == {"Lipschitz constant": 1.0}


def _grown(system: LiftedLinearSystem) -> LiftedLinearSystem:
    return dc.replace(system, A=1.1 / system.spectral_radius * system.A)


def test_where_the_flight_changes_more_than_allowed_the_check_says_so():
    found = check_flight(
        random_model(0, "refit"), *walk(0, 80), alpha=steady(0.1, 0.1, 10), horizon=10
    )
    assert found.premise == 0.0
    assert np.isnan(found.holds_on_premise)


def test_what_cannot_be_bounded_is_refused(dithered, plain):
    with pytest.raises(ValueError, match="at least 14 samples are needed; got 13"):
        check_flight(plain_model(), *walk(0, 13), horizon=10)
    brief = LiftedConfig(steps=1, delay=5, horizon=5, horizons=3, lags=(2,))
    family = train([dithered.segment, plain.segment], brief).model
    with pytest.raises(ValueError, match="must not change with theta"):
        check_flight(family, dithered.chi, dithered.zeta)
