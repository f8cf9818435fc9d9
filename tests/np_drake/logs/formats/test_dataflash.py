"""ArduPilot logs: round trips, what pymavlink reads, instances, damage."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.logs.errors import LogError
from np_drake.logs.formats.dataflash import DATAFLASH
from np_drake.logs.formats.format import Recording, Stream, by_stream, find_column
from np_drake.logs.formats.library import format_of

T = np.arange(40) * 2500e-6 + 12.5  # [s], whole microseconds


def stream(*columns: str, t: np.ndarray = T, seed: int = 0) -> Stream:
    rng = np.random.default_rng(seed)
    return Stream(t, {c: rng.standard_normal(len(t)) for c in columns})


def copter() -> dict[str, Stream]:
    """Streams of a quadrotor with two IMUs, two EKF cores and four reporting speed controllers."""
    ekf = ("Roll", "Pitch", "Yaw", "VN", "VE", "VD", "PN", "PE", "PD")
    imu = ("GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ")
    return {
        **{f"IMU.{i}": stream(*imu, seed=i) for i in range(2)},
        **{f"XKF1.{i}": stream(*ekf, seed=i + 2, t=T[::4]) for i in range(2)},
        "ATT": stream("DesRoll", "Roll", "DesPitch", "Pitch", "DesYaw", "Yaw", t=T[::2]),
        "RCOU": stream(*(f"C{i}" for i in range(1, 9)), t=T[::4]),
        "CTUN": stream("ThI", "ABst", "ThO", "ThH", t=T[::4]),
        "BAT.0": stream("Volt", "Curr", t=T[::10]),
        **{f"ESC.{i}": stream("RPM", "Volt", seed=i + 9, t=T[::4] + i * 1e-6) for i in range(4)},
    }


def read(path: Path, names: list[str] | None = None) -> Recording:
    contents = DATAFLASH.contents(path)
    wanted = (
        {s: list(c) for s, c in contents.items()} if names is None else by_stream(contents, names)
    )
    return DATAFLASH.read(path, wanted, lambda _: None)


def assert_same(left: Stream, right: Stream) -> None:
    np.testing.assert_allclose(
        left.t, right.t, rtol=0, atol=1e-9
    )  # rounding of microseconds in seconds
    assert set(left.columns) == set(right.columns)
    for name, values in right.columns.items():
        np.testing.assert_array_equal(left.columns[name], values)


@pytest.fixture
def log(tmp_path: Path, dataflash_writer) -> Path:
    path = tmp_path / "00000001.BIN"
    dataflash_writer.write(path, copter(), parameters={"MOT_THST_HOVER": 0.25, "RC1_MIN": 1100})
    return path


def test_what_is_written_is_read(log: Path):
    assert format_of(log) is DATAFLASH
    recording = read(log)
    assert set(recording.streams) == set(copter())
    for name, expected in copter().items():
        assert_same(recording.streams[name], expected)


def test_a_text_log_reads_as_a_binary_one(tmp_path: Path, dataflash_writer):
    streams = {n: s for n, s in copter().items() if "." not in n}
    dataflash_writer.write_text(tmp_path / "1.log", streams)
    assert format_of(tmp_path / "1.log") is DATAFLASH
    recording = read(tmp_path / "1.log")
    assert set(recording.streams) == set(streams)
    for name, expected in streams.items():
        assert_same(recording.streams[name], expected)


def test_a_text_log_may_number_its_instances(tmp_path: Path):
    lines = (
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        "FMT, 150, 44, FMTU, QBNN, TimeUS,FmtType,UnitIds,MultIds",
        "FMT, 140, 16, IMU, QBf, TimeUS,I,GyrX",
        "FMTU, 0, 140, s#E, F-0",
        "IMU, 1000000, 0, 0.5",
        "IMU, 1000000, 1, 0.75",
        "IMU, 2000000, 0, bad",
    )
    path = tmp_path / "2.log"
    path.write_text("\r\n".join(lines) + "\r\n")
    streams = read(path).streams
    np.testing.assert_array_equal(streams["IMU.0"].columns["GyrX"], [0.5, np.nan])
    np.testing.assert_array_equal(streams["IMU.1"].columns["GyrX"], [0.75])
    np.testing.assert_array_equal(streams["IMU.0"].t, [1.0, 2.0])


def test_times_that_are_no_numbers_make_no_stream(tmp_path: Path):
    path = tmp_path / "3.log"
    path.write_text(
        "FMT, 140, 71, ATT, Zf, TimeUS,Roll\nFMT, 141, 15, POS, Qf, TimeUS,Alt\nATT, a, "
        "1\nPOS, 1, 2\n"
    )
    assert DATAFLASH.contents(path) == {"POS": ("Alt",)}


def test_values_are_those_of_pymavlink(tmp_path: Path, dataflash_writer):
    reader = pytest.importorskip("pymavlink.DFReader")
    path = tmp_path / "scaled.bin"
    columns = {
        "Lat": "L",
        "Roll": "c",
        "Yaw": "C",
        "Alt": "e",
        "Dist": "E",
        "Temp": "g",
        "Rate": "f",
    }
    streams = {"POS.0": stream(*columns), "POS.1": stream(*columns, seed=1)}
    for s in streams.values():
        for c in ("Yaw", "Dist"):  # unsigned
            s.columns[c][:] = np.abs(s.columns[c])
    dataflash_writer.write(path, streams, characters=columns)
    dut = read(path)
    with reader.DFReader_binary(str(path)) as log:
        rows = list(iter(lambda: log.recv_match(type="POS", strict=True), None))
    for i in range(2):
        ours = dut.streams[f"POS.{i}"]
        theirs = [m for m in rows if i == m.I]
        np.testing.assert_array_equal(ours.t, [m.TimeUS * 1e-6 for m in theirs])
        for c in columns:
            np.testing.assert_array_equal(ours.columns[c], [getattr(m, c) for m in theirs])


def test_only_what_is_wanted_is_read(log: Path):
    recording = read(log, ["IMU.1/GyrX", "ATT/Yaw"])
    assert recording.contents == {"IMU.1": ("GyrX",), "ATT": ("Yaw",)}
    np.testing.assert_array_equal(
        recording.streams["IMU.1"].columns["GyrX"], copter()["IMU.1"].columns["GyrX"]
    )


def test_the_names_of_ardupilot_make_the_map(log: Path):
    contents = DATAFLASH.contents(log)
    dut = DATAFLASH.default_map(contents)
    assert dut is not None
    dut.check()
    assert (dut.world, dut.body, dut.command) == ("ned", "frd", "unknown")
    assert dut.position.columns == ["XKF1.0/PN", "XKF1.0/PE", "XKF1.0/PD"]
    assert dut.velocity.columns == ["XKF1.0/VN", "XKF1.0/VE", "XKF1.0/VD"]
    assert (dut.attitude.columns, dut.attitude.unit) == (
        ["ATT/Roll", "ATT/Pitch", "ATT/Yaw"],
        "deg",
    )
    assert dut.acceleration.kind == "specific_force"
    assert dut.rotor_speed.columns == [f"ESC.{i}/RPM" for i in range(4)]
    assert dut.throttle.columns == [f"RCOU/C{i}" for i in range(1, 5)]
    assert dut.voltage.columns == ["BAT.0/Volt"]
    for name in dut.names():
        find_column(contents, name)


def test_a_quaternion_is_preferred_and_three_speed_controllers_are_too_few():
    contents = {
        "XKF1.0": ("PN", "PE", "PD", "VN", "VE", "VD"),
        "ATT": ("Roll", "Pitch", "Yaw"),
        "XKQ.0": ("Q1", "Q2", "Q3", "Q4"),
        "CTUN": ("ThO", "ThH"),
        **{f"ESC.{i}": ("RPM",) for i in range(3)},
    }
    dut = DATAFLASH.default_map(contents)
    assert dut is not None
    assert dut.attitude.columns == ["XKQ.0/Q1", "XKQ.0/Q2", "XKQ.0/Q3", "XKQ.0/Q4"]
    assert not dut.rotor_speed
    assert (dut.throttle.columns, dut.hover_throttle.columns) == (["CTUN/ThO"], ["CTUN/ThH"])


def test_without_position_or_attitude_there_is_no_map():
    assert DATAFLASH.default_map({"ATT": ("Roll", "Pitch", "Yaw")}) is None
    assert DATAFLASH.default_map({"XKF1.0": ("PN", "PE", "PD", "VN", "VE", "VD")}) is None


def test_firmware_and_motor_parameters_are_facts(log: Path):
    assert read(log).facts == {"firmware": "ArduCopter V4.5.7 (made)", "MOT_THST_HOVER": "0.25"}


def test_a_cut_end_keeps_the_whole_records(log: Path):
    log.write_bytes(log.read_bytes()[:-5])
    recording = read(log)
    assert any("cut off" in note for note in recording.notes)
    assert sum(map(len, recording.streams.values())) == sum(map(len, copter().values())) - 1


def test_a_cut_line_is_left_out(tmp_path: Path, dataflash_writer):
    path = tmp_path / "cut.log"
    dataflash_writer.write_text(path, {"ATT": stream("Roll")})
    path.write_bytes(path.read_bytes()[:-5])
    recording = read(path)
    assert len(recording.streams["ATT"]) == len(T) - 1
    assert any("cut off" in note for note in recording.notes)


def test_bytes_that_are_no_record_are_stepped_over(log: Path):
    content = log.read_bytes()
    at = content.rindex(b"\xa3\x95")
    log.write_bytes(content[:at] + bytes(100) + content[at:] + bytes(300))
    recording = read(log)
    assert any(f"400 bytes are no record, from byte {at} on" in note for note in recording.notes)
    for name, expected in copter().items():
        assert_same(recording.streams[name], expected)


def test_progress_ends_at_one(log: Path):
    shares: list[float] = []
    DATAFLASH.read(log, {"ATT": ["Roll"]}, shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.parametrize(
    "content", [b"", b"\xa3\x95\x80", b"FMT, 128, 89, FMT, BBnNZ, Type\n", b"\xa3" * 1000]
)
def test_a_file_without_messages_is_refused(tmp_path: Path, content: bytes):
    path = tmp_path / "bad.bin"
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"bad\.bin: must"):
        DATAFLASH.contents(path)


def take(content: bytes) -> None:
    """Read all that the bytes hold; LogError is the only exception that may come."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fuzzed.bin"
        path.write_bytes(content)
        try:
            recording = read(path)
            DATAFLASH.default_map(DATAFLASH.contents(path))
        except LogError as error:
            lines = str(error).splitlines()
        else:
            lines = [recording.path]
    assert len(lines) == 1


