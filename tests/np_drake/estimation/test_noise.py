"""Laws of whitening by a noise model, against its definition written out."""

import numpy as np
import pytest
from scipy import signal

from np_drake.estimation.noise import (
    ROBUST_ORDER,
    NoiseModel,
    RobustNoise,
    fit_noise,
    no_worse,
    with_loudness,
)

M, C, P = 40, 5, 3
ABSENT = 2  # channel that the logs lack


def a_model(seed: int) -> NoiseModel:
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-0.3, 0.3, (C, P))
    phi[0] = 0.0  # white
    rms = rng.uniform(0.5, 2.0, C)
    mixing = np.tril(rng.standard_normal((C, C))) + 2 * np.eye(C)
    rms[ABSENT] = 0.0
    mixing[ABSENT] = mixing[:, ABSENT] = 0.0
    return NoiseModel(phi, mixing, rms, rms**2, 0.02, {"loud": np.arange(1.0, C + 1)})


def whitened(model: NoiseModel, values: np.ndarray, flight: str) -> np.ndarray:
    """Return mixing @ innovations, with e_t = y_t - sum_k phi_k y_(t-k) over the flight's
    loudness.
    """
    flat = values.reshape(M, C, -1)
    out = np.zeros((M - P, C, flat.shape[2]))
    loud = model.loudness.get(flight, np.ones(C))
    for t in range(P, M):
        past = sum(model.phi[:, k - 1, None] * flat[t - k] for k in range(1, P + 1))
        out[t - P] = model.mixing @ ((flat[t] - past) / loud[:, None])
    return out.reshape(M - P, *values.shape[1:])


@pytest.mark.parametrize("flight", ["quiet", "loud"])
@pytest.mark.parametrize("shape", [(), (4,), (2, 3)])
def test_whitened_channels_are_mixed_innovations(flight, shape):
    model, values = a_model(1), np.random.default_rng(2).standard_normal((M, C, *shape))
    np.testing.assert_allclose(
        model.whiten(values, flight), whitened(model, values, flight), atol=1e-12
    )


@pytest.mark.parametrize("flight", ["quiet", "loud"])
def test_columns_of_zeros_and_absent_channels_change_no_product(flight):
    rng, model = np.random.default_rng(3), a_model(4)
    groups = [rng.standard_normal((M, C, k)) for k in (3, 1, 2)]
    groups[0][:, 1] = 0.0  # one group does nothing in a channel
    groups[0][:, 3, 1] = 0.0  # one column of it does nothing in another
    groups[2][:, :ABSENT] = groups[2][:, ABSENT + 1 :] = 0.0  # acts in the absent channel alone
    white = whitened(model, np.concatenate(groups, axis=2), flight).reshape(-1, 6)
    np.testing.assert_allclose(model.products(groups, flight), white.T @ white, atol=1e-9)
    np.testing.assert_allclose(model.products(groups, flight)[4:], 0.0, atol=1e-12)


def test_the_spectrum_integrates_to_the_variance_of_the_process():
    a, variance = 0.6, 2.0
    model = NoiseModel(np.array([[a]]), np.eye(1), np.ones(1), np.array([variance]), 0.02)
    frequency = np.linspace(0.0, 25.0, 20001)
    power = np.trapezoid(model.spectrum(frequency)[0], frequency)
    assert power == pytest.approx(variance / (1 - a**2), rel=1e-4)


STEP = 0.02
PHI = {0: [1.2, -0.6], 1: [0.5], 2: []}  # of three processes


def processes(seed: int, n: int = 6000, mixing: np.ndarray | None = None) -> np.ndarray:
    """Return autoregressive channels (n, 3), driven by white noise with the covariance mixing
    mixing'.
    """
    drive = np.random.default_rng(seed).normal(size=(n + 200, 3))
    drive = drive if mixing is None else drive @ mixing.T
    parts = [signal.lfilter([1.0], [1.0, *(-np.array(PHI[c]))], drive[:, c]) for c in range(3)]
    return np.stack(parts, axis=1)[200:]


