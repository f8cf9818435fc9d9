"""ROS bags: round trips in all storages, clocks, types, maps, damage."""

import contextlib
import sqlite3
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Stream, find_column
from np_drake.logs.formats.known_formats import format_of
from np_drake.logs.formats.ros import IMU, ODOMETRY, ROS, STAMPED_POSE, WRENCH

pytest.importorskip("rosbags")

from tests.np_drake.logs.formats import made_files, ros_writer
from tests.np_drake.logs.formats.made_files import assert_holds

T = np.arange(60) * 0.01
FILES = (
    ("flight", ""),
    ("flight.mcap", ""),
    ("flight.db3", ""),
    ("flight.bag", "BZ2"),
    ("a.bag", "LZ4"),
)


def stream(columns: tuple[str, ...], t: np.ndarray = T, seed: int = 0) -> Stream:
    return made_files.noise(columns, t, seed)


def flight() -> dict[str, Stream]:
    return {
        "/odom": stream(ODOMETRY),
        "/imu": stream(IMU, T[::2] + 0.001),
        "/wrench": stream(WRENCH, seed=1),
        "/rpm": stream(tuple(f"data[{i}]" for i in range(4)), T + 0.002, seed=2),
    }


read = partial(made_files.read, ROS)


@pytest.mark.parametrize("name, compression", FILES)
def test_what_is_written_is_read(tmp_path: Path, name: str, compression: str):
    path = tmp_path / name
    ros_writer.write(path, flight(), compression=compression)
    assert format_of(path) is ROS
    recording = read(path)
    assert_holds(recording, flight())
    assert recording.facts["ros"] == ("1" if name.endswith(".bag") else "2")
    assert recording.facts["type of /odom"] == "nav_msgs/msg/Odometry"


@pytest.mark.parametrize(
    ("storage", "compression"), [("sqlite3", ""), ("sqlite3", "message"), ("mcap", "storage")]
)
def test_folders_are_read_in_all_storages(tmp_path: Path, storage: str, compression: str):
    ros_writer.write(tmp_path / "bag", flight(), storage=storage, compression=compression)
    assert_holds(read(tmp_path / "bag"), flight())


