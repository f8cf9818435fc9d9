"""ROS bags: round trips in all storages, clocks, types, maps, damage."""

import struct
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Recording, Stream, by_stream, find_column
from np_drake.logs.formats.library import format_of
from np_drake.logs.formats.ros import IMU, ODOMETRY, ROS, STAMPED_POSE, WRENCH
from np_drake.logs.formats.ros_message import Decoder, find_fields, missing_types

pytest.importorskip("rosbags")
T = np.arange(60) * 0.01
STORAGES = ("mcap", "sqlite3")
FILES = ("flight", "flight.mcap", "flight.db3", "flight.bag")


def stream(columns: tuple[str, ...], t: np.ndarray = T, seed: int = 0) -> Stream:
    rng = np.random.default_rng(seed)
    return Stream(t, {c: rng.standard_normal(len(t)) for c in columns})


def flight() -> dict[str, Stream]:
    return {
        "/odom": stream(ODOMETRY),
        "/imu": stream(IMU, T[::2] + 0.001),
        "/wrench": stream(WRENCH, seed=1),
        "/rpm": stream(tuple(f"data[{i}]" for i in range(4)), T + 0.002, seed=2),
    }


def read(path: Path, names: list[str] | None = None) -> Recording:
    contents = ROS.contents(path)
    wanted = (
        {s: list(c) for s, c in contents.items()} if names is None else by_stream(contents, names)
    )
    return ROS.read(path, wanted, lambda _: None)


def assert_holds(recording: Recording, streams: dict[str, Stream]) -> None:
    assert set(recording.streams) == set(streams)
    for name, expected in streams.items():
        np.testing.assert_allclose(
            recording.streams[name].t, expected.t, rtol=0, atol=1e-9
        )  # ns of the bag
        for column, values in expected.columns.items():
            np.testing.assert_array_equal(recording.streams[name].columns[column], values)


@pytest.mark.parametrize("name", FILES)
def test_what_is_written_is_read(tmp_path: Path, ros_writer, name: str):
    path = tmp_path / name
    ros_writer.write(path, flight())
    assert format_of(path) is ROS
    recording = read(path)
    assert_holds(recording, flight())
    assert recording.facts["ros"] == ("1" if name.endswith(".bag") else "2")
    assert recording.facts["type of /odom"] == "nav_msgs/msg/Odometry"


@pytest.mark.parametrize(
    ("storage", "compression"),
    [
        ("sqlite3", ""),
        ("sqlite3", "file"),
        ("sqlite3", "message"),
        ("mcap", "storage"),
        ("mcap", "file"),
    ],
)
def test_folders_are_read_in_all_storages(
    tmp_path: Path, ros_writer, storage: str, compression: str
):
    ros_writer.write(tmp_path / "bag", flight(), storage=storage, compression=compression)
    assert_holds(read(tmp_path / "bag"), flight())


def test_only_what_is_wanted_is_read(tmp_path: Path, ros_writer):
    ros_writer.write(tmp_path / "bag", flight())
    recording = read(tmp_path / "bag", ["/odom/pose.pose.position.z", "/rpm/data[3]"])
    assert recording.contents == {"/odom": ("pose.pose.position.z",), "/rpm": ("data[3]",)}
    np.testing.assert_array_equal(
        recording.streams["/odom"].columns["pose.pose.position.z"],
        flight()["/odom"].columns["pose.pose.position.z"],
    )


def test_headers_strings_and_covariances_are_no_columns(tmp_path: Path, ros_writer):
    ros_writer.write(tmp_path / "bag", flight())
    contents = ROS.contents(tmp_path / "bag")
    assert set(contents["/odom"]) == set(ODOMETRY)
    assert not [c for c in contents["/imu"] if "covariance" in c]
    assert set(contents["/rpm"]) == {"layout.data_offset", *(f"data[{i}]" for i in range(4))}


