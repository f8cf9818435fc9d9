"""Laws of the map of PX4 logs: which messages are taken, and what the two real logs hold."""

from collections.abc import Mapping

import numpy as np
import pytest

pytest.importorskip("pyulog", reason="ULog needs pyulog")

from np_drake.logs.formats.format import Contents, Stream
from np_drake.logs.formats.ulog import ULOG
from np_drake.logs.importing.import_log import import_log
from tests.np_drake.logs.formats import ulog_writer as writer

Q = [f"q[{i}]" for i in range(4)]
XYZ = [f"xyz[{i}]" for i in range(3)]


def stream(columns) -> Stream:
    """Return sixty rows at 50 Hz in which every column changes."""
    t = np.arange(60) / 50.0
    return Stream(t, {c: np.sin(7.0 * t + i) for i, c in enumerate(columns)})


STATE: dict[str, tuple[str, ...]] = {
    "vehicle_local_position": ("x", "y", "z", "vx", "vy", "vz"),
    "vehicle_attitude": tuple(Q),
}


def sources(contents: Contents) -> dict[str, list[str]]:
    dut = ULOG.default_map(contents)
    assert dut is not None
    assert dut.check() is dut
    assert (dut.world, dut.body, dut.command) == ("ned", "frd", "unknown")
    return {name: source.columns for name, source in dut.sources()}


def test_the_map_takes_the_first_message_that_a_log_has():
    gyro = tuple(f"gyro_rad[{i}]" for i in range(3))
    accelerometer = tuple(f"accelerometer_m_s2[{i}]" for i in range(3))
    whole = {
        **STATE,
        "sensor_combined": gyro + accelerometer,
        "vehicle_angular_velocity": tuple(XYZ),
    }
    dut = sources(whole)
    assert dut["rates"] == [f"vehicle_angular_velocity/{c}" for c in XYZ]
    assert dut["acceleration"] == [f"sensor_combined/{c}" for c in accelerometer]
    del whole["vehicle_angular_velocity"]
    assert sources(whole)["rates"] == [f"sensor_combined/{c}" for c in gyro]
    speeds = ("rollspeed", "pitchspeed", "yawspeed")
    old = {**STATE, "vehicle_attitude": (*Q, *speeds), "vehicle_acceleration": tuple(XYZ)}
    assert sources(old)["rates"] == [f"vehicle_attitude/{c}" for c in speeds]
    assert sources(old)["acceleration"] == [f"vehicle_acceleration/{c}" for c in XYZ]


@pytest.mark.parametrize("indexed", [True, False])
@pytest.mark.parametrize(
    ("name", "axes"), [("vehicle_odometry", "world"), ("vehicle_visual_odometry", "body")]
)
def test_without_a_local_position_odometry_gives_the_state(name, axes, indexed):
    old = ("x", "y", "z", "vx", "vy", "vz")
    new = (*(f"position[{i}]" for i in range(3)), *(f"velocity[{i}]" for i in range(3)))
    columns = new if indexed else old
    dut = ULOG.default_map({name: (*columns, *Q)})
    assert dut is not None
    assert dut.position.columns + dut.velocity.columns == [f"{name}/{c}" for c in columns]
    assert dut.attitude.columns == [f"{name}/{c}" for c in Q]
    assert dut.velocity.axes == axes


def test_without_position_or_attitude_only_its_user_knows_the_map():
    assert ULOG.default_map({"vehicle_attitude": tuple(Q)}) is None
    assert ULOG.default_map({"vehicle_local_position": ("x", "y", "z")}) is None
    assert ULOG.default_map({}) is None


COLLECTIVE = {
    "vehicle_thrust_setpoint": tuple(XYZ),
    "actuator_controls_0": tuple(f"control[{i}]" for i in range(8)),
    "vehicle_attitude_setpoint": ("thrust_body[2]",),
}


def test_collective_thrust_is_positive_along_the_thrust():
    for left_out, column, scale in [
        ((), "vehicle_thrust_setpoint/xyz[2]", -1),
        (("vehicle_thrust_setpoint",), "actuator_controls_0/control[3]", 1),
        (
            ("vehicle_thrust_setpoint", "actuator_controls_0"),
            "vehicle_attitude_setpoint/thrust_body[2]",
            -1,
        ),
    ]:
        dut = ULOG.default_map(
            {**STATE, **{n: c for n, c in COLLECTIVE.items() if n not in left_out}}
        )
        assert dut is not None
        assert dut.throttle.columns == [column]
        assert dut.throttle.scale == scale


def rotors(rows: Mapping[str, int], used: int, rate: float) -> dict[str, Stream]:
    """Return streams of rotors, of which the first `used` change, and a state."""
    found = {n: stream(c) for n, c in STATE.items()}
    found["vehicle_thrust_setpoint"] = stream(XYZ)
    t = np.arange(80) / rate
    for name, count in rows.items():
        pattern = {"esc_status": "esc[{}].esc_rpm", "actuator_outputs": "output[{}]"}.get(
            name, "control[{}]"
        )
        idle = np.nan if name == "actuator_motors" else 0.0
        found[name] = Stream(
            t,
            {
                pattern.format(i): np.sin(t + i) if i < used else np.full(80, idle)
                for i in range(count)
            },
        )
    return found


def test_four_rotors_in_use_are_taken_and_constant_ones_left_out(log):
    writer.write(
        log, rotors({"esc_status": 8, "actuator_motors": 12, "actuator_outputs": 16}, 4, 100.0)
    )
    contents = ULOG.contents(log)
    assert contents["actuator_motors"] == tuple(f"control[{i}]" for i in range(4))
    dut = sources(contents)
    assert dut["rotor_speed"] == [f"esc_status/esc[{i}].esc_rpm" for i in range(4)]
    assert dut["throttle"] == [f"actuator_motors/control[{i}]" for i in range(4)]
    del contents["actuator_motors"]
    found = ULOG.default_map(contents)
    assert found is not None
    assert found.throttle.columns == [f"actuator_outputs/output[{i}]" for i in range(4)]
    assert found.throttle.unit == "us"


@pytest.mark.parametrize(("used", "rate"), [(6, 100.0), (3, 100.0), (4, 10.0)])
def test_rotors_not_four_or_logged_slowly_leave_collective_thrust(log, used, rate):
    writer.write(log, rotors({"esc_status": 8, "actuator_motors": 12}, used, rate))
    dut = sources(ULOG.contents(log))
    assert dut["throttle"] == ["vehicle_thrust_setpoint/xyz[2]"]
    assert ("rotor_speed" in dut) == (used == 4)  # too slow to be an input: it tells a stop


def test_the_simulated_flight_of_px4_agrees_with_ned_and_frd(real_flights):
    found = import_log(real_flights / "ulog" / "sample_px4_events.ulg")
    dut = found.sheet.content
    assert dut["conventions"].startswith("agree with the log in 3 checks")
    assert (dut["facts"]["CA_ROTOR_COUNT"], dut["facts"]["hardware"]) == ("4", "PX4_SITL")
    assert any("xy_valid is 0 in 31 %" in note for note in dut["notes"])
    (log,) = found.flights
    assert np.median(log.throttle) == pytest.approx(1.0, abs=0.05)  # over that of hover
