"""Laws of a family of lifted linear systems, of its parameter, and of the network on top of it."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.lifting.model.adaptive_family import EVERY, AdaptiveFamily, ModalAxis
from np_drake.lifting.model.lifted_model import LIFTED, NEURAL, LiftedModel, load_model, save_model
from np_drake.lifting.model.neural_family import MOST, WindowNetwork, with_network
from np_drake.residual_model import Sample
from np_drake.residual_models.flight_forecasts import model_predictions
from np_drake.residual_models.neural_predictor import NeuralPredictor

STEP, D, r = 0.02, 6, 2
# What views take of a sample: f_x, v_x, w_y and f_y, v_y, -w_x; f_z, v_z
PAIR = [[(0, 1.0), (6, 1.0), (10, 1.0)], [(1, 1.0), (7, 1.0), (9, -1.0)]]
SINGLE = [[(2, 1.0), (8, 1.0)]]
PLAIN = [[(0, 1.0), (6, 1.0)], [(1, 1.0), (7, 1.0)]]  # f_x, v_x; f_y, v_y
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def axis(views, rng):
    channels = np.zeros((len(views), len(views[0]), 12))
    for channel, view in zip(channels, views, strict=True):
        for row, (column, sign) in zip(channel, view, strict=True):
            row[column] = sign
    c = len(views[0])
    modes = [[[np.log(3.0), 0.3, 0.0]], [[np.log(0.2), 0.0, 0.0]], [[np.log(0.1), 0.0, 0.1]]]
    inputs = 0.05 * rng.standard_normal((3, c - 1, 1 + r))
    encoder = 0.3 * rng.standard_normal((3, c * D, 1 + r))
    return ModalAxis(channels, channels[:, 0, :6], *map(np.array, modes), inputs, encoder)


def family(*views, mean=(0.0, 0.0), **changes):
    rng = np.random.default_rng(0)
    axes = tuple(axis(view, rng) for view in views or (PLAIN,))
    fields = {"mean": np.array(mean), "covariance": np.diag([1.0, 0.25])}
    fields |= {"lags": np.array([3.0, 5.0]), "noise": np.full((len(axes), 2), 0.05), "memory": 20.0}
    return AdaptiveFamily(axes, **fields | changes)


@given(st.lists(st.floats(-5, 5), min_size=r, max_size=r))
def test_every_member_is_stable(theta):
    assert family().system(np.array(theta), STEP).spectral_radius <= 1.0


def flown(dut, theta, seconds):
    """Samples (n, 12) of a flight in which one member holds exactly."""
    s, rng = dut.system(theta, STEP), np.random.default_rng(0)
    samples, z = np.zeros((round(seconds / STEP), 12)), np.zeros(s.K)
    samples[:, 6:8] = 0.1 * np.cumsum(rng.standard_normal((len(samples), 2)), axis=0)
    for sample in samples:
        sample[:6] = s.C @ z
        z = s.A @ z + s.B @ sample[6:]
    return samples


def observer(dut, theta):
    """The encoder that reads the member's state of its last D samples exactly, for every theta."""
    at = dut.axes[0]
    A, B = at.matrices(theta, STEP)
    powers = [np.linalg.matrix_power(A, d) for d in range(D)]
    rows, drives = np.array([at.C @ P for P in powers]), np.zeros((D, D))
    to_end = np.zeros((3, D))
    for d in range(D):  # f_(k-D+1+d) = C A^d z0 + sum_j C A^(d-1-j) B u_j
        for j in range(d):
            drives[d, j] = at.C @ powers[d - 1 - j] @ B[:, 0]
        if d < D - 1:
            to_end[:, d] = powers[D - 2 - d] @ B[:, 0]
    back = powers[-1] @ np.linalg.pinv(rows)
    E = np.stack([back, to_end - back @ drives], axis=-1).reshape(3, 2 * D, 1)
    return np.concatenate([E, np.zeros((3, 2 * D, r))], axis=-1)


