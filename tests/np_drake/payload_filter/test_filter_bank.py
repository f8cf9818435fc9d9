"""Laws of a bank of pendulums: its weights after a label, and the payload that it believes in."""

import numpy as np
import pytest

from np_drake.payload_filter import kernel
from np_drake.payload_filter.filter_bank import CONDITIONS, payload_estimate
from np_drake.payload_filter.kernel import PARAMETERS, POINT, weigh_bank

FIRST = np.array([0.5, 0.3, 0.2])


def weighed(weight, likelihood, *, at=None, stay=1.0):
    out, prior, deviation = np.empty(3), np.zeros((3, 8)), np.ones((3, 8))
    mean = np.zeros((3, POINT)) if at is None else at
    weigh_bank(np.array(weight), np.array(likelihood), mean, prior, deviation, FIRST, stay, out)
    return out


def test_without_changes_the_weights_are_those_of_bayes():
    weight, likelihood = np.array([0.2, 0.5, 0.3]), np.array([-1.0, 0.5, 2.0])
    wanted = weight * np.exp(likelihood)
    for shift in (0.0, -2000.0):
        found = weighed(weight, likelihood + shift)
        np.testing.assert_allclose(found, wanted / wanted.sum(), rtol=1e-9)


def test_a_member_without_weight_returns_with_the_share_drawn_anew():
    found = weighed([1.0, 0.0, 0.0], np.zeros(3), stay=0.9)
    np.testing.assert_allclose(found, [0.9 + 0.05, 0.03, 0.02], rtol=1e-12)
    far = np.zeros((3, POINT))
    far[1, PARAMETERS] = 2.0  # two deviations in each of eight parameters
    wanted = [0.9, 0.0, 0.0] + 0.1 * FIRST * [1.0, np.exp(-16.0), 1.0]
    found = weighed([1.0, 0, 0], np.zeros(3), at=far, stay=0.9)
    np.testing.assert_allclose(found, wanted / wanted.sum(), rtol=1e-9)


def believed(weight, mass, deviation, *, bare=0.0, log_length=0.0):
    """A calm memory of members of other mass shares, and one that carries nothing."""
    count = len(weight) + 1
    members = count * len(CONDITIONS)
    mean, shares = np.zeros((members, kernel.POINT)), np.zeros(members)
    covariance = np.zeros((members, kernel.SIZE, kernel.SIZE))
    error = kernel.MASS - (kernel.POINT - kernel.SIZE)
    mean[: count - 1, kernel.MASS] = mass
    covariance[: count - 1, error, error] = np.square(deviation)
    mean[: count - 1, kernel.LOG_LENGTH], mean[count - 1 :, kernel.LOG_LENGTH] = log_length, 5.0
    shares[: count - 1], shares[count - 1] = (1 - bare) * np.array(weight), bare
    return {"weight": shares, "mean": mean, "covariance": covariance}


def test_the_estimate_is_the_mixture_of_the_members_that_have_weight():
    one = payload_estimate(believed([1.0], 0.1, 0.02)).mass
    assert one == pytest.approx((0.1, 0.1 - 1.96 * 0.02, 0.1 + 1.96 * 0.02), abs=1e-4)
    two = payload_estimate(believed([0.5, 0.5], [0.1, 0.3], 0.01)).mass
    assert two.mean == pytest.approx(0.2)
    assert two.low < 0.1 < 0.3 < two.high < two.low + 0.25
    assert payload_estimate(believed([1.0, 0.0], [0.1, 0.9], 0.01)).mass.high < 0.13


def test_the_length_is_that_of_a_payload_if_there_is_one():
    found = payload_estimate(believed([1.0], 0.1, 0.01, bare=0.9, log_length=np.log(0.7)))
    assert (found.length.mean, found.length.high) == pytest.approx((0.7, 0.7))
    assert (found.mass.mean, found.mass.low) == pytest.approx((0.01, 0.0), abs=1e-6)
