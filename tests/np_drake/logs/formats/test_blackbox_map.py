"""Laws of the map of blackbox logs: what is taken from which firmware, and what the real logs
hold.
"""

import gzip
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from np_drake import attitude
from np_drake.logs.errors import LogError
from np_drake.logs.formats.blackbox import BLACKBOX
from np_drake.logs.importing.import_log import Imported, import_log
from np_drake.vehicle.rotor_layout import FIRMWARE
from tests.np_drake.diagnosis.simulated_flights import fly
from tests.np_drake.logs.formats import blackbox_writer as writer

MOTORS = [f"motor[{i}]" for i in range(4)]
XYZ = range(3)


@pytest.fixture(scope="module")
def real_logs(real_flights) -> list[Path]:
    """Return the real logs of Indiflight."""
    found = sorted((real_flights / "indiflight").glob("*.BFL"))
    return found or pytest.skip("no logs in indiflight/ of NP_DRAKE_REAL")


@pytest.fixture(scope="module")
def imported(real_logs) -> list[Imported]:
    """Return what becomes of them by their own names."""
    return [import_log(path) for path in real_logs]


def contents(log, *names, **options):
    writer.write(log, writer.main_log({name: np.arange(40) % 7 for name in names}, **options))
    return BLACKBOX.contents(log)


@pytest.mark.parametrize(
    ("firmware", "motors", "kind"),
    [
        ("Rotorflight 4.3.0", 2, "a helicopter (Rotorflight 4.3.0)"),
        ("INAV 7.1.0", 1, "a vehicle of 1 motor (INAV 7.1.0)"),
        ("Betaflight 4.5.1", 4, ""),
    ],
)
def test_what_is_no_multicopter_is_named(log, firmware, motors, kind):
    settings = {"Firmware revision": firmware}
    assert contents(log, *MOTORS[:motors], settings=settings).other == kind
    packed = log.with_suffix(".bbl.gz")
    packed.write_bytes(gzip.compress(log.read_bytes()))
    assert BLACKBOX.recognises(packed, packed.read_bytes())
    assert BLACKBOX.contents(packed).other == kind
    packed.write_bytes(packed.read_bytes()[:-9])
    with pytest.raises(LogError, match="must be a whole gzip file"):
        BLACKBOX.contents(packed)


@pytest.mark.parametrize(("resolution", "scale"), [("0", 1.0), ("1", 0.1)])
def test_a_gyro_in_high_resolution_is_in_tenths(log, resolution, scale):
    names = [f"gyroADC[{i}]" for i in XYZ]
    found = contents(log, *names, settings={"blackbox_high_resolution": resolution})
    dut = BLACKBOX.default_map(found)
    assert dut is not None
    assert dut.rates.scale == pytest.approx(scale)
    assert (dut.rates.unit, dut.rates.body or dut.body) == ("deg/s", "flu")


@pytest.mark.parametrize(
    ("settings", "delay"),
    [
        ({"gyro_lpf1_static_hz": "100"}, 1 / (2 * np.pi * 100)),
        ({"gyro_lpf1_static_hz": "100", "gyro_lpf1_type": "1"}, np.sqrt(2) / (2 * np.pi * 100)),
        (
            {"gyro_lpf1_static_hz": "100", "gyro_lpf2_static_hz": "500"},
            (1 / 100 + 1 / 500) / (2 * np.pi),
        ),
        ({"gyro_lpf1_static_hz": "100", "gyro_lpf1_dyn_hz": "250,500"}, 0.0),
        ({"gyro_lpf1_static_hz": "0"}, 0.0),
    ],
)
def test_a_gyro_and_its_integral_are_late_by_its_filters(log, settings, delay):
    names = [f"{name}[{i}]" for name in ("gyroADC", "imuQuaternion") for i in XYZ]
    dut = BLACKBOX.default_map(contents(log, *names, settings=settings))
    assert dut is not None
    assert dut.rates.late == pytest.approx(delay)
    assert dut.attitude.late == dut.rates.late


def test_an_accelerometer_is_late_by_its_filter(log):
    found = contents(log, *(f"accSmooth[{i}]" for i in XYZ), settings={"acc_lpf_hz": "2500"})
    dut = BLACKBOX.default_map(found)
    assert dut is not None
    stage = 25 / np.sqrt(np.sqrt(2) - 1)  # [Hz], of two alike that together have 25 Hz
    assert dut.acceleration.late == pytest.approx(2 / (2 * np.pi * stage))


@pytest.mark.parametrize(
    ("every", "meaning"),
    [("1", "held_after"), ("1/1", "held_after"), ("4", "sampled"), ("1/2", "sampled")],
)
def test_a_command_is_sampled_where_not_every_loop_is_logged(log, every, meaning):
    dut = BLACKBOX.default_map(contents(log, *MOTORS, every=every))
    assert dut is not None
    assert dut.command == meaning


@pytest.mark.parametrize(("version", "scale"), [("4.0.0", 0.01), ("3.5.7", 0.1), ("3.0.1", None)])
def test_the_voltage_is_in_the_unit_of_its_version(log, version, scale):
    settings = {"Firmware revision": f"Betaflight {version} (abc) OMNIBUSF4"}
    dut = BLACKBOX.default_map(contents(log, "vbatLatest", settings=settings))
    assert dut is not None
    assert (dut.voltage.scale if dut.voltage else None) == scale


@pytest.mark.parametrize(("value", "props"), [("0", "in"), ("1", "out"), (None, "")])
def test_the_header_states_which_way_the_propellers_turn(log, value, props):
    settings = {} if value is None else {"yaw_motors_reversed": value}
    dut = BLACKBOX.motors(contents(log, *MOTORS, settings=settings)).layout
    assert dut is not None
    assert dut.props == props
    assert dut.positions == FIRMWARE["betaflight"].positions


