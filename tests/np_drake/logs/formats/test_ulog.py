"""Laws of PX4 ULog files: what was written is read."""

import struct
import sys
from functools import partial

import numpy as np
import pytest

pytest.importorskip("pyulog", reason="ULog needs pyulog")

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Stream
from np_drake.logs.formats.known_formats import format_of
from np_drake.logs.formats.ulog import ULOG
from np_drake.logs.importing.import_log import import_log
from tests.np_drake.logs.formats import ulog_writer as writer
from tests.np_drake.logs.formats.made_files import assert_holds, noise, read

Q = [f"q[{i}]" for i in range(4)]


def stream(columns, rows=60, rate=50.0, seed=1) -> Stream:
    return noise(columns, np.arange(rows) / rate, seed)


@pytest.fixture(scope="module")
def made() -> dict[str, Stream]:
    """Return streams with arrays, instances and messages in messages."""
    return {
        "vehicle_local_position": stream(["x", "y", "z", "vx", "vy", "vz"], rate=25.0),
        "vehicle_attitude": stream(Q, seed=2),
        "vehicle_imu": stream(["gyro[0]", "gyro[1]"], seed=3),
        "vehicle_imu.1": stream(["gyro[0]", "gyro[1]"], rows=20, seed=4),
        "nested": stream(["part[0].a", "part[0].b", "part[1].a", "part[1].b", "c"], seed=5),
    }


everything = partial(read, ULOG)


def test_what_is_written_is_read(log, made):
    writer.write(log, made)
    dut = everything(log)
    assert format_of(log) is ULOG
    assert dut.notes == ()
    assert dut.contents == {name: tuple(s.columns) for name, s in made.items()}
    assert_holds(dut, made)


def sampled(name, delay) -> dict[str, Stream]:
    """Return a stream whose samples are older than its messages by a delay (n,) [s]."""
    t = 0.1 + np.arange(20) * 0.02
    us = writer.START + np.round((t - delay) * 1e6)
    return {
        name: Stream(
            t, {"xyz[0]": t, "timestamp_sample": np.where(np.isnan(delay), 0, np.nan_to_num(us))}
        )
    }


def test_times_are_those_of_the_sample_where_it_has_one(log):
    delay = np.full(20, 0.004)
    delay[7] = np.nan  # a row that does not say
    writer.write(log, sampled("vehicle_angular_velocity", delay))
    dut = ULOG.read(log, {"vehicle_angular_velocity": ["xyz[0]"]}, lambda share: None)
    t = 0.1 + np.arange(20) * 0.02
    assert dut.streams["vehicle_angular_velocity"].t == pytest.approx(
        t - np.nan_to_num(delay), abs=1e-6
    )
    assert "vehicle_angular_velocity (4.0 ms)" in dut.notes[0]


@pytest.mark.parametrize(
    "name", ["vehicle_thrust_setpoint", "actuator_motors", "actuator_controls_0"]
)
def test_a_command_acts_when_it_is_published(log, name):
    writer.write(log, sampled(name, np.full(20, 0.004)))
    dut = ULOG.read(log, {name: ["xyz[0]"]}, lambda share: None)
    assert dut.streams[name].t == pytest.approx(0.1 + np.arange(20) * 0.02, abs=1e-6)
    assert "published" in dut.notes[0]


def test_a_row_without_a_time_is_left_out_and_a_backward_time_is_kept(log):
    t = np.array([0.5, 0.3, 0.3, -writer.START / 1e6])
    table = {"a": Stream(t, {"x": np.arange(4.0)})}
    writer.write(log, table)
    dut = everything(log)
    assert sorted(dut.streams["a"].t) == pytest.approx([0.3, 0.3, 0.5])
    assert 3 not in dut.streams["a"].columns["x"]
    assert "a: 1 rows without a time" in dut.notes[0]


def test_facts_name_the_vehicle_and_the_parameters_of_its_thrust(log, made):
    parameters = {
        "MPC_THR_HOVER": 0.35,
        "CA_ROTOR_COUNT": 4,
        "CA_ROTOR3_PX": 0.25,
        "CA_ROTOR4_PX": 9.0,
    }
    parameters |= {"PWM_MIN": 1000, "PWM_AUX_MIN1": -1, "BAT1_N_CELLS": 6, "EKF2_AID_MASK": 1}
    writer.write(log, made, facts={"sys_name": "PX4", "ver_hw": "FMU_V6X"}, parameters=parameters)
    dut = everything(log).facts
    assert dut["system"] == "PX4"
    assert dut["hardware"] == "FMU_V6X"
    assert (dut["MPC_THR_HOVER"], dut["CA_ROTOR3_PX"]) == ("0.35", "0.25")
    assert (dut["CA_ROTOR_COUNT"], dut["PWM_MIN"], dut["BAT1_N_CELLS"]) == ("4", "1000", "6")
    assert not {"CA_ROTOR4_PX", "PWM_AUX_MIN1", "EKF2_AID_MASK"} & set(dut)


