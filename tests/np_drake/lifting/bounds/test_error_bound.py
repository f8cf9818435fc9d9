import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.lifting.bounds.bound_check import check_flight
from np_drake.lifting.bounds.error_bound import TheoremBound, largest_changes
from np_drake.lifting.model.encoders import DelayEncoder, Phi
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.model.lifted_model import DELAY_DMDC, PAPER, LiftedModel
from np_drake.lifting.training.family_training import LiftedConfig
from np_drake.lifting.training.train import train

ONES = np.ones(6)
CHI_SCALE, ZETA_SCALE = (
    np.array([2.0, 2.0, 2.0, 0.1, 0.1, 0.1]),
    np.array([3.0, 3.0, 3.0, 0.5, 0.5, 0.5]),
)
seeds = st.integers(0, 10_000)


def bound(model, alpha_chi, alpha_zeta, window=None, **options):
    """The bound after one window; None: at rest, all samples zero."""
    dut = TheoremBound(model, alpha_chi, alpha_zeta, **options)
    return dut(np.zeros((dut.samples, 12)) if window is None else window)


def plain_model(a: float = 0.5, b: float = 0.0, L: float = 1.0) -> LiftedModel:
    """z = L chi, z+ = a z + b zeta, chi = z / L; A and B fixed."""
    system = LiftedLinearSystem(a * np.eye(6), b * np.eye(6), np.eye(6) / L, 0.02)
    return LiftedModel(
        PAPER, system, Phi((L * np.eye(6),), ONES), 4, ONES, ONES, True, {"gamma": L}
    )


def random_model(seed: int, kind: str, K: int = 8) -> LiftedModel:
    """Any weights, any stable A, far from normal; `refit` and `fixed` see chi through Phi."""
    generator = np.random.default_rng(seed)
    A = np.triu(generator.standard_normal((K, K)), k=1) + np.diag(generator.uniform(-0.99, 0.99, K))
    C, B = generator.standard_normal((6, K)), generator.standard_normal((K, 6))
    system = LiftedLinearSystem(A, B, C, 0.02)
    if kind == "delay":
        E = generator.standard_normal((K, 12 * 5))
        return LiftedModel(
            DELAY_DMDC, system, DelayEncoder(E, 5), 5, CHI_SCALE, ZETA_SCALE, bool(seed % 2)
        )
    phi = Phi((generator.standard_normal((12, 6)), generator.standard_normal((K, 12))), CHI_SCALE)
    ridge = 0.5 if kind == "refit" else 0.0
    return LiftedModel(PAPER, system, phi, 12, CHI_SCALE, ZETA_SCALE, True, ridge=ridge)


