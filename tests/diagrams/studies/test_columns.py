"""Laws of a table's columns."""

import math

import pytest

from diagrams.studies.columns import fixed, percent, spread


def test_a_missing_value_is_a_dash():
    assert fixed("x", 2)({"x": 0.126}) == "0.13"
    assert percent("x", 1)({"x": 0.126}) == "12.6 %"
    assert (fixed("x", 2)({}), percent("x")({})) == ("–", "–")


@pytest.mark.parametrize(
    "value, width, text",
    [
        (0.0123, 0.001, "1.23 ± 0.10"),
        (0.0123, math.nan, "1.23"),  # a single flight has no interval
        (math.inf, math.nan, "lost"),
        (-math.inf, 0.1, "lost"),
    ],
)
def test_a_spread_stands_behind_its_value_in_cm(value, width, text):
    assert spread("x")({"x": value, "x_ci95": width}) == text