def test_inav_tells_north_east_up_and_a_yaw_to_the_right(log):
    flown = fly(seed=3, seconds=4.0, noise=0.0, vigour=1.5)
    R_WB = Rotation.from_quat(np.roll(flown.q, -1, axis=1))
    yaw, pitch, roll = np.degrees(R_WB.as_euler("ZYX")).T
    force = R_WB.inv().apply(flown.a + [0.0, 0.0, 9.81]) / 9.80665
    columns = {
        "navPos": 100 * flown.p * [1, -1, 1],
        "navVel": 100 * flown.v * [1, -1, 1],
        "attitude": 10 * np.column_stack([roll, pitch, -yaw]),
        "gyroADC": np.degrees(flown.w),
        "accSmooth": 4096 * force,
        "motor": np.tile([1400.0, 1500.0, 1600.0, 1450.0], (len(flown), 1)),
        "vbat": np.full((len(flown), 1), 1610.0),
    }
    names = {
        name if values.shape[1] == 1 else f"{name}[{i}]": values[:, i]
        for name, values in columns.items()
        for i in range(values.shape[1])
    }
    settings = {
        "Firmware type": "INAV",
        "Firmware revision": "INAV 7.1.0 (abc) F405",
        "acc_1G": "4096",
        "motorOutput": "1000,2000",
    }
    step = round(1e6 * flown.step)
    writer.write(log, writer.main_log(names, settings=settings, step=step))
    (dut,) = import_log(log).flights
    assert np.abs(dut.p - flown.p).max() < 0.01  # whole centimetres
    assert np.abs(dut.w - flown.w).max() < 0.02  # whole degrees
    turned = attitude.rotation_vector(attitude.multiply(attitude.conjugate(flown.q), dut.q))
    assert np.abs(turned).max() < 0.003  # tenths of a degree
    assert np.mean(dut.throttle, axis=0) == pytest.approx([0.4, 0.5, 0.6, 0.45])
    assert dut.voltage[0] == pytest.approx(16.1)


def test_betaflight_without_an_accelerometer_says_what_to_log(log):
    rng = np.random.default_rng(1)
    names = [f"gyroADC[{i}]" for i in XYZ] + MOTORS
    values = {name: rng.integers(200, 1900, 300) for name in names}
    writer.write(log, writer.main_log(values))
    with pytest.raises(LogError, match=r"Betaflight logs no position.*blackbox_disable_acc"):
        import_log(log)


def test_a_turned_imu_is_told_from_where_it_is_learnt_on(log):
    rng = np.random.default_rng(3)
    count, forgets, learns = 300, 60, 150
    turn = np.array([0.8, 0.0, 0.6, 0.0])
    w = np.cumsum(rng.standard_normal((count, 3)), axis=0) * 0.05  # of the body [rad/s]
    q = np.array([[1.0, 0, 0, 0]])
    for row in w[:-1]:
        q = np.vstack(
            [q, attitude.multiply(q[-1:], attitude.from_rotation_vector(0.002 * row[None]))]
        )
    of_imu = attitude.multiply(q, attitude.conjugate(np.tile(turn, (count, 1))))
    rows = np.arange(count)[:, None]
    columns = {
        "quat": 8127 * np.where((rows >= forgets) & (rows < learns), of_imu, q),
        "hoverAttitude": 8127 * np.where(rows < learns, [1.0, 0, 0, 0], turn),
        "gyroADC": np.rad2deg(
            10 * np.where(rows < forgets, w, attitude.rotate(np.tile(turn, (count, 1)), w))
        ),
        "accSmooth": 0 * w,
    }
    names = {
        f"{name}[{i}]": values[:, i]
        for name, values in columns.items()
        for i in range(values.shape[1])
    }
    writer.write(log, writer.main_log(names))
    dut = BLACKBOX.read(log, {"body": list(BLACKBOX.contents(log)["body"])}, lambda share: None)
    body = dut.streams["body"].columns
    assert np.all(np.isnan(body["gyro[0]"][:forgets]))
    assert any("before the turn of the IMU is learnt" in note for note in dut.notes)
    for i in XYZ:
        assert np.radians(body[f"gyro[{i}]"] / 10)[forgets:] == pytest.approx(
            w[forgets:, i], abs=0.002
        )
    found = np.column_stack([body[f"quat[{i}]"] for i in range(4)])[forgets:]
    turned = attitude.rotation_vector(attitude.multiply(attitude.conjugate(q[forgets:]), found))
    assert np.abs(turned).max() < 0.001


def test_every_real_log_becomes_a_flight_of_its_conventions(imported):
    for found in imported:
        assert sum(len(flight) for flight in found.flights) > 3000
        assert all(flight.input == "rotor_speed" for flight in found.flights)
        assert not any("adopted" in line for line in found.shown)


def test_rotors_of_real_logs_turn_the_vehicle_in_betaflights_order(imported):
    for found in imported:
        flight = max(found.flights, key=len)
        change = np.gradient(flight.w, flight.t, axis=0)
        # Of rotors rear right, front right, rear left, front left; the reaction to their speed-up
        # turns about z.
        square, speed_up = flight.rotor**2, np.gradient(flight.rotor, flight.t, axis=0)
        pushes = (square @ [-1, -1, 1, 1], square @ [1, -1, 1, -1], speed_up @ [1, -1, -1, 1])
        for axis, push in enumerate(pushes):
            a, b = (np.convolve(x, np.ones(10) / 10, "valid") for x in (change[:, axis], push))
            assert np.corrcoef(a, b)[0, 1] > 0.5