def test_times_are_stamps_and_those_of_receipt_where_there_are_none(tmp_path: Path):
    ros_writer.write(tmp_path / "bag", flight(), delay=0.003)
    recording = read(tmp_path / "bag")
    np.testing.assert_allclose(recording.streams["/odom"].t, T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(recording.streams["/rpm"].t, T + 0.005, rtol=0, atol=1e-9)
    assert any("/odom: times are the stamps" in note for note in recording.notes)
    assert any("/rpm: times are those of receipt" in note for note in recording.notes)


def test_stamps_of_another_clock_give_way_to_receipt(tmp_path: Path):
    ros_writer.write(tmp_path / "bag", flight(), delay=100.0)
    recording = read(tmp_path / "bag")
    np.testing.assert_allclose(recording.streams["/imu"].t, flight()["/imu"].t, rtol=0, atol=1e-9)
    np.testing.assert_allclose(recording.streams["/rpm"].t, flight()["/rpm"].t, rtol=0, atol=1e-9)
    assert any(
        "/imu: times are those of receipt, for the clocks" in note for note in recording.notes
    )


def test_a_topic_of_an_unknown_type_is_left_out_with_a_note(tmp_path: Path, monkeypatch):
    path = tmp_path / "flight.mcap"
    ros_writer.write(path, flight())
    content = path.read_bytes().replace(
        b"std_msgs/msg/Float64MultiArray", b"some_msgs/msg/Float64MultiAr10"
    )
    content = content.replace(b"MSG: std_msgs/MultiArrayLayout", b"MSG: std_msgs/MultiArrayLayou1")
    content = content.replace(b"MultiArrayLayout layout", b"MultiArrayLayo_t layout")
    path.write_bytes(content)
    expected = flight()
    del expected["/rpm"]
    recording = read(path)
    assert_holds(recording, expected)
    assert any("/rpm is left out: the type" in note for note in recording.notes)


def test_without_the_library_the_remedy_is_named(tmp_path: Path, monkeypatch):
    ros_writer.write(tmp_path / "flight.bag", flight())
    monkeypatch.setitem(__import__("sys").modules, "rosbags", None)
    with pytest.raises(LogError, match=r"pip install 'np_drake\[ros\]'"):
        ROS.contents(tmp_path / "flight.bag")


def test_odometry_makes_the_map():
    contents = {name: tuple(s.columns) for name, s in flight().items()}
    dut = ROS.default_map(contents)
    assert dut is not None
    dut.check()
    assert (dut.world, dut.body, dut.command) == ("enu", "flu", "held_after")
    assert dut.position.columns == [f"/odom/pose.pose.position.{c}" for c in "xyz"]
    assert dut.attitude.columns == [f"/odom/pose.pose.orientation.{c}" for c in "xyzw"]
    assert dut.attitude.order == "xyzw"
    assert dut.velocity.columns == [f"/odom/twist.twist.linear.{c}" for c in "xyz"]
    assert dut.velocity.axes == "body"
    assert dut.rates.columns == [f"/odom/twist.twist.angular.{c}" for c in "xyz"]
    assert dut.acceleration.columns == [f"/imu/linear_acceleration.{c}" for c in "xyz"]
    assert dut.acceleration.kind == "specific_force"
    assert dut.thrust.columns == ["/wrench/wrench.force.z"]
    assert dut.torque.columns == [f"/wrench/wrench.torque.{c}" for c in "xyz"]
    for name in dut.names():
        find_column(contents, name)


def test_a_pose_and_an_imu_make_a_map_without_velocity():
    dut = ROS.default_map({"/vrpn/pose": STAMPED_POSE, "/imu": IMU})
    assert dut is not None
    dut.check()
    assert dut.position.columns == [f"/vrpn/pose/pose.position.{c}" for c in "xyz"]
    assert not dut.velocity
    assert dut.rates.columns == [f"/imu/angular_velocity.{c}" for c in "xyz"]
    assert dut.command == "unknown"


def test_the_names_of_mavros_are_known_among_several():
    contents = {
        "/mavros/local_position/odom": ODOMETRY,
        "/mavros/global_position/local": ODOMETRY,
        "/mavros/imu/data": IMU,
        "/mavros/imu/data_raw": IMU,
        "/mavros/setpoint_raw/target_attitude": ("thrust", "body_rate.x"),
        "/mavros/battery": ("voltage",),
    }
    dut = ROS.default_map(contents)
    assert dut is not None
    dut.check()
    assert dut.position.columns[0] == "/mavros/local_position/odom/pose.pose.position.x"
    assert dut.acceleration.columns[0] == "/mavros/imu/data/linear_acceleration.x"
    assert dut.throttle.columns == ["/mavros/setpoint_raw/target_attitude/thrust"]
    assert dut.voltage.columns == ["/mavros/battery/voltage"]


@pytest.mark.parametrize("name", ["a.mcap", "a.bag"])
def test_of_a_bag_that_is_cut_the_remedy_is_named(tmp_path: Path, name: str):
    path = tmp_path / name
    ros_writer.write(path, flight())
    path.write_bytes(path.read_bytes()[:-3000])
    with pytest.raises(LogError, match=r"must be a whole ROS bag; .*ros2 bag reindex") as found:
        ROS.contents(path)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("beside", ["-wal", "-journal"])
def test_what_sqlite_has_in_an_open_journal_is_read(tmp_path: Path, beside: str):
    path = tmp_path / "a.db3"
    ros_writer.write(path, flight())
    with contextlib.closing(sqlite3.connect(path)) as recorder:
        recorder.execute(f"PRAGMA journal_mode = {'WAL' if beside == '-wal' else 'DELETE'}")
        recorder.execute("PRAGMA cache_size = 1")  # pages spill into the file
        recorder.execute("CREATE TABLE later AS SELECT * FROM messages")
        recorder.execute("DELETE FROM messages")
        if beside == "-wal":
            recorder.commit()
            recorder.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            recorder.execute("INSERT INTO messages SELECT * FROM later")
            recorder.commit()
        before = path.read_bytes()
        assert (tmp_path / f"a.db3{beside}").stat().st_size
        recording = read(path)
        assert path.read_bytes() == before
    assert_holds(recording, flight())
    assert any(f"left in a.db3{beside} is read" in note for note in recording.notes)


def test_a_damaged_chunk_ends_reading_with_a_note(tmp_path: Path):
    t = np.arange(6000) * 0.01
    ros_writer.write(tmp_path / "bag", {"/odom": stream(ODOMETRY, t)}, compression="storage")
    path = tmp_path / "bag" / "bag.mcap"
    content = bytearray(path.read_bytes())
    at = content.rindex(b"\x28\xb5\x2f\xfd")  # zstd
    content[at : at + 4] = bytes(4)
    path.write_bytes(content)
    recording = read(tmp_path / "bag")
    assert 1000 < len(recording.streams["/odom"]) < len(t)
    assert any("reading ended before the end of the bag" in note for note in recording.notes)
