"""Which columns of an autopilot's log are motors, where these are, and in which unit: as the log
itself states it.
"""

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Stream
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.import_sheet import read_sheet, write_sheet
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.log_map import load_map_file
from np_drake.logs.opening import open_flights
from np_drake.vehicle import Vehicle
from tests.np_drake.logs.formats.made_files import writer
from tests.np_drake.logs.importing import autopilot_streams as autopilots


def noise(flown, columns: int) -> np.ndarray:
    """Return (n, columns) outputs of servos, which move."""
    return 1500.0 + 80.0 * np.sin(np.outer(flown.t, 1.0 + np.arange(columns)))


def opened(found, tmp_path, vehicle=None):
    """Return the flight as a diagnosis reads it: written, with its sheet, and opened with a vehicle
    file.
    """
    path = tmp_path / "flight.csv"
    write_log(found.flights[0], path)
    write_sheet(found.sheet, path)
    return open_flights(path, vehicle or Vehicle())[0][0]


def test_px4_motors_come_into_the_order_of_the_vehicle_file(flown, import_px4, tmp_path):
    ours = autopilots.throttle(flown)
    found = import_px4(
        {"actuator_motors": ours[:, autopilots.PX4_FROM_OURS]}, autopilots.PX4_CORNERS
    )
    dut = opened(found, tmp_path)
    np.testing.assert_allclose(dut.throttle, ours, atol=1e-9)
    assert (
        "rotors 1, 2, 3, 4 of the vehicle file are PX4 motor 3, PX4 motor 1, PX4 motor 4, PX4 "
        "motor 2 (CA_ROTORn_PX, PY, KM)" in dut.notes
    )
    assert dut.motors == ("PX4 motor 3", "PX4 motor 1", "PX4 motor 4", "PX4 motor 2")
    assert read_sheet(tmp_path / "flight.csv").rotors == found.sheet.rotors


def test_an_order_that_the_motion_contradicts_is_not_taken(flown, import_px4, tmp_path):
    ours = autopilots.throttle(flown)
    dut = opened(import_px4({"actuator_motors": ours}, autopilots.PX4_CORNERS), tmp_path)
    np.testing.assert_allclose(dut.throttle, ours, atol=1e-9)
    told = [note for note in dut.notes if note.startswith("rotor")]
    assert len(told) == 1
    assert "are not in the order that CA_ROTORn_PX, PY, KM states" in told[0]


AUX = ("actuator_outputs", "actuator_outputs.1")  # of two groups, the second


@pytest.mark.parametrize(
    "gimbal, servos, stream", [(3, 0, 0), (3, 2, 1), (4, 0, 1), (4, 2, 1), (6, 2, 1)]
)
def test_px4_motors_on_aux_are_told_from_a_gimbal_on_main(
    flown, import_px4, gimbal, servos, stream
):
    ours = autopilots.throttle(flown)
    main = {f"PWM_MAIN_FUNC{n}": 419 + n for n in range(1, gimbal + 1)}
    aux = dict(enumerate([*range(402, 402 + servos), 101, 102, 103, 104], start=1))
    limits = {f"PWM_AUX_{end}{n}": us for n in aux for end, us in (("MIN", 1100), ("MAX", 1900))}
    outputs = {
        AUX[1 - stream]: noise(flown, gimbal),
        AUX[stream]: np.column_stack([noise(flown, servos), 1100.0 + 800.0 * ours]),
    }
    found = import_px4(outputs, main | limits | {f"PWM_AUX_FUNC{n}": f for n, f in aux.items()})
    np.testing.assert_allclose(found.flights[0].throttle, ours, atol=1e-9)
    with pytest.raises(LogError, match="nothing says which are all of the motors"):
        import_px4({AUX[0]: noise(flown, gimbal)}, main)


@pytest.mark.parametrize("hover", [250.0, 1000.0])
def test_dshot_counts_are_told_however_low_the_vehicle_hovers(flown, import_px4, hover):
    ours = autopilots.throttle(flown)
    counts = hover * ours / np.median(ours)
    found = import_px4({"actuator_outputs": counts})
    np.testing.assert_allclose(found.flights[0].throttle, counts / 2000, atol=1e-9)
    assert any(line.startswith("outputs are taken as DShot counts") for line in found.shown)
    assert found.sheet.content["columns"]["throttle"]["unit"] == "dshot"