@given(
    content=st.binary(max_size=400), head=st.sampled_from([b"", b"\xa3\x95\x80", b"FMT, 128, 89, "])
)
@settings(max_examples=200, deadline=None)
def test_arbitrary_bytes_end_in_a_refusal_or_a_recording(content: bytes, head: bytes):
    take(head + content)


@pytest.fixture(scope="session")
def whole(tmp_path_factory, dataflash_writer) -> dict[bool, bytes]:
    """Return the bytes of a binary log and of one as text (True)."""
    folder = tmp_path_factory.mktemp("dataflash")
    dataflash_writer.write(folder / "1.bin", copter())
    dataflash_writer.write_text(folder / "1.log", {"ATT": stream("Roll"), "IMU": stream("GyrX")})
    return {False: (folder / "1.bin").read_bytes(), True: (folder / "1.log").read_bytes()}


@given(data=st.data(), text=st.booleans())
@settings(max_examples=300, deadline=None)
def test_damage_ends_in_a_refusal_or_a_recording(data, text: bool, whole):
    content = bytearray(whole[text][: data.draw(st.integers(0, len(whole[text])))])
    for _ in range(data.draw(st.integers(0, 6)) if content else 0):
        content[data.draw(st.integers(0, min(len(content), 3000) - 1))] = data.draw(
            st.integers(0, 255)
        )
    take(bytes(content))


