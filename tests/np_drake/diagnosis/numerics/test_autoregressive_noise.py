"""Laws of the autoregressive noise model and of whitening with it."""

import numpy as np
from scipy import signal

from np_drake.diagnosis.numerics import fit_noise, no_worse, scale_only, with_loudness

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


def test_scale_only_makes_channels_comparable():
    values = processes(0) * [1.0, 10.0, 0.0]
    white = scale_only([values], STEP).whiten(values)
    np.testing.assert_allclose(np.sqrt(np.mean(white[:, :2] ** 2, axis=0)), 1.0, rtol=1e-3)
    np.testing.assert_array_equal(white[:, 2], 0.0)


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
