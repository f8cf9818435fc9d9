import numpy as np
import pytest

from np_drake.skill.skill_interval import mean_interval, ratio_interval


def errors(ratio: float, n: int = 4000, memory: int = 1, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Squared errors (n, 1, 2) of a model and of its reference, alike over `memory` samples."""
    generator = np.random.default_rng(seed)
    base, own = (
        np.repeat(generator.standard_normal((n // memory, 1, 2)) ** 2, memory, axis=0) for _ in range(2)
    )
    return ratio**2 * own, base


def test_the_interval_holds_the_ratio_in_about_nineteen_of_twenty_flights():
    hits = []
    for seed in range(60):
        low, high = ratio_interval(*errors(0.6, seed=seed), [1])[0, 0]
        hits.append(low < 0.6 < high)
    assert np.mean(hits) > 0.85


def test_alike_neighbours_are_worth_less():
    def width(memory):
        return float(np.ptp(ratio_interval(*errors(0.6, memory=memory), [1])[0, 0]))

    assert width(100) > 3 * width(1)


def test_a_model_that_is_the_reference_has_ratio_one_for_certain():
    _, base = errors(1.0)
    np.testing.assert_allclose(ratio_interval(base, base, [1]), 1.0)


def test_of_too_short_a_flight_nothing_is_said():
    square, base = errors(0.6, n=40)
    assert np.isnan(ratio_interval(square, base, [10])).all()


def test_over_flights_each_flight_is_one_observation():
    mean, low, high = mean_interval(np.array([0.4, 0.6, 0.5]))
    assert mean == pytest.approx(0.5)
    assert (high - low) / 2 == pytest.approx(
        4.303 * 0.1 / np.sqrt(3), rel=1e-3
    )  # Student's t, 2 degrees of freedom
    assert np.isnan(mean_interval(np.array([0.4]))[1])
