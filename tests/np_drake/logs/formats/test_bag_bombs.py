"""No ROS bag of 10 MB takes more than 1 GB of memory, whatever it unpacks to or claims."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Stream
from np_drake.logs.formats.ros import ODOMETRY, ROS

pytest.importorskip("rosbags")
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
HARMLESS = {
    "bag_index",
    "mcap_columns",
    "mcap_qos",
    "sqlite_metadata",
    "sqlite_qos",
}  # read for what they are
UNPACKS = "must hold chunks and messages that unpack to at most"
WORDS = {
    "mcap_rows": "million numbers for its size",
    "mcap_lengths": "must hold messages with numbers",
    "mcap_definitions": "must name and define its topics",
    "mcap_channels": "numbers by name",
    "sqlite_file": "must unpack to at most",
    "sqlite_messages_view": "messages must be tables",
    "sqlite_topics_view": "topics must be tables",
}


def bombs():
    """Return the module `bag_bombs.py` beside this file."""
    spec = importlib.util.spec_from_file_location(
        "bag_bombs", Path(__file__).with_name("bag_bombs.py")
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


BOMBS = bombs()


@pytest.fixture(scope="module")
def read(fresh_reader):
    return fresh_reader(READ, SECONDS)


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="needs the peak memory of a process"
)
@pytest.mark.parametrize("name", BOMBS.BOMBS)
def test_a_bag_that_asks_for_gigabytes_is_read_or_refused_in_little_memory(tmp_path, name, read):
    path = BOMBS.BOMBS[name](tmp_path)
    assert all(file.stat().st_size < 10**7 for file in tmp_path.rglob("*.*"))
    (said,), peak = read(path)
    if name in HARMLESS:
        assert said == "read"
    else:
        words = "of the size that it claims" if "claims" in name else WORDS.get(name, UNPACKS)
        assert words in said
        assert said.startswith(str(path))
    assert peak < MOST


@pytest.mark.parametrize("kind", ["bz2", "lz4"])
def test_a_chunk_that_claims_less_than_it_holds_is_damage_after_good_ones(
    tmp_path, kind, ros_writer
):
    """The messages before it are kept, and a note says so."""
    path = tmp_path / "a.bag"
    t = np.arange(4000) * 0.01
    columns = {c: np.zeros(len(t)) for c in ODOMETRY}
    ros_writer.write(path, {"/odom": Stream(t, columns)}, compression=kind.upper())
    content = path.read_bytes()
    at = content.rindex(b"size=") + 5
    path.write_bytes(content[:at] + BOMBS.number(100) + content[at + 4 :])
    recording = ROS.read(path, {"/odom": ["pose.pose.position.x"]}, lambda share: None)
    assert 0 < len(recording.streams["/odom"]) < len(t)
    assert any("of the size that it claims" in note for note in recording.notes)


def test_a_bag_within_its_budget_is_read_though_it_packs_well(tmp_path, ros_writer):
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
        BOMBS.record2(5, BOMBS.struct.pack("<HIQQ", 1, 0, time, time) + BOMBS.message2(data))
        for time, data in rows
    )
    path = BOMBS.mcap_content(tmp_path / "a.mcap", content)
    dut = ROS.read(path, {"/a": ["data[0]"]}, lambda share: None).streams["/a"]
    np.testing.assert_array_equal(dut.columns["data[0]"], list(b"adbc"))
    assert (np.diff(dut.t) >= 0).all()


def test_an_encrypted_bag_is_refused(tmp_path):
    path = BOMBS.bag1(tmp_path / "a.bag", "none", pieces=0)
    content = path.read_bytes()
    opening = content.index(b"chunk_count=")
    path.write_bytes(content[:opening] + b"encryptor=ab" + content[opening + 12 :])
    with pytest.raises(LogError, match="encrypted"):
        ROS.contents(path)