def walk(seed: int, n: int, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """chi and zeta (n, 6) that wander."""
    steps = (
        size
        * np.random.default_rng(seed).standard_normal((n, 12))
        * np.concatenate([CHI_SCALE, ZETA_SCALE])
    )
    return steps.cumsum(axis=0)[:, :6], steps.cumsum(axis=0)[:, 6:]


def test_at_rest_c_is_what_one_step_can_do():
    dut = bound(plain_model(a=0.5, b=2.0), 0.1, 0.3)
    assert dut.c == pytest.approx(1.5 * 0.1 + 2.0 * 0.3)
    assert dut.residual == 0.0
    assert dut.violated == ()


def test_the_papers_form_sums_powers_times_growing_local_errors():
    dut = bound(plain_model(a=0.5), 0.1, 0.0, horizon=3)
    local = 1.5 * 0.1 * np.array([1, 2, 3])
    expected = [local[0], local[1] + 0.5 * local[0], local[2] + 0.5 * local[1] + 0.25 * local[0]]
    np.testing.assert_allclose(dut.operator, expected)


def test_a_wrench_that_runs_off_steadily_reaches_the_bound():
    """At rest, then alpha a step along one axis: A z stays zero, E_n = n alpha."""
    model, horizon = plain_model(a=0.5), 7
    chi = np.zeros((4 + horizon, 6))
    chi[4:, 1] = 0.1 * np.arange(1, horizon + 1)
    found = check_flight(model, chi, np.zeros_like(chi), alpha=(0.1, 0.0), horizon=horizon)
    np.testing.assert_allclose(found.ratio["z"], 1.0)
    np.testing.assert_allclose(found.ratio["chi"], 1.0)


def test_the_residual_of_the_windows_own_fit_is_in_c():
    window = np.zeros((4, 12))
    window[:, 0] = [0.0, 0.0, 0.0, 1.0]  # the last step is all residual
    dut = bound(plain_model(a=0.5), 1.0, 0.0, window)
    assert dut.residual == pytest.approx(1.0)
    assert dut.c == pytest.approx(1.0 + 1.5)


def test_the_papers_constant_bounds_neither_z_nor_later_steps():
    """Why the theorem is corrected: c in the units of chi, and for the first step only."""
    for L, n in ((10.0, 1), (1.0, 5)):  # z in other units; then chi running off
        a, alpha = 0.0, 0.1
        papers = (
            (a / L) * L + 1.0
        ) * alpha  # (|CA| L + 1) alpha_chi, and chi = C Phi(chi) leaves nothing more
        error = n * alpha * L
        assert error > papers
        assert error <= bound(plain_model(a=a, L=L), alpha, 0.0, horizon=n).z[-1] * (1 + 1e-12)


@settings(deadline=None)
@given(
    seeds,
    st.sampled_from(["refit", "fixed", "delay"]),
    st.sampled_from(["steps", "changes"]),
    st.floats(0.01, 3.0),
)
def test_no_error_exceeds_its_bound(seed, kind, alphas, size):
    model = random_model(seed, kind)
    chi, zeta = walk(seed + 1, 60, size)
    changes = largest_changes(model, chi, zeta, 10)
    alpha = changes if alphas == "changes" else (changes[0][0], changes[1][0])
    found = check_flight(model, chi, zeta, alpha=alpha, horizon=10)
    assert found.premise == 1.0
    assert found.holds == 1.0


@settings(deadline=None)
@given(seeds, st.sampled_from(["refit", "fixed", "delay"]))
def test_under_plain_alphas_the_papers_form_is_never_sharper(seed, kind):
    model = random_model(seed, kind)
    dut = TheoremBound(model, 0.3, 0.7, horizon=12)
    chi, zeta = walk(seed, dut.samples, 0.1)
    answer = dut(np.hstack([chi, zeta]))
    assert np.all(answer.z_held <= answer.z * (1 + 1e-12))
    assert np.all(answer.z <= answer.operator * (1 + 1e-12))


def test_the_bound_on_force_is_in_newtons():
    model = dc.replace(plain_model(), encoder=Phi((np.eye(6),), CHI_SCALE))
    dut = bound(model, 0.1, 0.0)
    np.testing.assert_allclose(dut.force, 2.0 * dut.chi)  # chi_scale of force


def test_an_unstable_operator_is_named_and_still_bounded_for_finite_n():
    model = plain_model(a=1.1, b=1.0)
    assert bound(model, 0.1, 0.1).violated == ("stability",)
    chi, zeta = walk(0, 50, 0.1)
    found = check_flight(model, chi, zeta, horizon=10)
    assert found.violated == {"stability": 1.0}
    assert found.holds == 1.0


def test_a_phi_steeper_than_it_was_trained_to_is_named():
    model = plain_model()
    steep = dc.replace(model, encoder=Phi((2.0 * np.eye(6),), ONES))
    assert bound(steep, 0.1, 0.1).violated == ("Lipschitz constant",)
    assert bound(steep, 0.1, 0.1, gamma=2.0).violated == ()


@pytest.mark.parametrize("column, name", [(0, "step of chi"), (6, "step of zeta")])
def test_a_window_faster_than_alpha_is_named(column, name):
    window = np.zeros((4, 12))
    window[-1, column] = 0.2
    assert bound(plain_model(), 0.1, 0.1, window).violated == (name,)
    assert bound(plain_model(), 0.2, 0.2, window).violated == ()


def test_a_slow_drift_beyond_the_allowed_change_is_named():
    window = np.zeros((4, 12))
    window[:, 0] = [0.0, 0.1, 0.2, 0.3]  # each step is allowed, three of them are not
    allowed = np.array([0.1, 0.15, 0.2])
    assert bound(plain_model(), allowed, 0.1, window, horizon=3).violated == ("step of chi",)


def test_where_alpha_fails_the_check_says_so():
    model = random_model(0, "fixed")
    chi, zeta = walk(0, 80)
    found = check_flight(model, chi, zeta, alpha=(0.1, 0.1), horizon=10)
    assert found.premise == 0.0
    assert found.violated == {"step of chi": 1.0, "step of zeta": 1.0}


def test_a_delay_encoder_knows_most_of_its_next_window():
    """One step ahead only the newest of five samples is unknown."""
    model = random_model(1, "delay")
    dut = TheoremBound(model, 0.5, 0.0, horizon=8)
    newest = np.linalg.norm(model.encoder.E[:, -12:-6] * CHI_SCALE, 2)
    assert dut.reach.radius[0] == pytest.approx(0.5 * newest)
    assert dut.reach.travel[0] > dut.reach.radius[0]


@pytest.mark.parametrize(
    "arguments, match",
    [
        ((-0.1, 0.1), "alpha_chi must be finite and not negative"),
        ((0.1, np.inf), "alpha_zeta must be finite and not negative"),
        ((np.ones(3), 0.1), "one number or"),
        ((0.1, 0.1, np.zeros((3, 12))), "window must be"),
        ((0.1, 0.1, np.full((4, 12), np.nan)), "window must be finite"),
    ],
)
def test_what_cannot_be_bounded_is_refused(arguments, match):
    with pytest.raises(ValueError, match=match):
        bound(plain_model(), *arguments)


def test_a_family_whose_theta_changes_in_flight_is_refused(dithered, plain):
    one, two = (
        train(s, LiftedConfig(steps=3)).model
        for s in ([dithered.segment], [dithered.segment, plain.segment])
    )
    assert np.isfinite(bound(one, 0.1, 0.1).z).all()
    with pytest.raises(ValueError, match="must not change with theta"):
        TheoremBound(two, 0.1, 0.1)
