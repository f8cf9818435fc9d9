"""Laws of gaps: short ones are bridged and add nothing, long ones split a flight into parts."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.logs.columns import LONGEST_GAP as LONGEST
from np_drake.logs.columns import (
    Table,
    bridge_gaps,
    present_fields,
    said_of_bridged,
    split_at_gaps,
    without_long_gaps,
)
from np_drake.logs.errors import LogError
from np_drake.logs.formats.csv_file import write_csv
from np_drake.logs.opening import open_flights


def circling(t: np.ndarray) -> dict[str, np.ndarray]:
    """A metre of circle, a turn in 6 s, with a hovering command."""
    o = 0 * t
    names = {
        "px": np.cos(t),
        "py": np.sin(t),
        "pz": 1 + o,
        "vx": -np.sin(t),
        "vy": np.cos(t),
        "vz": o,
    }
    q = {"qw": 1 + o, "qx": o, "qy": o, "qz": o, "wx": o, "wy": o, "wz": o}
    return {"t": t, **names, **q, "thrust": 20.0 + np.arange(len(t)) % 2, "tx": o, "ty": o, "tz": o}


def without(t: np.ndarray, start: int, count: int) -> np.ndarray:
    return np.delete(t, slice(start, start + count))


T = 0.01 * np.arange(600)


def test_three_lost_rows_are_bridged_marked_and_said_once(tmp_path):
    write_csv(tmp_path / "a.csv", circling(without(T, 200, 3)))
    dut = open_flights(tmp_path / "a.csv")[0][0]
    np.testing.assert_allclose(dut.t, T, atol=1e-12)
    np.testing.assert_array_equal(np.flatnonzero(dut.bridged), [200, 201, 202])
    np.testing.assert_allclose(dut.p[200:203, 0], np.cos(T[200:203]), atol=2e-4)
    assert dut.notes == []
    whole = dc.replace(dut, bridged=None)
    assert said_of_bridged([whole]) == []
    (line,) = said_of_bridged([dut, whole, dut])
    assert line.startswith(
        "6 rows (0.3\u00a0%) in gaps of up to 0.1 s of 2 of 3 flights were filled in; they "
        "do not count"
    )


def test_a_long_gap_splits_the_flight_into_parts_of_one_log(tmp_path):
    write_csv(tmp_path / "a.csv", circling(without(T, 200, 60)))
    first, second = open_flights(tmp_path / "a.csv")[0]
    assert (first.name, second.name) == ("a part 1", "a part 2")
    assert (len(first), len(second)) == (200, 340)
    assert "2 parts" in first.notes[0]


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.integers(30, 570), st.integers(1, 40)), max_size=5))
def test_every_row_is_in_one_part_and_no_part_has_a_long_gap(cuts):
    keep = np.ones(len(T), bool)
    for start, count in cuts:
        keep[start : start + count] = False
    table = Table("made", circling(T[keep]))
    parts, _ = split_at_gaps(table)
    times = np.concatenate([part.columns["t"] for part in parts])
    assert set(times) <= set(T[keep])
    for part in parts:
        assert np.diff(part.columns["t"]).max() <= LONGEST + 1e-9
        whole, bridged = bridge_gaps(part, present_fields(part))
        assert np.diff(whole.columns["t"]).max() <= 2.5 * 0.01  # one lost row is no gap
        np.testing.assert_array_equal(whole.columns["t"][~bridged], part.columns["t"])


def test_a_long_gap_is_named_where_a_log_must_be_whole():
    table = Table("made", circling(without(T, 200, 60)))
    with pytest.raises(
        LogError, match=r"column t, row 201 .*no gap longer than 0\.1 s.*lasts 0\.61 s"
    ):
        without_long_gaps(table)
