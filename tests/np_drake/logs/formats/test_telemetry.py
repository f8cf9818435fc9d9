"""Laws of MAVLink telemetry logs: a flight comes back from what a ground station received."""

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="MAVLink logs need pymavlink")

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import no_progress
from np_drake.logs.formats.known_formats import format_of
from np_drake.logs.formats.telemetry import TELEMETRY
from np_drake.logs.importing.import_log import import_log
from tests.np_drake.diagnosis import simulated_flights
from tests.np_drake.logs.formats import telemetry_writer as writer
from tests.np_drake.logs.importing.autopilot_streams import PX4_FROM_OURS, throttle


@pytest.fixture(scope="module")
def flown():
    """Return a lively flight of 8 s at 100 Hz, its times in whole milliseconds."""
    return simulated_flights.fly(seed=5, seconds=8.0, noise=1.0, vigour=1.5, attitude_noise=0.003)


def pulses(log) -> np.ndarray:
    return 1000.0 + 1000.0 * throttle(log)[:, PX4_FROM_OURS]


def same_throttle(dut, flown) -> None:
    """Check the throttle to half of a pulse of 1000; times are rounded at the last row."""
    wanted = throttle(flown)[:-1, PX4_FROM_OURS]
    np.testing.assert_allclose(dut.throttle[:-1], wanted, atol=6e-4)


def test_a_flight_comes_back_from_its_telemetry(flown, tmp_path):
    path = tmp_path / "log.tlog"
    writer.write(path, writer.frames(flown, pulses(flown), parameters={"MAV_TYPE": 2.0}))
    assert format_of(path).name == "tlog"
    (dut,) = import_log(path).flights
    assert dut.name == "log"
    assert dut.input == "normalised"
    np.testing.assert_allclose(dut.t, flown.t, atol=1e-9)
    np.testing.assert_allclose(dut.p, flown.p, atol=1e-5)
    turned = np.abs(np.sum(dut.q * flown.q, axis=1))
    np.testing.assert_allclose(turned, 1.0, atol=1e-6)
    same_throttle(dut, flown)
    np.testing.assert_allclose(dut.voltage, 16.2, atol=1e-3)


def test_motors_are_on_the_outputs_that_the_parameters_name(flown, tmp_path):
    path = tmp_path / "log.tlog"
    swing = 1500.0 + 80.0 * np.sin(np.outer(flown.t, [1.0, 2.0, 3.0, 4.0]))
    told = {f"SERVO{5 + i}_FUNCTION": 33.0 + i for i in range(4)}
    told |= {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0}
    rows = writer.frames(
        flown, np.column_stack([swing, pulses(flown)]), parameters=told, autopilot=writer.ARDUPILOT
    )
    writer.write(path, rows)
    dut = import_log(path)
    assert dut.sheet.rotors is not None
    same_throttle(dut.flights[0], flown)


@pytest.mark.parametrize("autopilot", [writer.PX4, writer.ARDUPILOT])
def test_outputs_that_rest_while_the_vehicle_moves_are_no_flight(flown, tmp_path, autopilot):
    path, rest = tmp_path / "log.tlog", np.full((len(flown), 4), 1000.0)
    writer.write(path, writer.frames(flown, rest, autopilot=autopilot))
    told = "no flight: the motors do not carry the vehicle"
    if autopilot == writer.ARDUPILOT:
        assert f"{told}; nothing can be identified" in import_log(path).shown
        return
    with pytest.raises(LogError, match=told):
        import_log(path)


def test_a_vehicle_that_boots_again_flies_twice(flown, tmp_path):
    path = tmp_path / "log.tlog"
    again = writer.frames(flown, pulses(flown), boot=writer.SINCE + 60.0)
    writer.write(path, writer.frames(flown, pulses(flown)) + again)
    dut = import_log(path)
    first, second = dut.flights
    assert second.start - first.start == pytest.approx(60.0, abs=0.01)  # LATE is common
    np.testing.assert_allclose(second.p, flown.p, atol=1e-5)
    assert any("the vehicle boots again" in line for line in dut.shown)


def test_bytes_that_are_no_message_are_passed_over_and_counted(flown, tmp_path):
    path = tmp_path / "log.tlog"
    rows = writer.frames(flown, pulses(flown))
    for at in range(1501, 1541, 8):
        stamp, whole = rows[at]
        rows[at] = stamp, whole[:1] + bytes([whole[1] ^ 0x40]) + whole[2:]  # its length is wrong
    writer.write(path, rows[:2000])
    whole = path.read_bytes()
    writer.write(path, rows[2000:])
    content = bytearray(whole + b"\x00\xfd\x07" * 9 + path.read_bytes()[:-4])
    content[20000] ^= 0xFF  # of a payload
    path.write_bytes(content)
    names = ("LOCAL_POSITION_NED", "ATTITUDE_QUATERNION", "SYS_STATUS", "VIBRATION")
    wanted = {name: list(TELEMETRY.contents(path)[name])[:1] for name in names}
    streams = TELEMETRY.read(path, wanted, no_progress).streams
    assert sum(map(len, streams.values())) >= len(names) * len(flown) - 7  # one for each damage
    dut = import_log(path)
    assert len(dut.flights[0]) >= len(flown) - 3
    np.testing.assert_allclose(dut.flights[0].p[:600], flown.p[:600], atol=0.01)
    assert any("bytes are of no message" in note for note in dut.sheet.content["notes"])


def test_a_log_that_was_cut_short_says_so(flown, tmp_path):
    path = tmp_path / "log.tlog"
    writer.write(path, writer.frames(flown, pulses(flown)))
    content = path.read_bytes()
    assert not any("cut off" in line for line in import_log(path).shown)
    path.write_bytes(content[: len(content) // 2])
    assert "the log ends within a message (cut off)" in import_log(path).shown[0]
    path.write_bytes(content[:100])
    with pytest.raises(LogError, match=r"in 20 messages; it has .*cut off\)\. Copy it again"):
        import_log(path)


def test_a_log_without_a_vehicle_says_what_to_bring(flown, tmp_path):
    path = tmp_path / "log.tlog"
    rows = [row for row in writer.frames(flown, pulses(flown)) if row[1][5] == 255]
    writer.write(path, rows)
    with pytest.raises(LogError, match=r"state of a vehicle.*bring the vehicle's own log"):
        import_log(path)


def test_what_a_vehicle_says_of_itself_is_said(flown, tmp_path):
    path = tmp_path / "log.tlog"
    rows = writer.frames(flown, pulses(flown), warning=(3.0, "Potential Thrust Loss (3)"), clips=1)
    writer.write(path, rows)
    dut = import_log(path)
    (event,) = [line for line in dut.shown if "Thrust Loss" in line]
    assert event == "the log says: 'Potential Thrust Loss (3)' at 3.00 s"
    assert any("clips along body x, y, z" in line for line in dut.shown)
    assert any("shakes by more than 30 m/s2 (VIBRATION)" in line for line in dut.shown)


def test_a_plane_is_refused_by_its_heartbeat(flown, tmp_path):
    path = tmp_path / "log.tlog"
    writer.write(path, writer.frames(flown, pulses(flown), kind=1))
    with pytest.raises(LogError, match=r"it is that of a plane \(MAV_TYPE 1\)"):
        import_log(path)
