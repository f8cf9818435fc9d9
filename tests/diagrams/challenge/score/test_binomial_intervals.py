import math

import pytest

from diagrams.challenge.score.binomial_intervals import (
    binomial_interval,
    mean,
    median,
    precision_and_recall,
)


def test_the_interval_of_no_success_in_n_is_the_closed_form():
    found = binomial_interval([False] * 10)
    assert found["rate"] == 0.0
    assert found["ci95"] == [
        0.0,
        pytest.approx(1 - 0.025 ** (1 / 10), rel=1e-12),
    ]  # tail (1 - p)^n = 0.025


def test_the_interval_turns_with_success_and_failure():
    some, others = (
        binomial_interval([True] * 3 + [False] * 7),
        binomial_interval([False] * 3 + [True] * 7),
    )
    assert some["count"] == 3
    assert some["ci95"] == pytest.approx([1 - others["ci95"][1], 1 - others["ci95"][0]], rel=1e-12)


def test_the_interval_is_exact_at_its_bounds():
    low, high = binomial_interval([True] * 3 + [False] * 7)["ci95"]
    tail = sum(math.comb(10, k) * low**k * (1 - low) ** (10 - k) for k in range(3, 11))
    other = sum(math.comb(10, k) * high**k * (1 - high) ** (10 - k) for k in range(4))
    assert [tail, other] == pytest.approx([0.025, 0.025], rel=1e-12)


def test_of_nothing_there_is_no_rate():
    assert binomial_interval([]) == {"count": 0, "n": 0, "rate": None, "ci95": [0.0, 1.0]}
    assert precision_and_recall([])["f1"] is None
    assert median([]) is None
    assert mean([None, float("nan")]) is None


def test_names_are_pooled_over_cases():
    found = precision_and_recall([(2, 0, 0), (1, 2, 1)])
    assert found["precision"] == pytest.approx(3 / 5)
    assert found["recall"] == pytest.approx(3 / 4)
    assert found["f1"] == pytest.approx(6 / 9)


def test_what_is_not_finite_does_not_count():
    assert median([1.0, float("nan"), 3.0, None]) == 2.0
    assert mean([1.0, float("inf"), 4.0]) == 2.5
