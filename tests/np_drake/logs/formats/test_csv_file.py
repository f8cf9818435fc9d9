"""Laws of the CSV reader of our own logs that a table shows: ragged rows, blank lines, and bounded
lines.
"""

import tracemalloc

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.formats.text_table import MAX_LINE, read_csv


def test_rows_of_a_wrong_length_and_blank_lines_within_are_ragged(tmp_path):
    (tmp_path / "made.csv").write_text("t,x\n0,1\n\n2\n3,4,5\n4,hello\n5,\n\n \n")
    dut = read_csv(tmp_path / "made.csv")
    assert dut.ragged == [1, 2, 3]
    assert dut.unreadable == [(4, "x", "hello")]
    np.testing.assert_array_equal(dut.columns["t"], [0, np.nan, np.nan, np.nan, 4, 5])
    np.testing.assert_array_equal(dut.columns["x"], [1, np.nan, np.nan, np.nan, np.nan, np.nan])
    dut.columns["x"][0] = 7.0  # the columns can be written to


def test_a_line_without_an_end_is_refused_before_it_fills_the_memory(tmp_path):
    (tmp_path / "made.csv").write_text("t,x\n" + "1" * 20_000_000)
    tracemalloc.start()
    with pytest.raises(LogError, match="line 2: must have at most 1000000 characters"):
        read_csv(tmp_path / "made.csv")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5 * MAX_LINE  # [bytes]