def test_of_a_flight_of_one_member_its_theta_is_found():
    truth, dut = np.array([0.4, 0.0]), family(noise=np.full((1, 2), 0.02))
    dut = dc.replace(dut, axes=(dc.replace(dut.axes[0], encoder=observer(dut, truth)),))
    samples = flown(dut, truth, 12.0)
    theta, covariance = dut.mean, dut.covariance
    for k in range(dut.window, len(samples), EVERY):
        theta, covariance = dut.update(theta, covariance, samples[k - dut.window : k], STEP)
    assert theta[0] == pytest.approx(0.4, abs=0.05)
    assert covariance[0, 0] < 0.1 * dut.covariance[0, 0]
    *_, (_, along) = dut.estimates(samples, STEP)
    assert along[0] == pytest.approx(0.4, abs=0.05)


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.floats(0.01, 100.0))
def test_the_covariance_never_exceeds_the_prior_and_stays_positive(seed, size):
    dut, rng = family(), np.random.default_rng(seed)
    window = size * rng.standard_normal((dut.window, 12))
    theta, covariance = dut.update(np.zeros(r), dut.covariance, window, STEP)
    assert np.isfinite(theta).all()
    assert np.linalg.eigvalsh(covariance).min() > 0
    assert np.linalg.eigvalsh(dut.covariance - covariance).min() > -1e-9


def test_what_is_not_told_any_more_is_forgotten_within_the_memory():
    dut = family(memory=1.0)
    theta, covariance = np.array([2.0, 0.0]), 0.01 * dut.covariance
    for _ in range(round(5.0 / (EVERY * STEP))):
        theta, covariance = dut.update(theta, covariance, np.zeros((dut.window, 12)), STEP)
    assert abs(theta[0]) < 0.02
    np.testing.assert_allclose(covariance, dut.covariance, rtol=1e-3)


def test_departures_are_those_of_the_recursion():
    dut, rng = family(), np.random.default_rng(2)
    thetas, window = rng.standard_normal((3, r)), rng.standard_normal((dut.window, 12))
    lags = dut.lags.astype(int)
    found = dut.axes[0].departures(thetas, window, lags, STEP)
    for theta, at in zip(thetas, found, strict=True):
        s, now = dut.system(theta, STEP), dut.read(window, theta)[1]
        for i, lag in enumerate(lags):
            z = dut.read(window[: len(window) - lag], theta)[1]
            for sample in window[len(window) - 1 - lag : -1]:
                z = s.A @ z + s.B @ sample[6:]
            np.testing.assert_allclose(at[:, i], (s.C @ (now - z))[:2], atol=1e-12)


def network(share=1.0):
    rng = np.random.default_rng(1)
    shapes = ((8, 2 * 4 + 3 + r), (8, 8), (9 + r, 8))
    weights = tuple(0.3 * rng.standard_normal(shape) for shape in shapes)
    biases = tuple(0.1 * rng.standard_normal(len(W)) for W in weights)
    white = tuple(0.3 * rng.standard_normal(s) for s in ((4, 3 * D), (3, 2 * D)))
    center, spread = np.array([0.1, -0.2]), np.array([1.0, 0.5])
    return WindowNetwork(
        white, ((2, 3), (1, 3)), weights, biases, center, spread, np.ones(9), share
    )


def model(share=1.0):
    dut = with_network(family(PAIR, SINGLE, mean=(0.1, -0.2)), network(share))
    ones = np.ones(6)
    return LiftedModel(NEURAL, dut.system(dut.mean, STEP), dut, dut.window, ones, ones, False)


def flight(n=40):
    return np.cumsum(0.2 * np.random.default_rng(5).standard_normal((n, 12)), axis=0)


def forecasts(dut, samples):
    """Forecasts (n - D + 1, 4, 6) along a flight."""
    origins, chi, zeta = np.arange(D - 1, len(samples) - 4), samples[:, :6], samples[:, 6:]
    dut = NeuralPredictor(dut)
    return model_predictions(dut, chi, zeta, origins, [0, 1, 2, 4], zeta_known=True)


