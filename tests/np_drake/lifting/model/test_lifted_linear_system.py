import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st

from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.residual_model import WrenchForecast

seeds = st.integers(0, 10_000)


def random_system(seed: int, radius: float = 0.95, K: int = 5) -> LiftedLinearSystem:
    generator = np.random.default_rng(seed)
    A = generator.standard_normal((K, K))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    return LiftedLinearSystem(
        A, generator.standard_normal((K, 6)), generator.standard_normal((6, K)), step=0.02
    )


def test_a_rollout_is_what_the_forecast_says():
    dut, generator = random_system(0), np.random.default_rng(1)
    z, zeta = generator.standard_normal(5), generator.standard_normal((7, 6))
    forecast = WrenchForecast(dut.A, dut.B, dut.C, z, np.zeros((7, 6)))
    np.testing.assert_allclose(dut.rollout(z, zeta), forecast.rollout(zeta), atol=1e-12)


def test_rollouts_of_a_batch_are_rollouts_one_by_one():
    dut, generator = random_system(0), np.random.default_rng(1)
    z, zeta = generator.standard_normal((4, 5)), generator.standard_normal((4, 7, 6))
    each = [dut.rollout(*pair) for pair in zip(z, zeta, strict=True)]
    np.testing.assert_allclose(dut.rollout(z, zeta), each, atol=1e-12)


@given(seeds, st.integers(1, 12))
def test_a_long_step_is_many_short_ones_under_held_zeta(seed, stride):
    dut, generator = random_system(seed), np.random.default_rng(seed)
    z, zeta = generator.standard_normal(5), generator.standard_normal((4, 6))
    fine = dut.rollout(z, np.repeat(zeta, stride, axis=0))[::stride]
    coarse = dut.resample(stride)
    assert coarse.step == pytest.approx(stride * dut.step)
    np.testing.assert_allclose(
        coarse.rollout(z, zeta), fine, rtol=1e-9, atol=1e-9
    )  # sums of at most 48 terms


@given(seeds, st.integers(1, 8), st.floats(0.002, 0.1))
def test_the_continuous_system_under_held_zeta_is_the_discrete_one(seed, K, step):
    """With modes up to 2 Hz, far below half the sampling rate, and some that do not decay."""
    generator = np.random.default_rng(seed)
    s = np.diag(generator.choice([0.0, 1.0, 5.0], K) * -1.0)
    turn = generator.standard_normal((K, K))
    A_c = s + 2 * np.pi * (turn - turn.T) / max(np.linalg.norm(turn - turn.T, 2), 1e-9)
    B_c = generator.standard_normal((K, 6))
    augmented = scipy.linalg.expm(step * np.block([[A_c, B_c], [np.zeros((6, K + 6))]]))
    dut = LiftedLinearSystem(augmented[:K, :K], augmented[:K, K:], np.zeros((6, K)), step)
    found_A, found_B = dut.continuous()
    np.testing.assert_allclose(found_A, A_c, atol=1e-7)
    np.testing.assert_allclose(found_B, B_c, atol=1e-7)


@pytest.mark.parametrize("eigenvalue", [0.0, -0.5])
def test_what_no_continuous_system_does_has_none(eigenvalue):
    dut = LiftedLinearSystem(np.diag([0.9, eigenvalue]), np.zeros((2, 6)), np.zeros((6, 2)), 0.02)
    with pytest.raises(ValueError, match="no eigenvalue at zero or on the negative real axis"):
        dut.continuous()


@pytest.mark.parametrize("stride", [0, -1, 1.5])
def test_only_whole_multiples_of_the_step_are_offered(stride):
    with pytest.raises(ValueError, match="whole number"):
        random_system(0).resample(stride)


@given(seeds, st.floats(0.1, 5.0), st.floats(0.5, 1.0))
def test_a_stabilized_system_is_stable(seed, was, radius):
    dut = random_system(seed, was).stabilized(radius)
    assert dut.spectral_radius <= radius


def test_what_is_stable_stays_as_it_is():
    dut = random_system(3)
    assert dut.stabilized(0.95 + 1e-9).A is dut.A


def test_an_oscillator_has_its_own_frequency_and_damping():
    omega, zeta, step = 2 * np.pi * 0.59, 0.05, 0.02  # a payload on 0.8 m, lightly damped
    s = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
    r, phi = np.exp(step * s.real), step * s.imag
    A = r * np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])
    (mode,) = LiftedLinearSystem(A, np.zeros((2, 6)), np.zeros((6, 2)), step).modes()
    assert mode.frequency == pytest.approx(s.imag / (2 * np.pi))
    assert mode.damping == pytest.approx(zeta)
    assert mode.time_constant == pytest.approx(1 / (omega * zeta))


def test_matrices_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"must be \(K, K\), \(K, 6\), \(6, K\)"):
        LiftedLinearSystem(np.eye(3), np.zeros((3, 5)), np.zeros((6, 3)), 0.02)
    with pytest.raises(ValueError, match="step must be positive"):
        LiftedLinearSystem(np.eye(3), np.zeros((3, 6)), np.zeros((6, 3)), 0.0)
