"""Laws of a table's columns."""

import math

import pytest

from diagrams.studies.columns import fixed, grouped, percent, spread, tabulate


def test_a_row_has_the_keys_and_functions_of_its_columns():
    columns = (("n", "count"), ("twice", lambda line: 2 * line["count"]), ("n", "count"))
    assert tabulate("title", [{"count": 2}], columns) == ("title", ["n", "twice", "n"], [(2, 4, 2)])


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


def test_a_spread_has_its_own_unit_suffix_and_word():
    cell = spread("x", 1, factor=1, by="sd", lost="never")
    assert cell({"x": 2.0, "x_sd": 0.5}) == "2.0 ± 0.5"
    assert cell({"x": math.inf, "x_sd": 0.5}) == "never"


def test_a_group_begins_with_a_row_of_its_name():
    _, header, rows = grouped("title", ["", "a", "b"], {"one": [("x", 1, 2)], "two": [("y", 3, 4)]})
    assert rows == [("one", "", ""), ("x", 1, 2), ("two", "", ""), ("y", 3, 4)]
    assert all(len(row) == len(header) for row in rows)