def test_without_a_share_of_the_network_it_is_the_family():
    plain, samples = model().without_network, flight()
    assert (plain.configuration, plain.without_network) == (LIFTED, plain)
    expected = forecasts(plain, samples)
    np.testing.assert_allclose(forecasts(model(0.0), samples), expected, atol=1e-12)
    assert np.abs(forecasts(model(), samples) - expected).max() > 0.01


MIRROR = np.diag([1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("of_v", "of_w"),
    [(QUARTER, QUARTER), (QUARTER @ QUARTER, QUARTER @ QUARTER), (MIRROR, -MIRROR)],
    ids=["90 degrees", "180 degrees", "mirror"],
)
def test_what_is_felt_turned_or_mirrored_is_foreseen_so(of_v, of_w):
    image = np.zeros((12, 12))
    for i, part in enumerate((of_v, of_w, of_v, of_w)):
        image[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = part
    expected = forecasts(model(), flight())[..., :3] @ of_v.T
    found = forecasts(model(), flight() @ image.T)[..., :3]
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("configuration", [LIFTED, NEURAL])
def test_in_flight_z_waits_for_the_encoder_and_theta_for_the_whole_window(configuration):
    full = model() if configuration == NEURAL else model().without_network
    dut, samples = NeuralPredictor(full), flight()
    memory, thetas = dut.initial_memory(), full.encoder.thetas(samples, STEP)
    for k, row in enumerate(samples, start=1):
        x = np.array([0, 0, 1.0, 1, 0, 0, 0, *row[6:]])
        memory = dut.update(memory, Sample(x, np.zeros(4), row[:6]))
        forecast = dut.forecast(memory, horizon=3, stride=1)
        assert forecast.z.any() == (k >= D)
        first = -(-full.window // EVERY) * EVERY
        assert np.array_equal(memory["theta"], full.encoder.mean) == (k < first)
        if k >= D:
            np.testing.assert_allclose(memory["theta"], thetas[k - D], atol=1e-10)
            theta, z = full.encoder.read(samples[k - D : k], thetas[k - D])
            np.testing.assert_allclose(forecast.z, z, atol=1e-10)
            s = full.encoder.system(theta, STEP)
            np.testing.assert_allclose(forecast.A, s.A, atol=1e-10)
            np.testing.assert_allclose(forecast.B, s.B, atol=1e-10)


@settings(max_examples=25)
@given(st.floats(1.0, 1e9))
def test_the_correction_is_bounded_however_wild_the_window(size):
    dut, plain = network(), family(PAIR, SINGLE)
    windows = np.random.default_rng(2).standard_normal((5, D, 12))
    x = dut.inputs([size * part for part in plain.seen(windows)], size * np.ones((5, r)))
    unit = np.concatenate([dut.size, dut.spread])
    here, least = (
        np.concatenate(dut.correction(at), axis=1) / unit for at in (x, np.zeros_like(x))
    )
    most = dut.lipschitz_bound * MOST * np.sqrt(x.shape[1])
    assert np.linalg.norm(here - least, axis=1).max() <= most
    change = here[0, 9:] * dut.spread
    assert with_network(plain, dut).system(plain.mean + change, STEP).spectral_radius <= 1.0


@pytest.mark.parametrize("own", [model(0.75), model().without_network], ids=[NEURAL, LIFTED])
def test_the_file_holds_all_of_it(own, tmp_path):
    save_model(own, tmp_path / "m.safetensors")
    read = load_model(tmp_path / "m.safetensors")
    assert (type(read.encoder), read.encoder.memory) == (type(own.encoder), 20.0)
    np.testing.assert_array_equal(forecasts(read, flight()), forecasts(own, flight()))
    found, expected = (m.encoder.read(flight()[None], m.encoder.mean)[1] for m in (read, own))
    np.testing.assert_array_equal(found, expected)