def test_estimates_that_are_not_valid_or_jump_are_noted(log):
    n = 20
    position = stream(["x"], rows=n)
    flags = {
        "xy_valid": np.arange(n) >= 5,
        "z_valid": np.ones(n),
        "xy_reset_counter": (np.arange(n) > 8) * 3,
    }
    kinds = dict.fromkeys(flags, "uint8_t")
    writer.write(
        log,
        {"vehicle_local_position": Stream(position.t, {**position.columns, **flags})},
        kinds=kinds,
    )
    dut = ULOG.read(log, {"vehicle_local_position": ["x"]}, lambda share: None)
    assert dut.notes == (
        "vehicle_local_position: xy_valid is 0 in 25 % of the rows; first valid at 0.10 s.",
        "vehicle_local_position: the estimate jumps at its resets (xy 1).",
    )


def test_of_a_log_that_was_cut_the_whole_messages_are_kept(log, made):
    writer.write(log, {"vehicle_attitude": made["vehicle_attitude"]})
    content = log.read_bytes()
    row = 3 + 2 + 8 + 4 * 8
    log.write_bytes(content[: -10 * row - 7])
    dut = everything(log)
    assert len(dut.streams["vehicle_attitude"]) == 49
    assert "cut off" in dut.notes[0]
    log.write_bytes(content[:60])
    with pytest.raises(LogError, match=r"must hold rows; this log \(PX4 ULog\) has none. Copy it"):
        import_log(log)


def test_warnings_of_the_parser_become_notes(log, made, capsys):
    writer.write(log, made)
    log.write_bytes(log.read_bytes() + struct.pack("<HB", 9, ord("D")) + b"\x63\0no name")
    assert "damaged" in everything(log).notes[0]
    assert capsys.readouterr().out == ""


HEADER = b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + bytes(8)


def framed(kind: str, payload: bytes) -> bytes:
    return struct.pack("<HB", len(payload), ord(kind)) + payload


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "Header too short"),
        (HEADER[:12], "Header too short"),
        (b"x" * 16, "Failed to parse header"),
        (HEADER + framed("B", bytes(8) + b"\2" + bytes(31)), "incompatible flag"),
        (HEADER + framed("F", b"a:a[2] b;") + framed("A", b"\0\0\0a"), "recursion"),
        (
            HEADER + framed("F", b"a:b[60000] x;") + framed("F", b"b:int8_t[60000] x;"),
            "larger than a message",
        ),
    ],
)
def test_what_is_no_ulog_file_is_refused_in_one_line(log, content, said):
    log.write_bytes(content)
    for call in (
        lambda: ULOG.contents(log),
        lambda: ULOG.read(log, {"a": ["b"]}, lambda share: None),
    ):
        with pytest.raises(LogError, match=said) as refused:
            call()
        assert str(log) in str(refused.value)
        assert "\n" not in str(refused.value)


def test_a_damaged_file_does_not_lead_in_circles(log):
    """A message of unknown type at the end, of a size that sends the parser back before it."""
    log.write_bytes(HEADER + framed("I", b"x") * 6000 + struct.pack("<HB", 20_000, 7) + b"end")
    with pytest.raises(LogError, match="circles"):
        ULOG.contents(log)


def test_a_message_without_a_time_is_left_out(log):
    row = framed("D", b"\0\0" + bytes(12))
    log.write_bytes(
        HEADER + framed("F", b"a:float x;uint64_t other;") + framed("A", b"\0\0\0a") + row
    )
    assert ULOG.contents(log) == {}
    with pytest.raises(LogError, match="must hold rows of a"):
        ULOG.read(log, {"a": ["x"]}, lambda share: None)


def test_without_pyulog_the_error_says_how_to_install_it(log, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(LogError, match=r"pip install 'np_drake\[ulog\]'"):
        ULOG.contents(log)