def test_outputs_of_a_hover_that_may_be_either_are_asked_for_by_name(fly, tmp_path):
    pytest.importorskip("pyulog", reason="ULog needs pyulog")
    log = fly(seed=5, seconds=8.0, noise=1.0, vigour=0.02, attitude_noise=0.003)
    ours = autopilots.throttle(log)
    streams = autopilots.px4(log, {"actuator_outputs": 2000.0 * ours})
    writer("ulog").write(tmp_path / "log.ulg", streams, parameters={})
    with pytest.raises(
        LogError, match=r"throttle \(actuator_outputs/output\[0\] …\): must be pulses .* or DShot"
    ) as e:
        import_log(tmp_path / "log.ulg")
    assert "\n" not in str(e.value)
    for unit, read in (("us", 2 * ours - 1), ("dshot", ours)):
        (tmp_path / "map.yaml").write_text(f"throttle: {{unit: {unit}}}\n")
        (dut,) = import_log(tmp_path / "log.ulg", load_map_file(tmp_path / "map.yaml")).flights
        np.testing.assert_allclose(dut.throttle, read, atol=1e-9)


def servos(outputs, first: int = 33) -> dict[str, float]:
    return {f"SERVO{n}_FUNCTION": float(first + k) for k, n in enumerate(outputs)}


def test_ardupilot_motors_are_on_the_outputs_of_their_functions(flown, import_ardupilot, tmp_path):
    ours = autopilots.throttle(flown)
    theirs = 1050.0 + 900.0 * ours[:, autopilots.PX4_FROM_OURS]
    pulses = np.column_stack([noise(flown, 2), theirs[:, ::-1]])
    frame = {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0, "MOT_PWM_MIN": 1050.0, "MOT_PWM_MAX": 1950.0}
    gimbal = {"SERVO1_FUNCTION": 7.0, "SERVO2_FUNCTION": 8.0}
    found = import_ardupilot(pulses, frame | gimbal | servos((6, 5, 4, 3)))
    dut = opened(found, tmp_path)
    np.testing.assert_allclose(dut.throttle, ours, atol=1e-9)
    assert dut.motors == tuple(f"ArduPilot motor {n}" for n in (3, 1, 4, 2))
    assert "motors are on the outputs 6, 5, 4, 3 (SERVOn_FUNCTION)" in found.shown


def test_a_gimbal_on_the_first_outputs_is_no_motor_unless_a_map_names_it(
    flown, import_ardupilot, tmp_path
):
    parameters = {"FRAME_CLASS": 1.0, **servos((1, 2, 3), 6)}
    pulses = 1000.0 + 1000.0 * autopilots.throttle(flown)
    with pytest.raises(LogError, match=r"no output drives a motor .* Name columns as throttle"):
        import_ardupilot(pulses, parameters)
    (tmp_path / "map.yaml").write_text("throttle: {columns: [RCOU/C4], unit: us}\n")
    own = load_map_file(tmp_path / "map.yaml")
    (dut,) = import_ardupilot(pulses, parameters, log_map=own).flights
    np.testing.assert_allclose(dut.throttle, autopilots.throttle(flown)[:, 3:], atol=1e-9)


@pytest.mark.parametrize("kind, order", [(1, [1, 3, 0, 2]), (14, [1, 2, 3, 0])])
def test_an_ardupilot_frame_states_where_its_motors_are(
    flown, import_ardupilot, tmp_path, kind, order
):
    ours = autopilots.throttle(flown)
    found = import_ardupilot(
        1000.0 + 1000.0 * ours[:, order], {"FRAME_CLASS": 1.0, "FRAME_TYPE": float(kind)}
    )
    np.testing.assert_allclose(opened(found, tmp_path).throttle, ours, atol=1e-9)


def thinned(stream: Stream, rate: float) -> Stream:
    keep = np.arange(0, len(stream), round(100.0 / rate))
    return Stream(stream.t[keep], {name: values[keep] for name, values in stream.columns.items()})


def escs(speed: np.ndarray, t: np.ndarray) -> dict[str, Stream]:
    return {f"ESC.{i}": Stream(t, {"RPM": column}) for i, column in enumerate(speed.T)}


