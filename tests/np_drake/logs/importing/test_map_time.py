"""Laws of the time column that a map names."""

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Recording, Stream
from np_drake.logs.importing.log_map import LogMap, Source, load_map
from np_drake.logs.importing.map_time import with_map_time

RECORDING = Recording(
    "made.log",
    "made",
    {"a": Stream(np.arange(3.0), {"clock": np.array([0.0, 2.0, 4.0])}), "b": Stream(np.arange(2.0), {})},
)


@pytest.mark.parametrize("unit, factor", [("", 1.0), ("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)])
def test_one_stream_takes_its_times_from_the_map(unit, factor):
    dut = with_map_time(RECORDING, LogMap(time=Source(["a/clock"], unit=unit)))
    np.testing.assert_array_equal(dut.streams["a"].t, np.array([0, 2, 4]) * factor)
    assert dut.streams["b"] is RECORDING.streams["b"]


def test_without_a_name_in_the_map_the_format_s_times_stay():
    assert with_map_time(RECORDING, LogMap()).streams == RECORDING.streams


def test_a_time_that_is_not_there_is_named():
    with pytest.raises(LogError, match=r"made\.log, column clok: .*did you mean .*clock"):
        with_map_time(RECORDING, LogMap(time=Source(["clok"])))


def test_the_time_is_a_name_but_no_quantity(tmp_path):
    (tmp_path / "map.yaml").write_text("time: {columns: [clock], unit: ms}\nposition: {columns: [x, y, z]}\n")
    dut = load_map(tmp_path / "map.yaml")
    assert dut.names() == ["clock", "x", "y", "z"]
    assert [name for name, _ in dut.sources()] == ["position"]


@pytest.mark.parametrize(
    "source, message",
    [
        (Source(["a", "b"]), "time must name 1 columns; got 2"),
        (Source(["a"], unit="min"), "time.unit must be one of 's', 'ms', 'us', 'ns'; got 'min'"),
    ],
)
def test_a_time_that_cannot_be_is_refused(source, message):
    with pytest.raises(ValueError, match=message):
        LogMap(time=source).check()
