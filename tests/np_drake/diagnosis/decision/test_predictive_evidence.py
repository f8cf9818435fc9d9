"""Laws of the log scores of blocks."""

import numpy as np
import pytest

from np_drake.diagnosis.decision.predictive_evidence import (
    DEGREES,
    Blocks,
    PredictiveGain,
    predictive_evidence,
)
from np_drake.effects.linear_drag import LinearDrag


def made(X: np.ndarray, y: np.ndarray, size: int, shared: int) -> Blocks:
    W = np.column_stack([X, y])
    parts = [W[start : start + size] for start in range(0, len(y), size)]
    return Blocks([P.T @ P for P in parts], [size] * len(parts), np.arange(X.shape[1]), shared)


@pytest.fixture
def data():
    rng = np.random.default_rng(1)
    X = rng.normal(size=(60, 3))
    return X, X @ [0.5, -1.0, 0.3] + rng.normal(size=60)


def gaussian(X, y, before: int, upto: int) -> tuple[float, float]:
    """Return squared misfit and log determinant of rows before..upto predicted from those
    before.
    """
    A = X[:before].T @ X[:before] + np.eye(X.shape[1])
    mean, covariance = np.linalg.solve(A, X[:before].T @ y[:before]), np.linalg.inv(A)
    S = np.eye(upto - before) + X[before:upto] @ covariance @ X[before:upto].T
    r = y[before:upto] - X[before:upto] @ mean
    return float(r @ np.linalg.solve(S, r)), float(np.linalg.slogdet(S)[1])


def test_a_score_is_that_of_the_prediction_from_all_before(data):
    X, y = data
    found = made(X, y, 20, 3).scores([])
    for k, score in enumerate(found):
        square, logdet = gaussian(X, y, 20 * k, 20 * k + 20)
        expected = -0.5 * logdet - 0.5 * (DEGREES + 20) * np.log1p(square / DEGREES)
        assert score == pytest.approx(expected, abs=1e-9)


def test_other_flights_are_known_before(data):
    X, y = data
    first, second = made(X[:40], y[:40], 20, 3), made(X[40:], y[40:], 20, 3)
    (found,) = second.scores([first.of_others()])
    assert found == pytest.approx(made(X, y, 20, 3).scores([])[2], abs=1e-9)


def test_what_is_of_another_flight_alone_tells_nothing_of_this_one(data):
    X, y = data
    dut = made(X, y, 20, 2)  # the third column is its own
    told = dut.of_others()
    A = X.T @ X + np.diag([0.0, 0.0, 1.0])
    # information of the first two, the third integrated out
    expected = np.linalg.inv(np.linalg.inv(A)[:2, :2])
    np.testing.assert_allclose(told[:2, :2], expected, atol=1e-9)


def test_a_block_that_no_model_explains_counts_little(data):
    X, y = data
    spoilt = y.copy()
    spoilt[20:40] += 50.0 * np.random.default_rng(2).normal(size=20)
    gains = []
    for target in (y, spoilt):
        dut = made(X, target, 20, 3)
        gains.append(dut.scores([])[1] - dut.without({1, 2}).scores([])[1])
    assert abs(gains[1]) < abs(gains[0])


DRAG = LinearDrag(0.3, 0.3, 0.3)


def gaining(total, gains, held_out=()):
    gains = np.array(gains, float)
    return PredictiveGain(total, gains, ("a",) * len(gains), np.array(held_out, float))


def test_a_steady_gain_is_sure_and_none_is_not():
    assert gaining(100.0, [10.0] * 10).probability > 0.99
    assert gaining(0.0, [0.0] * 10).probability < 0.5
    assert gaining(-50.0, [-5.0] * 10).probability < 0.01


def test_a_gain_in_one_flight_that_costs_another_is_not_sure():
    gains = np.array([10.0] * 5 + [-8.0] * 5)
    apart = PredictiveGain(60.0, gains, ("a",) * 5 + ("b",) * 5, np.zeros(0))
    assert apart.probability < 0.7 < gaining(60.0, [6.0] * 10).probability


def test_held_out_flights_contradict_by_more_than_chance():
    assert not gaining(50.0, [5.0] * 10, [1.0, -1.5, 0.5]).contradicted
    assert gaining(50.0, [5.0] * 10, [-20.0, -22.0, -18.0]).contradicted
    assert not gaining(50.0, [5.0] * 10).contradicted
    assert gaining(0.0, [0.0] * 10, [20.0, 22.0, 18.0]).confirmed
    assert not gaining(0.0, [0.0] * 10, [1.0, -1.5, 0.5]).confirmed


def test_a_drag_that_acts_predicts_every_flight_and_the_held_out_one(seen, inferred):
    flights = [
        seen(DRAG, name=n, seed=i, noise=1.0, seconds=8.0) for i, n in enumerate("abc", start=1)
    ]
    found = inferred(flights[:2], flights[2:])
    names = [t.effect.identifier for t in found.ranking.best.terms]
    dut = predictive_evidence(found.ranking, found.held_out)[names.index("linear_drag")]
    assert dut.probability > 0.99
    assert min(dut.gains[np.array(dut.flights) == name].sum() for name in "ab") > 0
    assert dut.held_out.sum() > 0
