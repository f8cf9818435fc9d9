"""Laws of the payload that a bank of pendulums believes to carry."""

import numpy as np
import pytest

from np_drake.payload_filter import kernel
from np_drake.payload_filter.filter_bank import CONDITIONS, payload_estimate
from np_drake.payload_filter.predictor import PayloadFilter

MASS, STEP = 2.0, 0.02  # of the made-up flights: vehicle [kg], sample [s]


def believed(weight, mass, deviation, *, bare=0.0, log_length=0.0):
    """A memory of members that differ in the payload's mass share, and one that carries nothing;
    all of them calm.
    """
    count = len(weight) + 1
    members = count * len(CONDITIONS)
    mean = np.zeros((members, kernel.POINT))
    covariance = np.zeros((members, kernel.SIZE, kernel.SIZE))
    error = kernel.MASS - (kernel.POINT - kernel.SIZE)
    mean[: count - 1, kernel.MASS], covariance[: count - 1, error, error] = (
        mass,
        np.square(deviation),
    )
    mean[: count - 1, kernel.LOG_LENGTH], mean[count - 1 :, kernel.LOG_LENGTH] = log_length, 5.0
    shares = np.zeros(members)
    shares[: count - 1], shares[count - 1] = (1 - bare) * np.array(weight), bare
    return {"weight": shares, "mean": mean, "covariance": covariance}


def test_of_one_member_it_is_its_gaussian():
    found = payload_estimate(believed([1.0], 0.1, 0.02)).mass
    assert found == pytest.approx((0.1, 0.1 - 1.96 * 0.02, 0.1 + 1.96 * 0.02), abs=1e-4)


def test_members_that_disagree_widen_the_interval_to_both():
    found = payload_estimate(believed([0.5, 0.5], [0.1, 0.3], 0.01)).mass
    assert found.mean == pytest.approx(0.2)
    assert found.low < 0.1 < 0.3 < found.high
    assert found.high - found.low < 0.25


def test_a_member_without_weight_says_nothing():
    found = payload_estimate(believed([1.0, 0.0], [0.1, 0.9], 0.01)).mass
    assert found.high < 0.13


def test_the_length_is_that_of_a_payload_if_there_is_one():
    found = payload_estimate(believed([1.0], 0.1, 0.01, bare=0.9, log_length=np.log(0.7)))
    assert found.length.mean == pytest.approx(0.7)
    assert found.length.high == pytest.approx(0.7, rel=1e-6)
    assert found.mass.mean == pytest.approx(0.01)
    assert found.mass.low == pytest.approx(0.0, abs=1e-6)


def test_after_a_swing_the_truth_lies_in_the_intervals(model, flown):
    flight = flown(length=1.2, seconds=10.0, radius=1.0, swing=0.3, noise=0.02)
    predictor = PayloadFilter(model())
    memory = predictor.initial_memory()
    for sample in flight.samples:
        memory = predictor.update(memory, sample)
    found = payload_estimate(memory)
    for estimate, truth, width in zip(
        found, (1.2, 0.26 / MASS, 0.0), (0.5, 0.05, 0.3), strict=True
    ):
        assert estimate.low - 1e-3 < truth < estimate.high + 1e-3
        assert estimate.high - estimate.low < width  # a third of the prior's and less
