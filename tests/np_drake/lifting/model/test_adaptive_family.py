"""Laws of a family of lifted linear systems and of its parameter."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.lifting.model.adaptive_family import (
    EVERY,
    AdaptiveFamily,
    ModalAxis,
    family_of,
    family_tensors,
)
from np_drake.lifting.model.lifted_model import LIFTED, LiftedModel
from np_drake.residual_model import Sample
from np_drake.residual_models.neural_predictor import NeuralPredictor

STEP, D, r = 0.02, 6, 2
PLAIN = np.array([[1.0, *np.zeros(11)], [*np.zeros(6), 1.0, *np.zeros(5)]])  # f_x, v_x
TURNED = np.array([[0.0, 1.0, *np.zeros(10)], [*np.zeros(7), 1.0, *np.zeros(4)]])  # f_y, v_y


def axis(seed=0):
    rng = np.random.default_rng(seed)
    return ModalAxis(
        np.stack([PLAIN, TURNED]),
        np.stack([PLAIN[0, :6], TURNED[0, :6]]),
        np.array([[np.log(3.0), 0.3, 0.0]]),
        np.array([[np.log(0.2), 0.0, 0.0]]),
        np.array([[np.log(0.1), 0.0, 0.1]]),
        0.05 * rng.standard_normal((3, 1, 1 + r)),
        0.3 * rng.standard_normal((3, 2 * D, 1 + r)),
    )


def family(**changes):
    fields = {"mean": np.zeros(r), "covariance": np.diag([1.0, 0.25]), "lags": np.array([3.0, 5.0])}
    fields |= {"noise": np.full((1, 2), 0.05), "memory": 20.0} | changes
    return AdaptiveFamily((axis(),), **fields)


@settings(deadline=None)  # the first example may compile
@given(st.lists(st.floats(-5, 5), min_size=r, max_size=r))
def test_every_member_is_stable(theta):
    assert family().system(np.array(theta), STEP).spectral_radius <= 1.0


def test_views_are_one_axis_turned():
    dut, rng = family(), np.random.default_rng(1)
    window = rng.standard_normal((dut.window, 12))
    swapped = window.copy()
    swapped[:, [0, 1, 6, 7]] = window[:, [1, 0, 7, 6]]
    z, other = dut.lift(window, np.array([0.3, -0.2])), dut.lift(swapped, np.array([0.3, -0.2]))
    np.testing.assert_allclose(other, np.roll(z, 3))


def flown(dut, theta, seconds, seed=0, noise=0.0, gain=1.0):
    """Samples (n, 12) of a flight in which one member holds exactly, its readings those of its own
    states.
    """
    s, rng = dut.system(theta, STEP), np.random.default_rng(seed)
    n = round(seconds / STEP)
    samples = np.zeros((n, 12))
    z = np.zeros(s.K)
    samples[:, 6:8] = gain * np.cumsum(rng.standard_normal((n, 2)), axis=0) * 0.1
    for k in range(n):
        samples[k, :6] = s.C @ z + noise * rng.standard_normal(6)
        z = s.A @ z + s.B @ samples[k, 6:]
    return samples


def observer(dut, theta):
    """The family with the encoder that reads the member's state of its last D samples exactly, for
    every theta.
    """
    at = dut.axes[0]
    A, B = at.matrices(theta, STEP)
    rows, drives = [], []
    for d in range(D):  # f_(k-D+1+d) = C A^d z0 + sum_j C A^(d-1-j) B u_j
        rows.append(at.C @ np.linalg.matrix_power(A, d))
        drives.append(
            [
                float(at.C @ np.linalg.matrix_power(A, d - 1 - j) @ B[:, 0]) if j < d else 0.0
                for j in range(D)
            ]
        )
    inverse, forced = np.linalg.pinv(np.array(rows)), np.array(drives)
    end = np.linalg.matrix_power(A, D - 1)
    to_end = [
        np.linalg.matrix_power(A, D - 2 - j) @ B[:, 0] if j < D - 1 else np.zeros(3)
        for j in range(D)
    ]
    E = np.zeros((3, D, 2))
    E[..., 0] = end @ inverse
    E[..., 1] = np.array(to_end).T - end @ inverse @ forced
    return np.concatenate([E.reshape(3, 2 * D, 1), np.zeros((3, 2 * D, r))], axis=-1)


def test_of_a_flight_of_one_member_its_theta_is_found():
    truth = np.array([0.4, 0.0])
    dut = family()
    at = dc.replace(dut.axes[0], encoder=observer(dut, truth))
    dut = dc.replace(dut, axes=(at,), noise=np.full((1, 2), 0.02))
    samples = flown(dut, truth, 12.0)
    theta, covariance = dut.mean, dut.covariance
    for k in range(dut.window, len(samples), EVERY):
        theta, covariance = dut.update(theta, covariance, samples[k - dut.window : k], STEP)
    assert theta[0] == pytest.approx(0.4, abs=0.05)
    assert covariance[0, 0] < 0.1 * dut.covariance[0, 0]
    *_, (_, along) = dut.estimates(samples, STEP)
    assert along[0] == pytest.approx(0.4, abs=0.05)


def test_a_forecast_waits_for_the_encoder_and_theta_for_the_window():
    dut = family()
    model = NeuralPredictor(
        LiftedModel(LIFTED, dut.system(dut.mean, STEP), dut, dut.window, *np.ones((2, 6)), False)
    )
    samples, memory = flown(dut, np.array([0.4, 0.0]), 1.0), model.initial_memory()
    course = model.along(samples[:, :6], samples[:, 6:])
    assert course.first == D - 1
    for k, row in enumerate(samples, start=1):
        memory = model.update(
            memory, Sample(np.array([0, 0, 1.0, 1, 0, 0, 0, *row[6:]]), np.zeros(4), row[:6])
        )
        forecast = model.forecast(memory, horizon=3, stride=1)
        assert forecast.z.any() == (k >= D and samples[:k, :6].any())
        assert np.array_equal(memory["theta"], dut.mean) == (k < -(-dut.window // EVERY) * EVERY)
        if k >= D:
            np.testing.assert_allclose(course.z[k - D], memory["z"], atol=1e-12)
            np.testing.assert_allclose(course.A[k - D], forecast.A, atol=1e-12)


def test_a_vehicle_at_rest_leaves_theta_at_its_prior():
    dut = family()
    theta, covariance = dut.update(np.zeros(r), dut.covariance, np.zeros((dut.window, 12)), STEP)
    np.testing.assert_allclose(theta, 0.0, atol=1e-12)
    np.testing.assert_allclose(covariance, dut.covariance, rtol=1e-9)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.01, 100.0))
def test_the_covariance_never_exceeds_the_prior_and_stays_positive(seed, size):
    dut, rng = family(), np.random.default_rng(seed)
    theta, covariance = dut.update(
        np.zeros(r), dut.covariance, size * rng.standard_normal((dut.window, 12)), STEP
    )
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


def test_tensors_hold_all_of_a_family():
    dut = AdaptiveFamily((axis(1),), np.ones(r), np.eye(r), np.array([3.0]), np.ones((1, 1)), 7.0)
    found = family_of(family_tensors(dut))
    window = np.random.default_rng(0).standard_normal((dut.window, 12))
    np.testing.assert_array_equal(found.lift(window, np.ones(r)), dut.lift(window, np.ones(r)))
    assert found.memory == 7.0


def test_departures_are_those_of_the_recursion():
    dut, rng = family(), np.random.default_rng(2)
    thetas, window = rng.standard_normal((3, r)), rng.standard_normal((dut.window, 12))
    found = dut.axes[0].departures(thetas, window, dut.lags.astype(int), STEP)
    for theta, at in zip(thetas, found, strict=True):
        s = dut.system(theta, STEP)
        for i, lag in enumerate(dut.lags.astype(int)):
            z = dut.lift(window[: len(window) - lag], theta)
            for sample in window[len(window) - 1 - lag : -1]:
                z = s.A @ z + s.B @ sample[6:]
            np.testing.assert_allclose(
                at[:, i], (s.C @ (dut.lift(window, theta) - z))[:2], atol=1e-12
            )


def test_the_encoder_at_theta_lifts_as_the_family_does():
    dut, rng = family(), np.random.default_rng(3)
    theta, window = rng.standard_normal(r), rng.standard_normal((D, 12))
    np.testing.assert_allclose(dut.encoder(theta)(window), dut.lift(window, theta))