def test_times_are_stamps_and_those_of_receipt_where_there_are_none(tmp_path: Path, ros_writer):
    ros_writer.write(tmp_path / "bag", flight(), delay=0.003)
    recording = read(tmp_path / "bag")
    np.testing.assert_allclose(recording.streams["/odom"].t, T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(recording.streams["/rpm"].t, T + 0.005, rtol=0, atol=1e-9)
    assert any("/odom: times are the stamps" in note for note in recording.notes)
    assert any("/rpm: times are those of receipt" in note for note in recording.notes)


def test_stamps_of_another_clock_give_way_to_receipt(tmp_path: Path, ros_writer):
    ros_writer.write(tmp_path / "bag", flight(), delay=100.0)
    recording = read(tmp_path / "bag")
    np.testing.assert_allclose(recording.streams["/imu"].t, flight()["/imu"].t, rtol=0, atol=1e-9)
    np.testing.assert_allclose(recording.streams["/rpm"].t, flight()["/rpm"].t, rtol=0, atol=1e-9)
    assert any(
        "/imu: times are those of receipt, for the clocks" in note for note in recording.notes
    )


def test_a_topic_whose_stamps_are_zero_takes_receipt(tmp_path: Path, ros_writer):
    ros_writer.write(tmp_path / "bag", flight(), unstamped=("/imu",))
    recording = read(tmp_path / "bag")
    assert_holds(recording, flight())
    assert any("/imu: times are those of receipt, for not all" in note for note in recording.notes)


def test_a_topic_of_an_unknown_type_is_left_out_with_a_note(
    tmp_path: Path, ros_writer, monkeypatch
):
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


def test_without_the_library_the_remedy_is_named(tmp_path: Path, ros_writer, monkeypatch):
    ros_writer.write(tmp_path / "flight.bag", flight())
    monkeypatch.setitem(__import__("sys").modules, "rosbags", None)
    with pytest.raises(LogError, match=r"pip install 'np_drake\[ros\]'"):
        ROS.contents(tmp_path / "flight.bag")


def test_progress_ends_at_one(tmp_path: Path, ros_writer):
    ros_writer.write(tmp_path / "bag", flight())
    shares: list[float] = []
    ROS.read(tmp_path / "bag", {"/odom": [ODOMETRY[0]]}, shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


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


def test_several_odometries_or_none_make_no_map():
    assert ROS.default_map({"/a": ODOMETRY, "/b": ODOMETRY}) is None
    assert ROS.default_map({"/imu": IMU}) is None


BASE, NAME, ARRAY, SEQUENCE = 1, 2, 3, 4
ODD = {
    "a/msg/Odd": (
        [],
        [
            ("flag", (BASE, ("bool", 0))),
            ("text", (BASE, ("string", 0))),
            ("items", (SEQUENCE, ((NAME, "a/msg/Item"), 0))),
            ("small", (ARRAY, ((BASE, ("int16", 0)), 3))),
            ("last", (BASE, ("float64", 0))),
        ],
    ),
    "a/msg/Item": ([], [("id", (BASE, ("uint8", 0))), ("rpm", (BASE, ("int32", 0)))]),
}


def odd(order: str, text: bytes, rpm: tuple[int, ...]) -> bytes:
    """Serialise a message in CDR by hand: every number stands on a multiple of its size after 4
    bytes.
    """
    raw = bytearray()

    def put(kind: str, value: float) -> None:
        raw.extend(bytes(-len(raw) % struct.calcsize(kind)) + struct.pack(order + kind, value))

    put("B", 1)
    put("I", len(text) + 1)
    raw.extend(text + b"\0")
    put("I", len(rpm))
    for i, value in enumerate(rpm):
        put("B", i)
        put("i", value)
    for value in (-1, 2, 3):
        put("h", value)
    put("d", 0.5)
    return bytes([0, order == "<", 0, 0]) + bytes(raw)


@pytest.mark.parametrize("order", ["<", ">"])
def test_fields_are_found_behind_strings_and_sequences_of_any_length(order: str):
    wanted = ["last", "items[1].rpm", "small[0]", "flag"]
    dut = Decoder(ODD, "a/msg/Odd", wanted, ros1=False)
    for text in (b"", b"abc", b"abcdefgh", b"xyz"):
        for rpm in ((7, 8), (9, 10, 11), (7,)):
            second = float(rpm[1]) if len(rpm) > 1 else np.nan
            np.testing.assert_array_equal(dut(odd(order, text, rpm))[2:], [0.5, second, -1.0, 1.0])


def test_messages_of_one_size_and_other_lengths_are_told_apart():
    types = {
        "a/msg/Two": (
            [],
            [
                ("a", (BASE, ("string", 0))),
                ("x", (BASE, ("uint8", 0))),
                ("b", (BASE, ("string", 0))),
            ],
        )
    }
    dut = Decoder(types, "a/msg/Two", ["x"], ros1=True)
    first = struct.pack("<I3sBI1s", 3, b"aaa", 5, 1, b"b")
    second = struct.pack("<I1sBI3s", 1, b"a", 6, 3, b"bbb")
    assert [dut(raw)[2] for raw in (first, second, first)] == [5, 6, 5]


def test_columns_are_those_of_the_library(ros_writer):
    rosbags = pytest.importorskip("rosbags.typesys")
    store = rosbags.get_typestore(rosbags.Stores.ROS2_HUMBLE)
    raw = bytes(
        store.serialize_cdr(
            ros_writer._make(store, "sensor_msgs/msg/BatteryState", {"voltage": 12.5}, "", "abc"),
            "sensor_msgs/msg/BatteryState",
        )
    )
    message = store.deserialize_cdr(raw, "sensor_msgs/msg/BatteryState")
    fields = find_fields(raw, store.fielddefs, "sensor_msgs/msg/BatteryState", ros1=False)
    for path in fields.columns:
        at, code = fields.numbers[path]
        assert struct.unpack_from(f"<{code}", raw, at)[0] == pytest.approx(
            getattr(message, path), nan_ok=True
        )


def test_a_type_that_is_not_defined_is_named():
    types = {"a/msg/A": ([], [("b", (SEQUENCE, ((NAME, "a/msg/B"), 0))), ("a", (NAME, "a/msg/A"))])}
    assert missing_types(types, "a/msg/A") == ["a/msg/B"]


def test_a_cut_mcap_keeps_its_whole_chunks(tmp_path: Path, ros_writer):
    t = np.arange(4000) * 0.01
    ros_writer.write(tmp_path / "whole.mcap", {"/odom": stream(ODOMETRY, t)})
    content = (tmp_path / "whole.mcap").read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(content[: int(0.8 * len(content))])
    recording = read(path)
    dut = recording.streams["/odom"]
    assert 1000 < len(dut) < len(t)
    np.testing.assert_allclose(dut.t, t[: len(dut)], rtol=0, atol=1e-9)
    assert any("cut off" in note for note in recording.notes)


def test_a_damaged_chunk_ends_reading_with_a_note(tmp_path: Path, ros_writer):
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


@pytest.mark.parametrize("compression", ["", "BZ2", "LZ4"])
def test_a_cut_ros1_bag_keeps_its_whole_chunks(tmp_path: Path, ros_writer, compression: str):
    t = np.arange(4000) * 0.01
    streams = {"/odom": stream(ODOMETRY, t), "/rpm": stream(("data[0]",), t)}
    ros_writer.write(tmp_path / "whole.bag", streams, compression=compression)
    content = (tmp_path / "whole.bag").read_bytes()
    path = tmp_path / "cut.bag"
    path.write_bytes(content[: int(0.8 * len(content))])
    recording = read(path)
    dut = recording.streams["/odom"]
    assert 1000 < len(dut) < len(t)
    np.testing.assert_allclose(dut.t, t[: len(dut)], rtol=0, atol=1e-9)
    assert dut.columns[ODOMETRY[3]][7] == streams["/odom"].columns[ODOMETRY[3]][7]
    np.testing.assert_allclose(recording.streams["/rpm"].t[:1000], t[:1000], rtol=0, atol=1e-9)
    assert any("cut off" in note for note in recording.notes)


@pytest.mark.parametrize("storage", STORAGES)
def test_a_folder_without_metadata_is_read_by_its_files(tmp_path: Path, ros_writer, storage: str):
    ros_writer.write(tmp_path / "bag", flight(), storage=storage)
    (tmp_path / "bag" / "metadata.yaml").unlink()
    assert format_of(tmp_path / "bag") is ROS
    recording = read(tmp_path / "bag")
    assert_holds(recording, flight())
    assert any("metadata.yaml" in note for note in recording.notes)


def take(path: Path) -> None:
    """Read all that a bag holds; LogError is the only exception that may come."""
    try:
        recording = read(path)
        ROS.default_map(ROS.contents(path))
    except LogError as error:
        lines = str(error).splitlines()
    else:
        lines = [recording.path]
    assert len(lines) == 1


HEADS = {".mcap": b"\x89MCAP0\r\n", ".bag": b"#ROSBAG V2.0\n", ".db3": b"SQLite format 3\0"}


@given(content=st.binary(max_size=300), suffix=st.sampled_from(list(HEADS)), head=st.booleans())
@settings(max_examples=150, deadline=None)
def test_arbitrary_bytes_end_in_a_refusal(content: bytes, suffix: str, head: bool):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"fuzzed{suffix}"
        path.write_bytes(HEADS[suffix] * head + content)
        take(path)


@pytest.fixture(scope="session")
def whole(tmp_path_factory, ros_writer) -> dict[str, bytes]:
    """Return the bytes of a bag of every storage."""
    folder = tmp_path_factory.mktemp("ros")
    streams = {"/odom": stream(ODOMETRY, T[:5]), "/rpm": stream(("data[0]", "data[1]"), T[:5])}
    for suffix in HEADS:
        ros_writer.write(folder / f"1{suffix}", streams)
    return {suffix: (folder / f"1{suffix}").read_bytes() for suffix in HEADS}


@given(data=st.data(), suffix=st.sampled_from(list(HEADS)))
@settings(max_examples=200, deadline=None)
def test_damage_ends_in_a_refusal_or_a_recording(data, suffix: str, whole):
    size = len(whole[suffix])
    content = bytearray(whole[suffix][: data.draw(st.one_of(st.just(size), st.integers(0, size)))])
    for _ in range(data.draw(st.integers(0, 6)) if content else 0):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"fuzzed{suffix}"
        path.write_bytes(content)
        take(path)
