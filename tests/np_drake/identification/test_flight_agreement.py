"""Laws of which flights stand out, and of what a quantity moves with."""

import numpy as np

from np_drake.identification.estimation import Agreement
from np_drake.identification.flight_agreement import outlying


def told(values, sd=0.1) -> Agreement:
    """Return what flights tell, each with the same deviation."""
    values = np.array(values, float)
    return Agreement(values, np.full(len(values), sd), 0.0, 0.5)


def test_flights_that_agree_leave_none_apart():
    assert outlying(told([0.0, 0.1, -0.1, 0.05])) == []


def test_the_one_flight_that_differs_stands_out():
    assert outlying(told([0.0, 0.1, 3.0, -0.1, 0.05])) == [2]


def test_a_flight_that_tells_nothing_is_passed_over():
    assert outlying(told([0.0, np.nan, 0.1, 3.0, -0.1])) == [3]
