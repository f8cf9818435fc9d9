"""Laws of which flights stand out, and of what a quantity moves with."""

import numpy as np

from np_drake.identification.estimation import Agreement
from np_drake.identification.flight_agreement import moves_with, outlying


def told(values, sd=0.1) -> Agreement:
    """Return what flights tell, each with the same deviation."""
    values = np.array(values, float)
    return Agreement(values, np.full(len(values), sd), 0.0, 0.5)


def test_flights_that_agree_leave_none_apart():
    assert outlying(told([0.0, 0.1, -0.1, 0.05])) == []


def test_the_one_flight_that_differs_stands_out():
    assert outlying(told([0.0, 0.1, 3.0, -0.1, 0.05])) == [2]


def test_of_two_flights_none_stands_out():
    assert outlying(told([0.0, 3.0])) == []


def test_a_flight_that_tells_nothing_is_passed_over():
    assert outlying(told([0.0, np.nan, 0.1, 3.0, -0.1])) == [3]


def test_a_value_that_falls_with_the_voltage_moves_with_it():
    volts = np.array([4.1, 3.6, 4.0, 3.5, 3.8])
    values = 3.0 * volts + [0.02, -0.03, 0.0, 0.04, -0.02]
    along = {"the order of the flights": np.arange(5.0), "the voltage": volts}
    assert moves_with(told(values), along) == "the voltage"


def test_scatter_moves_with_nothing():
    values = np.random.default_rng(3).normal(size=6)
    assert moves_with(told(values), {"the order of the flights": np.arange(6.0)}) == ""


def test_three_flights_are_too_few_for_a_trend():
    assert moves_with(told([0.0, 1.0, 2.0]), {"the order of the flights": np.arange(3.0)}) == ""
