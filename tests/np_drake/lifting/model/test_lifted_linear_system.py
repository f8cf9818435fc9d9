"""Laws of a lifted linear system, and of the projection onto a spectral radius."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.lifting.model.lifted_linear_system import (
    Encoder,
    LiftedLinearSystem,
    Taps,
    Trust,
    stabilized,
)
from np_drake.lifting.training.mode_dictionary import time_constants
from np_drake.residual_model import WrenchForecast

seeds = st.integers(0, 10_000)


def random_system(seed: int, radius: float = 0.95, K: int = 5) -> LiftedLinearSystem:
    generator = np.random.default_rng(seed)
    A = generator.standard_normal((K, K))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    B, C = generator.standard_normal((K, 6)), generator.standard_normal((6, K))
    return LiftedLinearSystem(A, B, C, step=0.02)


@given(seeds, st.integers(1, 12))
def test_a_long_step_is_many_short_ones_under_held_zeta(seed, stride):
    dut, generator = random_system(seed), np.random.default_rng(seed)
    z, zeta = generator.standard_normal(5), generator.standard_normal((4, 6))
    coarse = dut.resample(stride)
    assert coarse.step == pytest.approx(stride * dut.step)
    motions = ((dut, np.repeat(zeta, stride, axis=0)), (coarse, zeta))
    fine, found = (
        WrenchForecast(s.A, s.B, s.C, z, np.zeros((len(motion), 6))).rollout(motion)
        for s, motion in motions
    )
    np.testing.assert_allclose(found, fine[::stride], rtol=1e-9, atol=1e-9)


@given(seeds, st.floats(0.8, 1.5))
def test_modes_outside_are_pulled_onto_the_circle_and_keep_their_shape(seed, was):
    """Against the complex eigenvectors, which the code under test does not form."""
    A = random_system(seed, was, K=24).A
    eigenvalue, V = np.linalg.eig(A)
    factor = np.minimum(1.0, 0.99 / np.abs(eigenvalue))
    expected = (V * (eigenvalue * factor) @ np.linalg.inv(V)).real
    # The margin is 1e-9 of an eigenvalue
    np.testing.assert_allclose(stabilized(A, 0.99), expected, atol=1e-8)


def test_where_eigenvectors_coincide_it_is_stable_and_does_not_blow_up():
    jordan = 1.1 * np.eye(4) + np.eye(4, k=1)
    assert np.abs(np.linalg.eigvals(stabilized(jordan, 0.99))).max() <= 0.99
    J = np.eye(3, k=1)
    A = np.block([[1.1 * np.eye(3) + J, np.ones((3, 3))], [np.zeros((3, 3)), 0.9 * np.eye(3) + J]])
    assert np.linalg.norm(stabilized(A, 0.99), 2) <= np.linalg.norm(A, 2)


TAPS = Taps.averaging(delay=30, dense=5, averages=4)


def test_taps_are_the_newest_samples_and_averages_of_all_older_ones():
    matrix = TAPS.matrix
    np.testing.assert_array_equal(matrix[:5], np.eye(30)[::-1][:5])
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0)
    np.testing.assert_array_equal((matrix > 0).sum(axis=0), 1)
    assert np.all(np.diff((matrix[5:] > 0).sum(axis=1)) >= 0)


def test_features_and_expanded_weights_see_the_same_samples():
    generator = np.random.default_rng(0)
    windows, W = generator.standard_normal((5, 30, 12)), generator.standard_normal((3, 9 * 12))
    expected = windows.reshape(5, -1) @ TAPS.expand(W, 12).T
    np.testing.assert_allclose(TAPS.features(windows) @ W.T, expected, atol=1e-12)


def test_samples_at_lags_are_those_samples():
    samples = np.random.default_rng(0).standard_normal((40, 12))
    windows = np.stack([samples[k - 8 : k + 1] for k in (20, 39)])
    found = Taps.at_lags((0, 3, 8)).features(windows)
    np.testing.assert_array_equal(found, [samples[[k, k - 3, k - 8]].ravel() for k in (20, 39)])


def test_a_network_follows_the_linear_map():
    """|x| = relu(x) + relu(-x), of the oldest chi."""
    E, weights = np.eye(1, 24), (np.array([[1.0], [-1.0]]), np.array([[1.0, 1.0]]))
    window = np.zeros((3, 2, 12))
    window[:, 0, 0] = x = np.array([2.0, -3.0, 0.0])
    np.testing.assert_array_equal(Encoder(E, weights)(window)[:, 0], np.abs(x))
    np.testing.assert_array_equal(Encoder(E, offset=np.array([0.5]))(window)[:, 0], x + 0.5)


HORIZONS = np.array([1, 2, 5, 10, 20])
MODES = time_constants((2.0, 8.0, 30.0), (2.0, 8.0, 30.0), 1e5)
DUT = Trust(
    HORIZONS,
    MODES.readout(HORIZONS),
    MODES.projector(HORIZONS, np.ones((5, 2)), ridge=1e-12),
    np.zeros(6),
    half=20.0,
    evidence=10.0,
    caution=30.0,
    settle=20.0,
)


def sway(n: int = 800) -> np.ndarray:
    """(n, 6) a sum of slow lines on a level of 3 in force."""
    t, phase = np.arange(n)[:, None], np.arange(6.0)
    return np.sin(0.05 * t + phase) + 0.5 * np.sin(0.13 * t + 2 * phase) + 3.0 * (np.arange(6) < 3)


CHI = sway()
ORIGINS = np.arange(len(CHI) - 21)


def course(gain: float) -> np.ndarray:
    """(o, K) lifted states whose forecast departs `gain` times as much as the wrench will."""
    future = CHI[ORIGINS[:, None] + HORIZONS]
    base = np.where(np.arange(6) < 3, CHI[ORIGINS], 0.0)[:, None]
    return np.einsum("khc,ohc->ok", DUT.projector, base + gain * (future - base))


def errors(z: np.ndarray) -> np.ndarray:
    """(5, 2) RMSE of force and torque by horizon, over the second half."""
    error = np.einsum("hck,ok->ohc", DUT.readout, z) - CHI[ORIGINS[:, None] + HORIZONS]
    square = (error[len(error) // 2 :] ** 2).mean(axis=0)
    return np.sqrt(np.stack([square[:, :3].sum(1), square[:, 3:].sum(1)], axis=1))


def along(z: np.ndarray, chi: np.ndarray) -> np.ndarray:
    """The corrected z of a whole flight."""
    memory, corrected = DUT.initial_memory(), np.empty_like(z)
    for k, label in enumerate(chi):
        memory |= DUT.update(memory, z[k], label, labelled=True)
        corrected[k] = memory.pop("z")
    return corrected


def trusted(gain: float) -> np.ndarray:
    return along(course(gain), CHI[: len(ORIGINS)])


def test_a_forecast_of_the_future_is_never_used_before_it_is_verified():
    z, changed = course(1.0)[:300], CHI[:300].copy()
    changed[150:] += 5.0
    before = along(z, CHI[:300])[:150]
    np.testing.assert_array_equal(before, along(z, changed)[:150])


def test_a_good_forecast_comes_to_be_trusted_and_one_the_wrong_way_ignored():
    held = errors(course(0.0))
    assert np.all(errors(trusted(1.0)) < 0.25 * held)
    assert np.all(errors(trusted(-1.0)) < 1.1 * held)
    assert np.all(errors(course(-1.0)) > 1.5 * held)


def test_before_any_evidence_a_far_forecast_is_half_believed():
    chi = np.array([1.0, 0, 0, 0, 0, 0])
    z = np.einsum("khc,hc->k", DUT.projector, np.tile([2.0, 0, 0, 1.0, 0, 0], (5, 1)))
    corrected = DUT.update(DUT.initial_memory(), z, chi, labelled=True)["z"]
    forecast = (DUT.readout @ corrected)[:, 0]
    assert forecast[-1] == pytest.approx(1.5, abs=0.05)  # half = the last horizon
    assert forecast[0] == pytest.approx(1.95, abs=0.05)
