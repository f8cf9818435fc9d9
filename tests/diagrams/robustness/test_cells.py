"""Laws of means, intervals and comparisons over seeds."""

import math

import numpy as np
import pytest

from diagrams.robustness.axes import BASE
from diagrams.robustness.cells import Cells, compare, summary


def records(errors, row="np", setting=BASE, growth=1.0):
    """Return a record a seed; None is a lost flight."""
    made = []
    for seed, error in enumerate(errors, start=1):
        result = dict.fromkeys(("E_xy", "E_z"), error)
        result |= {
            "growth": growth,
            "swing_growth": growth,
            "lost_at": None if error is not None else 3.0,
        }
        result |= {"solve_failures": 0, "at_limit": 0.0, "thrust": 0.5}
        case = {"row": row, "model": "", **setting, "seed": seed}
        made.append({"case": case, "result": result, "seconds": 1.0})
    return made


def test_the_interval_of_three_seeds_is_students():
    dut = summary(records([1.0, 2.0, 3.0]))
    assert dut["E_xy"] == pytest.approx(2.0)
    assert dut["E_xy_ci95"] == pytest.approx(
        4.302653 / math.sqrt(3), rel=1e-6
    )  # t(0.975, 2) s / sqrt(n), s = 1
    assert dut["spread"] == pytest.approx(0.5)


def test_one_seed_has_a_mean_and_no_interval():
    dut = summary(records([1.0]))
    assert dut["E_xy"] == 1.0
    assert math.isnan(dut["E_xy_ci95"])


def test_a_lost_flight_leaves_neither_mean_nor_interval():
    dut = summary(records([1.0, None, 3.0]))
    assert (dut["flights"], dut["lost"]) == (3, 1)
    assert (dut["E_xy"], dut["E_xy_ci95"], dut["growth"]) == (None, None, None)


def test_pairs_show_a_difference_that_the_spread_of_seeds_hides():
    mine, theirs = records([1.0, 2.0, 3.0]), records([1.1, 2.11, 3.12])
    assert compare(mine, theirs) == -1
    assert compare(theirs, mine) == 1
    assert compare(mine, theirs[::-1]) == -1  # pairs are made by seed, not by place
    assert compare(mine, records([1.1, 1.9, 3.1])) == 0


def test_equal_flights_and_single_seeds_show_nothing():
    assert compare(records([1.0, 2.0]), records([1.0, 2.0])) == 0
    assert compare(records([1.0]), records([2.0])) == 0


def test_fewer_lost_flights_are_better():
    assert compare(records([9.0, 9.0]), records([1.0, None])) == -1
    assert compare(records([None, None]), records([1.0, None])) == 1
    assert compare(records([1.0, None]), records([None, 1.0])) == 0


def test_cells_are_found_by_row_and_setting():
    other = BASE | {"delay": 0.03}
    dut = Cells([*records([1.0], setting=other), *records([2.0]), *records([3.0], row="hold")])
    assert [r["result"]["E_xy"] for r in dut.flights("np", other)] == [1.0]
    assert [r["result"]["E_xy"] for r in dut.flights("np", dict(reversed(BASE.items())))] == [2.0]
    assert dut.flights("hold", other) == []
    assert np.all(np.array(dut.rows) == ["np", "hold"])
