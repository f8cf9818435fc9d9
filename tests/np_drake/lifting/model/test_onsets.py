"""Laws of the encoder for windows in which something began."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.lifting.model.onsets import Onsets

V, R, Q, D, C, K = 2, 3, 2, 6, 4, 3
ODDS = np.array([0.05, 0.2, 1.0])


def made(scale: float = 0.3) -> Onsets:
    rng = np.random.default_rng(0)
    watch, jump = scale * rng.standard_normal((V, R, Q, D * C)), rng.standard_normal((V, R, K, Q))
    return Onsets(rng.standard_normal((V, C, 12)), watch, rng.uniform(0.5, 2.0, (V, R)), jump, ODDS)


DUT = made()
WINDOWS = np.random.default_rng(1).standard_normal((4, 5, D, 12))


def test_the_correction_is_the_mean_over_all_ages_by_their_likelihood():
    wanted = []
    for channels, watch, cost, jump in zip(DUT.channels, DUT.watch, DUT.cost, DUT.jump, strict=True):
        seen = [M @ (WINDOWS[0, 0] @ channels.T).ravel() for M in watch]
        likely = np.array([o * np.exp(q @ q / 2 - c) for o, q, c in zip(ODDS, seen, cost, strict=True)])
        p = likely / (1.0 + likely.sum())
        wanted.append(sum(p[r] * jump[r] @ seen[r] for r in range(R)))
    np.testing.assert_allclose(DUT.correction(WINDOWS[0, 0]), np.concatenate(wanted), atol=1e-12)


def test_a_window_that_shows_nothing_is_left_alone():
    assert not DUT.correction(np.zeros((D, 12))).any()
    likely = DUT.odds * np.exp(-DUT.cost)
    wanted = likely / (1.0 + likely.sum(axis=1, keepdims=True))
    np.testing.assert_allclose(DUT.probability(np.zeros((D, 12))), wanted, atol=1e-12)


def test_one_number_is_the_odds_of_every_age():
    one, each = (dc.replace(DUT, odds=odds) for odds in (0.3, np.full(R, 0.3)))
    np.testing.assert_array_equal(one.correction(WINDOWS), each.correction(WINDOWS))


def test_the_opposite_window_gets_the_opposite_correction():
    np.testing.assert_allclose(DUT.correction(-WINDOWS), -DUT.correction(WINDOWS), atol=1e-12)


def test_without_odds_worth_mentioning_there_is_no_correction():
    quiet = 0.1 * WINDOWS  # |M w|² of a few at most
    assert np.abs(dc.replace(DUT, odds=1e-200).correction(quiet)).max() < 1e-190


def test_however_loud_a_window_its_probabilities_are_some():
    p = DUT.probability(1e6 * WINDOWS)
    assert np.isfinite(p).all()
    np.testing.assert_allclose(p.sum(axis=-1), 1.0, atol=1e-9)  # something began, for certain


def test_many_windows_are_as_one_by_one():
    one_by_one = np.array([[DUT.correction(window) for window in row] for row in WINDOWS])
    np.testing.assert_allclose(DUT.correction(WINDOWS), one_by_one, atol=1e-12)
    assert DUT.probability(WINDOWS).shape == (4, 5, V, R)


def test_along_a_flight_it_is_the_correction_of_every_window():
    samples = np.random.default_rng(2).standard_normal((20, 12))
    wanted = [DUT.correction(samples[k : k + D]) for k in range(15)]
    np.testing.assert_allclose(DUT.along(samples), wanted, atol=1e-12)


@pytest.mark.parametrize(
    "change, match",
    [
        ({"cost": np.zeros((V, R + 1))}, "must agree on V, R, q and c"),
        ({"watch": np.zeros((V, R, Q, D * C + 1))}, "must agree on V, R, q and c"),
        ({"jump": np.zeros((V, R, K))}, "must agree on V, R, q and c"),
        ({"odds": 0.0}, "odds must be positive and finite"),
        ({"odds": np.ones(R + 1)}, "one or one an age"),
        ({"odds": np.array([1.0, 0.0, 1.0])}, "odds must be positive and finite"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(change, match):
    with pytest.raises(ValueError, match=match):
        dc.replace(DUT, **change)
