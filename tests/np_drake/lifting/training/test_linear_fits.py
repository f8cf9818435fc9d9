"""Laws of the ridge for every horizon."""

import numpy as np
import pytest

from np_drake.lifting.model.lifted_linear_system import DelayTaps
from np_drake.lifting.training.excitation import turns
from np_drake.lifting.training.linear_fits import flight_moments, horizon_ridge, relative_error

TAPS = DelayTaps(4, 4, 0)
HORIZONS = np.array([0, 1, 3, 9])


def oscillation(seed: int) -> np.ndarray:
    """(600, 12) damped oscillators driven by noise, six of them beside white zeta."""
    generator = np.random.default_rng(seed)
    x = np.zeros((600, 12))
    x[:, 6:] = generator.standard_normal((600, 6))
    for k in range(2, 600):
        x[k, :6] = 1.9 * x[k - 1, :6] - 0.95 * x[k - 2, :6] + 0.1 * generator.standard_normal(6)
    return x


def moments(samples: np.ndarray, symmetry: float = 0.0, most: int = 10**6):
    options = {"taps": TAPS, "horizons": HORIZONS, "max_origins": most, "symmetry": symmetry}
    return flight_moments(samples, samples[:, :6], **options)


def test_now_is_the_newest_sample_and_a_recursion_is_found():
    W = horizon_ridge([moments(oscillation(0)), moments(oscillation(1))], noise=1e-6)
    np.testing.assert_allclose(W[:6, 0], np.eye(6), atol=1e-6)
    np.testing.assert_allclose(W[6:, 0], 0.0, atol=1e-6)
    assert np.diag(W[:6, 1]) == pytest.approx(1.9, abs=0.1)  # of 1200 noisy samples
    assert np.diag(W[12:18, 1]) == pytest.approx(-0.95, abs=0.1)


def test_a_calm_flight_counts_as_much_as_a_wild_one():
    """The same flight a hundred times smaller tells the same; a pooled fit would not listen."""
    wild, calm = oscillation(0), 0.01 * oscillation(1)
    calm[:, 6:] *= 100  # of zeta, the fit takes all alike
    flights = [moments(wild), moments(calm)]
    both = horizon_ridge(flights, noise=1e-9)
    ratios = []
    for flight in flights:
        alone = horizon_ridge([flight], noise=1e-9)
        ratios.append(
            relative_error(flight, both)[1:].mean() / relative_error(flight, alone)[1:].mean()
        )
    assert ratios[1] == pytest.approx(ratios[0], rel=0.1)


def test_relative_error_is_that_of_the_forecasts():
    x = oscillation(2)
    dut, W = moments(x), horizon_ridge([moments(x)], noise=1e-3)
    origins = np.arange(3, 600 - 9)
    F = np.hstack([TAPS.features(x, origins), np.ones((len(origins), 1))])
    error = np.einsum("op,phc->ohc", F, W) - x[origins[:, None] + HORIZONS, :6]
    force = (error[..., :3] ** 2).sum(axis=2).mean(axis=0) / dut.power[:, 0]
    np.testing.assert_allclose(relative_error(dut, W)[:, 0], force, rtol=1e-9, atol=1e-12)


def test_full_symmetry_makes_the_turned_flight_the_same_flight():
    x = oscillation(3)
    turned = [np.hstack(pair) for pair in zip(turns(x[:, :6]), turns(x[:, 6:]), strict=True)]
    for image in turned[1:]:
        for name in ("gram", "cross"):
            found, expected = (getattr(moments(y, 1.0), name) for y in (image, x))
            np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.abs(moments(turned[1]).gram - moments(x).gram).max() > 0.01


@pytest.mark.parametrize(("most", "stride"), [(588, 1), (300, 2), (7, 84)])
def test_origins_are_thinned_evenly_to_the_most_that_are_allowed(most, stride):
    samples = oscillation(3)
    origins = np.arange(TAPS.delay - 1, len(samples) - HORIZONS[-1], stride)
    assert len(origins) <= most
    expected = np.mean(samples[origins[:, None] + HORIZONS, :6] ** 2, axis=0)
    np.testing.assert_allclose(moments(samples, most=most).square, expected)
