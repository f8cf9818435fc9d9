"""No ROS bag of 10 MB takes more than 1 GB of memory, whatever it unpacks to or claims."""

import struct
from pathlib import Path

import numpy as np
import pytest

from np_drake.logs.formats.format import Stream
from np_drake.logs.formats.ros import ODOMETRY, ROS
from tests.np_drake.logs.formats import bag_bombs as bombs
from tests.np_drake.logs.formats import ros_writer

MOST = 500  # [MB] of a reader without Drake; the command line has 1 GB for both
SECONDS = 30  # of processor time
READ = """
from pathlib import Path
from np_drake.logs.errors import LogError
from np_drake.logs.formats.ros import ROS
def read(path):
    try:
        contents = ROS.contents(Path(path))
        ROS.read(Path(path), {name: list(columns) for name, columns in contents.items()}, lambda share: None)
        print("read")
    except LogError as error:
        print(error)
"""  # noqa: E501
UNPACKS = "must hold chunks and messages that unpack to at most"
WORDS = {  # that the refusal has
    "bag_index": "its index names more messages than it holds",
    "mcap_rows": "million numbers for its size",
    "mcap_lengths": "must hold messages with numbers",
    "mcap_definitions": "must name and define its topics",
    "sqlite_file": "must be no compressed file",
    "sqlite_generated": "too big",
}


@pytest.fixture(scope="module")
def read(fresh_reader):
    return fresh_reader(READ, SECONDS)


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="needs the peak memory of a process"
)
@pytest.mark.parametrize("name", bombs.BOMBS)
def test_a_bag_that_asks_for_gigabytes_is_refused_in_little_memory(tmp_path, name, read):
    path = bombs.BOMBS[name](tmp_path)
    assert all(file.stat().st_size < 10**7 for file in tmp_path.rglob("*.*"))
    (said,), peak = read(path)
    assert WORDS.get(name, UNPACKS) in said
    assert said.startswith(str(path))
    assert peak < MOST


def test_a_bag_within_its_budget_is_read_though_it_packs_well(tmp_path):
    """A vehicle that stands still packs 50 to 1."""
    t = np.arange(6000) * 0.01
    path = tmp_path / "bag"
    ros_writer.write(
        path, {"/odom": Stream(t, {c: np.zeros(len(t)) for c in ODOMETRY})}, compression="storage"
    )
    recording = ROS.read(path, {"/odom": list(ODOMETRY)}, lambda share: None)
    assert len(recording.streams["/odom"]) == len(t)


def test_messages_come_in_the_order_of_their_receipt(tmp_path):
    rows = [(3, b"c"), (1, b"a"), (2, b"b"), (1, b"d")]
    content = b"".join(
        bombs.record2(5, struct.pack("<HIQQ", 1, 0, bombs.TIME + time, 0) + bombs.message2(data))
        for time, data in rows
    )
    path = bombs.mcap_content(tmp_path / "a.mcap", content)
    dut = ROS.read(path, {"/a": ["data[0]"]}, lambda share: None).streams["/a"]
    np.testing.assert_array_equal(dut.columns["data[0]"], list(b"adbc"))
    assert (np.diff(dut.t) >= 0).all()
