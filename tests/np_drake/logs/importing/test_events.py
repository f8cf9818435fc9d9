"""Laws of what a log says of itself: it is read, said with its time, and ends a flight where it
must.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.doctor.flight_facts import law_findings
from np_drake.finding import Kind
from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Stream
from np_drake.logs.formats.log_file import read, write_log
from np_drake.logs.import_sheet import sheet_path, write_sheet
from np_drake.logs.importing.signals import Signal, coarse_tick, stopped_rotor
from tests.np_drake.logs.importing import autopilot_streams as autopilots

HOVER = 5000.0  # [rpm]


def speeds(flown, autopilots) -> np.ndarray:
    """Return the readings of four speed controllers (n, 4) [rpm]."""
    return 8000.0 * autopilots.throttle(flown)


def px4(import_px4, outputs, beside=None, **options):
    """Return the import of a flight with further streams beside it."""
    return import_px4(outputs, change=lambda streams: streams | (beside or {}), **options)


def turning(streams, after: float) -> dict[str, Stream]:
    """Return the streams of a vehicle that spins from a time on [s]."""
    rates = streams["vehicle_angular_velocity"]
    columns = {c: v + 9.0 * (rates.t > after) for c, v in rates.columns.items()}
    return streams | {"vehicle_angular_velocity": dc.replace(rates, columns=columns)}


@pytest.mark.parametrize("every", [1, 20])
def test_the_flight_before_a_rotor_stops_is_a_flight(flown, import_px4, every):
    told = speeds(flown, autopilots)
    told[flown.t >= 6.0, 2] = 0.0
    t = flown.t[::every] + 1.0
    escs = Stream(t, {f"esc[{i}].esc_rpm": told[::every, i] for i in range(4)})
    found = import_px4(
        {"actuator_motors": autopilots.throttle(flown)},
        change=lambda streams: turning(streams | {"esc_status": escs}, 7.0),
    )
    (dut,) = found.flights
    assert 6.0 - 0.02 * every < dut.t[-1] < 6.0
    stops = [line for line in found.shown if line.startswith("PX4 motor 3 stops at ")]
    assert len(stops) == 1
    assert float(stops[0].split()[5]) == pytest.approx(dut.t[-1], abs=0.02)
    assert "what comes after it is left out" in stops[0]


def test_a_rotor_told_no_more_while_the_vehicle_flies_on_has_not_stopped(fly, import_px4):
    calm = fly(seed=5, seconds=8.0, noise=1.0, vigour=0.5, attitude_noise=0.003)
    assert np.abs(calm.w).max() < 3.0
    told = speeds(calm, autopilots)
    told[calm.t >= 6.0, 2] = 0.0
    found = import_px4({}, change=lambda streams: autopilots.px4(calm, {"esc_status": told}))
    assert any("the speed of PX4 motor 3 is told no more" in line for line in found.shown)


def test_rotors_that_stop_together_land_and_one_alone_does_not():
    t = 0.01 * np.arange(300)
    own = np.full((300, 4), HOVER)
    own[250:] = 0.0
    assert stopped_rotor(Signal(t, own)) is None
    own[150:200, 1] = 0.0
    assert stopped_rotor(Signal(t, own)) is None
    own[220:, 3] = 0.0
    assert stopped_rotor(Signal(t, own)) == (pytest.approx(2.19), 4)


def test_clipping_that_a_log_counts_is_named_and_not_called_noise(flown, import_px4, tmp_path):
    def clipped(streams):
        imu = streams["sensor_combined"]
        low = imu.columns["accelerometer_m_s2[2]"] < -9.0
        force = np.maximum(imu.columns["accelerometer_m_s2[2]"], -9.0)
        told = {"accelerometer_m_s2[2]": force, "accelerometer_clipping": 4.0 * low}
        return streams | {"sensor_combined": dc.replace(imu, columns={**imu.columns, **told})}

    outputs = {"actuator_motors": autopilots.throttle(flown)}
    found = import_px4(outputs, change=clipped)
    said = "the log says: the accelerometer clips along body z: vertical force is unreliable"
    assert said in found.shown
    path = tmp_path / "flight.csv"
    write_log(found.flights[0], path)
    write_sheet(found.sheet, path)
    sheet = sheet_path(path).read_text()
    for text in (sheet, sheet.replace("kinds:\n- clipping\n", "")):  # as older ones were
        sheet_path(path).write_text(text)
        (dut,) = read(path)
        assert [(str(f), f.kind) for f in dut.findings] == [(said, Kind.CLIPPING)]
    assert not any("noise or drift" in finding.text for finding in law_findings(dut))
    whole = import_px4(outputs)
    assert not any("clips" in line for line in whole.shown)


@pytest.mark.parametrize("counted, clips", [(30.0, False), (300.0, True)])
def test_counters_of_clips_and_vibration_are_read(flown, import_px4, counted, clips):
    t = flown.t + 1.0
    counters = {f"accel_clipping[{i}]": 0.0 * t for i in range(3)}
    counters["accel_clipping[0]"] = np.linspace(7.0, 7.0 + counted, len(t))
    counters["accel_vibration_metric"] = np.full(len(t), 12.0)
    beside = {"vehicle_imu_status": Stream(t, counters)}
    found = px4(import_px4, {"actuator_motors": autopilots.throttle(flown)}, beside)
    assert any("clips along body x: lateral" in line for line in found.shown) == clips
    assert "the log says: the IMU shakes by more than 9.81 m/s2 (accel_vibration_metric)" in (
        found.shown
    )


def test_events_of_a_log_are_said_with_their_times(flown, import_px4):
    t = flown.t + 1.0
    beside = {
        "battery_status": Stream(
            t, {"voltage_v": 0 * t, "warning": 1.0 * (flown.t >= 3.0) + (flown.t >= 5.0)}
        ),
        "vehicle_status": Stream(t, {"nav_state": 3.0 + 2.0 * (flown.t >= 4.0)}),
        "failure_detector_status": Stream(t + 12.0, {"fd_roll": 1.0 * (flown.t > 1.0)}),  # after it
    }
    found = px4(import_px4, {"actuator_motors": autopilots.throttle(flown)}, beside)
    assert found.shown[0] == (
        "the log says: battery low at 3.00 s; mode return at 4.00 s; battery critical at 5.00 s"
    )


@pytest.mark.parametrize("fallen, left", [(1.0, None), (0.7, None), (0.3, 9.0), (0.0, 9.0)])
def test_a_voltage_on_which_nothing_flies_is_left_out(flown, import_px4, fallen, left):
    volts = np.linspace(16.0, 9.0, len(flown))  # a brown-out
    noise = 0.13 * np.random.default_rng(1).random(len(flown))
    read = np.where(flown.t > (1 - fallen) * 8.0 + 0.001, noise, volts)
    battery = {"battery_status": Stream(flown.t + 1.0, {"voltage_v": read})}
    found = px4(import_px4, {"actuator_motors": autopilots.throttle(flown)}, battery)
    (dut,) = found.flights
    assert len(dut) == len(flown)
    told = [note for note in dut.notes if note.startswith("voltage: ")]
    assert len(told) == (fallen > 0)
    if left is None:
        assert dut.voltage is None
        assert "all left out" in told[0]
    else:
        assert dut.voltage.min() == pytest.approx(16.0 - 7.0 * (1 - fallen), abs=0.05)


@pytest.mark.parametrize("idle", [0.0, 0.05, 0.1])
def test_a_vehicle_that_is_carried_while_its_motors_rest_is_no_flight(
    flown, import_px4, import_ardupilot, idle
):
    told = "no flight: the motors do not carry the vehicle"
    rest = np.full((len(flown), 4), idle)
    speed = 1000.0 + 5.0 * np.random.default_rng(0).standard_normal(rest.shape)
    for outputs in ({}, {"esc_status": speed}):
        with pytest.raises(LogError, match=f"{told}; no column of actuator_motors ever changes"):
            import_px4({"actuator_motors": rest, **outputs}, autopilots.PX4_CORNERS)
    rest[flown.t < 0.5] = 0.0  # not armed yet
    found = import_ardupilot(1000.0 + 1000.0 * rest)
    assert f"{told}; nothing can be identified" in found.shown
    assert any(told in str(f) and f.kind is Kind.NO_FLIGHT for f in law_findings(found.flights[0]))
    flies = import_px4({"actuator_motors": autopilots.throttle(flown), "actuator_outputs": rest})
    assert not any("no flight" in line for line in flies.shown)


def test_errors_and_counters_of_ardupilot_are_read(flown, import_ardupilot):
    t = flown.t + 1.0
    beside = {
        "ERR": Stream(
            np.array([4.0, 5.0]), {"Subsys": np.array([25.0, 25]), "ECode": np.array([1.0, 0.0])}
        ),
        "VIBE.0": Stream(
            t,
            {
                **{f"Vibe{axis}": np.full(len(t), 35.0) for axis in "XYZ"},
                "Clip": np.linspace(0.0, 200.0, len(t)),
            },
        ),
    }
    pulses = 1000.0 + 1000.0 * autopilots.throttle(flown)
    found = import_ardupilot(pulses, change=lambda streams: streams | beside)
    assert "the log says: thrust loss check at 3.00 s" in found.shown
    assert any("clips along body x, y, z: vertical force" in line for line in found.shown)
    assert any("shakes by more than 30 m/s2 (VIBE)" in line for line in found.shown)


def test_an_accelerometer_that_aliases_is_left_out_and_the_rest_flies(flown, import_px4):
    def shaken(streams):
        imu = streams["sensor_combined"]
        noise = 8.0 * np.random.default_rng(1).standard_normal((3, len(imu.t)))
        columns = {c: v + n for (c, v), n in zip(imu.columns.items(), noise, strict=True)}
        slow = Stream(imu.t[::10], {c: v[::10] for c, v in columns.items()})
        return streams | {"sensor_combined": slow}

    found = import_px4({"actuator_motors": autopilots.throttle(flown)}, change=shaken)
    (dut,) = found.flights
    assert dut.a is None
    assert any(line.startswith("acceleration at 10 Hz is slower") for line in found.shown)
    np.testing.assert_allclose(dut.v, flown.v, atol=1e-6)


def test_motors_are_those_that_lift_and_not_a_gimbal(flown, import_px4):
    ours = autopilots.throttle(flown)
    gimbal = 1500.0 + 80.0 * np.sin(np.outer(flown.t, [1.0, 1.3, 1.7, 2.1]))
    functions = {f"PWM_AUX_FUNC{i + 1}": 101 + i for i in range(4)}
    limits = {
        f"PWM_AUX_{end}{n}": us for n in range(1, 5) for end, us in (("MIN", 1000), ("MAX", 2000))
    }
    armed = 1500.0 + 100.0 * np.outer(flown.t > 0.1, [1.0, 1.0])
    moving = np.column_stack([1000.0 + 1000.0 * ours, armed])
    thrust = Stream(flown.t + 1.0, {f"xyz[{i}]": -ours.mean(axis=1) * (i == 2) for i in range(3)})
    for parameters in (functions | limits, {"PWM_MIN": 1000, "PWM_MAX": 2000}):
        found = px4(
            import_px4,
            {"actuator_outputs": gimbal, "actuator_outputs.1": moving},
            {"vehicle_thrust_setpoint": thrust},
            parameters=parameters,
        )
        assert found.sheet.content["columns"]["throttle"]["from"] == [
            f"actuator_outputs.1/output[{i}]" for i in range(4)
        ]


def test_ticks_longer_than_the_samples_are_seen_by_their_repeats(flown, import_px4):
    tick = 0.015625
    t = tick * np.floor(np.arange(800) * 0.01 / tick)
    repeats = int(np.sum(np.diff(t) == 0))
    assert coarse_tick(np.unique(t), repeats) == pytest.approx(tick)
    assert coarse_tick(np.unique(t)) == 0.0

    def coarse(streams):
        return {n: dc.replace(s, t=tick * np.floor(s.t / tick)) for n, s in streams.items()}

    found = import_px4({"actuator_motors": autopilots.throttle(flown)}, change=coarse)
    assert found.sheet.timing >= tick / np.sqrt(12) - 1e-9
    assert any(
        line.startswith("the clock runs in ticks of 15.6 ms")
        for line in map(str, found.sheet.findings)
    )