def test_short_lines_below_a_broad_definition_are_refused(tmp_path: Path):
    """Every line of 4 bytes would become a row of 300 numbers."""
    names = ",".join(f"c{k}" for k in range(300))
    head = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n"
    path = tmp_path / "a.log"
    path.write_text(f"{head}FMT, 1, 26, A, Q{'B' * 300}, TimeUS,{names}\n" + "A,5\n" * 20_000)
    columns = list(DATAFLASH.contents(path)["A"])
    with pytest.raises(LogError, match=r"at most 4\.1 million numbers for its size"):
        DATAFLASH.read(path, {"A": columns}, lambda share: None)
    assert len(DATAFLASH.read(path, {"A": columns[:9]}, lambda share: None).streams["A"]) == 20_000


def test_a_message_has_no_more_instances_than_a_byte_numbers(tmp_path: Path):
    head = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n"
    lines = "".join(f"IMU,5,{k},1\n" for k in range(1000))
    path = tmp_path / "a.log"
    head += (
        "FMT, 1, 16, IMU, QBf, TimeUS,I,GyrX\nFMT, 2, 44, FMTU, QBNN, "
        "TimeUS,FmtType,UnitIds,MultIds\n"
    )
    path.write_text(f"{head}FMTU, 5, 1, s#E, F-0\n{lines}")
    assert len(DATAFLASH.contents(path)) == 256