@pytest.mark.parametrize("kind", ["throttle", "rotor_speed"])
def test_motors_seen_ten_times_a_second_tell_thrust_and_no_torque(flown, import_ardupilot, kind):
    ours = autopilots.throttle(flown)

    def slow(streams):
        outputs = streams.pop("RCOU")
        if kind == "throttle":
            return streams | {"RCOU": thinned(outputs, 10.0)}
        return streams | {
            n: thinned(s, 10.0) for n, s in escs(9000.0 * ours, flown.t + 1.0).items()
        }

    found = import_ardupilot(1000.0 + 1000.0 * ours, change=slow)
    (dut,) = found.flights
    assert (dut.input, dut.throttle.shape[1], dut.rotor) == ("normalised", 1, None)
    assert (
        f"{kind} at 10 Hz is slower than what turns the vehicle: its collective thrust "
        f"alone is taken"
    ) in " ".join(found.shown)
    lift = np.sum(ours**2, axis=1)
    theirs = np.interp(dut.t, flown.t, lift)
    assert np.corrcoef(dut.throttle[20:-20, 0] ** 2, theirs[20:-20])[0, 1] > 0.9


@pytest.mark.parametrize(
    ("told", "kind"),
    [
        ({"MAV_TYPE": 22.0}, "a VTOL (MAV_TYPE 22)"),
        ({"MAV_TYPE": 10.0}, "a rover (MAV_TYPE 10)"),
        ({"CA_AIRFRAME": 2.0}, "a VTOL (CA_AIRFRAME 2)"),
        ({"MAV_TYPE": 15.0}, "a tricopter (MAV_TYPE 15)"),
    ],
)
def test_what_is_no_px4_multicopter_is_refused_or_read_by_a_map(
    flown, import_px4, tmp_path, told, kind
):
    outputs = {"actuator_motors": autopilots.throttle(flown)}
    with pytest.raises(LogError) as error:
        import_px4(outputs, told)
    assert f"must be the log of a multicopter; it is that of {kind}. A map" in str(error.value)
    motors = [f"actuator_motors/control[{i}]" for i in range(4)]
    (tmp_path / "map.yaml").write_text(f"throttle: {{columns: {motors}, unit: '1'}}\n")
    dut = import_px4(outputs, told, log_map=load_map_file(tmp_path / "map.yaml"))
    assert dut.shown[0].startswith(f"no multicopter: {kind}; ")


@pytest.mark.parametrize(
    ("firmware", "told", "kind"),
    [
        ("ArduRover", {}, "a rover (ArduRover V4.5.7)"),
        ("APM:Plane", {}, "a plane (APM:Plane V4.5.7)"),
        ("ArduPlane", {"Q_ENABLE": 1.0}, "a VTOL: a plane (ArduPlane V4.5.7) with Q_ENABLE"),
        ("ArduCopter", {"FRAME_CLASS": 7.0}, "a tricopter (FRAME_CLASS 7)"),
    ],
)
def test_what_is_no_ardupilot_multicopter_is_refused(flown, import_ardupilot, firmware, told, kind):
    pulses = 1000.0 + 1000.0 * autopilots.throttle(flown)
    with pytest.raises(LogError) as error:
        import_ardupilot(pulses, told, firmware=firmware)
    assert f"must be the log of a multicopter; it is that of {kind}. A map" in str(error.value)


def test_an_x8_is_read_as_what_it_is(flown, import_ardupilot, import_px4):
    ours = np.tile(autopilots.throttle(flown), 2)
    said = "8 motors: their collective thrust alone is taken, torque is not told"
    dut = import_ardupilot(1000.0 + 1000.0 * ours, {"FRAME_CLASS": 4.0})
    assert dut.shown[0] == f"octaquad (X8), {said}"
    for word, angle in (("coaxial rotors, ", np.pi / 2), ("", np.pi / 4)):
        corners = {f"CA_ROTOR{n}_PX": np.cos(angle * n).round(6) for n in range(8)}
        corners |= {f"CA_ROTOR{n}_PY": np.sin(angle * n).round(6) for n in range(8)}
        dut = import_px4({"actuator_motors": ours}, {"CA_ROTOR_COUNT": 8.0} | corners)
        assert dut.shown[0] == f"{word}{said}"