def test_whitening_gives_unit_innovations_independent_across_channels():
    mixing = np.array([[1.0, 0, 0], [0.8, 0.6, 0], [-0.5, 0.5, 0.7]])
    dut = fit_noise([processes(0, 20000, mixing)], STEP)
    white = dut.whiten(processes(5, 20000, mixing))  # of an unseen flight
    # 4 sigma of two sets of samples
    np.testing.assert_allclose(white.T @ white / len(white), np.eye(3), atol=0.05)
    for lag in (1, 2, 5):
        correlation = white[lag:].T @ white[:-lag] / len(white)
        assert np.abs(correlation).max() < 0.035  # 4 sigma and the figures' own error


def test_the_first_channels_are_whitened_alike_without_the_others():
    dut = fit_noise([processes(0, 800)], STEP)
    x = processes(1, 300)
    np.testing.assert_allclose(dut.head(2).whiten(x[:, :2]), dut.whiten(x)[:, :2], atol=1e-12)


def test_errors_that_residuals_lack_are_in_the_noise_all_the_same():
    residual = np.random.default_rng(0).normal(size=(4000, 3))
    dut = fit_noise([residual], STEP, white=np.array([0.0, 1.0, 3.0]))
    np.testing.assert_allclose(
        np.var(dut.whiten(residual), axis=(0)), [1.0, 1 / 2, 1 / 10], rtol=0.05
    )


def test_a_mean_is_no_noise():
    values = processes(0)
    dut, moved = fit_noise([values], STEP), fit_noise([values + [5.0, -3.0, 1.0]], STEP)
    np.testing.assert_allclose(moved.phi, dut.phi, atol=1e-9)
    np.testing.assert_allclose(moved.rms, dut.rms)


def test_a_fit_that_made_a_channel_worse_does_not_raise_its_noise():
    before = [np.ones((4, 3)) * [1.0, 1.0, 1.0]]
    after = [np.array([[0.5, 3.0, 1.0], [-0.5, -3.0, -1.0]] * 2)]
    (found,) = no_worse(after, before)
    np.testing.assert_array_equal(found[:, 0], after[0][:, 0])
    np.testing.assert_array_equal(found[:, 1], before[0][:, 1])
    np.testing.assert_array_equal(found[:, 2], after[0][:, 2])


def test_a_flight_with_three_times_the_error_is_whitened_to_the_same_size():
    errors = [processes(0), 3.0 * processes(1)]
    dut = with_loudness(fit_noise(errors, STEP), errors, ["quiet", "loud"])
    np.testing.assert_allclose(dut.loudness["loud"] / dut.loudness["quiet"], 3.0, rtol=0.05)
    for error, flight in zip(errors, ("quiet", "loud"), strict=True):
        np.testing.assert_allclose(np.mean(dut.whiten(error, flight) ** 2, axis=0), 1.0, rtol=0.1)


@pytest.fixture
def coloured():
    e = np.random.default_rng(0).normal(size=(4000, 2))
    return signal.lfilter([1.0], [1.0, -0.9], e, axis=0) * [3.0, 0.1]


def test_coloured_noise_becomes_white_with_unit_variance(coloured):
    dut = RobustNoise.of(coloured, np.ones(4000, bool), STEP).whiten(coloured)[ROBUST_ORDER:]
    assert np.std(dut, axis=0) == pytest.approx([1.0, 1.0], rel=0.05)
    for lag in (1, 2, 5):
        assert np.abs(np.mean(dut[lag:] * dut[:-lag], axis=0)).max() < 4 / np.sqrt(4000)


def test_rows_that_do_not_count_and_those_that_follow_are_zero(coloured):
    good = np.ones(4000, bool)
    good[1000:1010] = False
    dut = RobustNoise.of(coloured, good, STEP).whiten(coloured)
    assert np.all(dut[1000 : 1010 + ROBUST_ORDER] == 0.0)
    assert np.any(dut[1010 + ROBUST_ORDER] != 0.0)


def test_an_outlier_counts_as_huber_says_and_an_impossible_one_not(coloured):
    e = np.random.default_rng(1).normal(size=(4000, 1))
    e[2000], e[3000] = 5.0, 50.0
    dut = RobustNoise.of(e, np.ones(4000, bool), STEP, order=1)
    assert dut.whiten(e)[2000, 0] == pytest.approx(np.sqrt(3.0 * 5.0), rel=0.1)
    assert dut.whiten(e)[3000, 0] == 0.0
