"""ArduPilot logs: round trips, what pymavlink reads, instances, damage."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.formats.dataflash import DATAFLASH
from np_drake.logs.formats.format import Stream, find_column
from np_drake.logs.formats.known_formats import format_of
from tests.np_drake.logs.formats import dataflash_writer, made_files
from tests.np_drake.logs.formats.made_files import assert_holds

T = np.arange(40) * 2500e-6 + 12.5  # [s], whole microseconds


def stream(*columns: str, t: np.ndarray = T, seed: int = 0) -> Stream:
    return made_files.noise(columns, t, seed)


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


read = partial(made_files.read, DATAFLASH)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "00000001.BIN"
    dataflash_writer.write(path, copter(), parameters={"MOT_THST_HOVER": 0.25, "RC1_MIN": 1100})
    return path


def test_what_is_written_is_read(log: Path):
    assert format_of(log) is DATAFLASH
    assert_holds(read(log), copter())
    assert DATAFLASH.contents(log) == {name: tuple(s.columns) for name, s in copter().items()}


def test_values_are_those_of_pymavlink(tmp_path: Path):
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
    assert any("bytes are no whole record" in note for note in recording.notes)
    assert sum(map(len, recording.streams.values())) == sum(map(len, copter().values())) - 1


def test_of_a_text_the_binary_log_is_wanted(tmp_path: Path):
    (tmp_path / "1.log").write_text("FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n")
    assert format_of(tmp_path / "1.log") is DATAFLASH
    with pytest.raises(LogError, match=r"1\.log: must be .*\(\.bin\); it is no binary log"):
        DATAFLASH.contents(tmp_path / "1.log")


def test_bytes_that_are_no_record_are_stepped_over(log: Path):
    content = log.read_bytes()
    at = content.rindex(b"\xa3\x95")
    log.write_bytes(content[:at] + bytes(100) + content[at:] + bytes(300))
    recording = read(log)
    assert any("400 bytes are no whole record" in note for note in recording.notes)
    assert_holds(recording, copter())


@pytest.mark.parametrize(
    "content", [b"", b"\xa3\x95\x80", b"FMT, 128, 89, FMT, BBnNZ, Type\n", b"\xa3" * 1000]
)
def test_a_file_without_messages_is_refused(tmp_path: Path, content: bytes):
    path = tmp_path / "bad.bin"
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"bad\.bin: must"):
        DATAFLASH.contents(path)
