"""Laws of the weights of a bank after a label."""

import numpy as np

from np_drake.payload_filter.kernel import PARAMETERS, POINT, weigh_bank

PRIOR, DEVIATION = np.zeros((3, 8)), np.ones((3, 8))
FIRST = np.array([0.5, 0.3, 0.2])


def weighed(weight, likelihood, *, mean=None, stay=1.0):
    out = np.empty(3)
    at = np.zeros((3, POINT)) if mean is None else mean
    weigh_bank(np.array(weight), np.array(likelihood), at, PRIOR, DEVIATION, FIRST, stay, out)
    return out


def test_without_changes_the_weights_are_those_of_bayes():
    weight, likelihood = np.array([0.2, 0.5, 0.3]), np.array([-1.0, 0.5, 2.0])
    wanted = weight * np.exp(likelihood)
    np.testing.assert_allclose(weighed(weight, likelihood), wanted / wanted.sum(), rtol=1e-12)


def test_likelihoods_that_underflow_are_compared_all_the_same():
    np.testing.assert_allclose(
        weighed([0.5, 0.5, 0.0], [-2000.0, -2001.0, 0.0]), [*_odds(1.0), 0.0], rtol=1e-9
    )


def test_a_member_without_weight_returns_with_the_share_that_is_drawn_anew():
    found = weighed([1.0, 0.0, 0.0], [0.0, 0.0, 0.0], stay=0.9)
    np.testing.assert_allclose(found, [0.9 + 0.05, 0.03, 0.02], rtol=1e-12)


def test_parameters_that_could_not_have_been_drawn_are_not_drawn_anew():
    mean = np.zeros((3, POINT))
    mean[1, PARAMETERS] = 2.0  # two deviations in each of eight parameters
    anew = 0.1 * FIRST * [1.0, np.exp(-16.0), 1.0]
    wanted = [0.9, 0.0, 0.0] + anew
    np.testing.assert_allclose(
        weighed([1.0, 0, 0], np.zeros(3), mean=mean, stay=0.9), wanted / wanted.sum(), rtol=1e-9
    )


def _odds(difference):
    """Return two weights whose logarithms differ by this much."""
    share = 1 / (1 + np.exp(-difference))
    return share, 1 - share
