"""A simulated flight in every format, in the format's own conventions, is the flight again after an
import.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.logs.formats.format import Stream
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.log_map import load_map_file
from np_drake.vehicle import Vehicle

SINGLE = 1e-6  # resolution of a float32 of a few [m, m/s, 1, rad/s]
DOUBLE = 1e-9
ROS = """
format: ros
command: held_after
position: {columns: [/odom/pose.pose.position.x, /odom/pose.pose.position.y, /odom/pose.pose.position.z]}
velocity:
  columns: [/odom/twist.twist.linear.x, /odom/twist.twist.linear.y, /odom/twist.twist.linear.z]
  axes: body
attitude:
  columns: [/odom/pose.pose.orientation.x, /odom/pose.pose.orientation.y, /odom/pose.pose.orientation.z,
            /odom/pose.pose.orientation.w]
  order: xyzw
rates: {columns: [/imu/angular_velocity.x, /imu/angular_velocity.y, /imu/angular_velocity.z]}
acceleration: {columns: [/imu/linear_acceleration.x, /imu/linear_acceleration.y, /imu/linear_acceleration.z]}
thrust: {columns: [/wrench/wrench.force.z]}
torque: {columns: [/wrench/wrench.torque.x, /wrench/wrench.torque.y, /wrench/wrench.torque.z]}
"""  # noqa: E501
NED_CSV = """
world: ned
body: frd
command: held_after
time: {columns: [stamp], unit: us}
position: {columns: [x, y, z]}
velocity: {columns: [vx, vy, vz]}
attitude: {columns: [qx, qy, qz, qw], order: xyzw}
rates: {columns: [p, q, r], unit: deg/s}
acceleration: {columns: [ax, ay, az], unit: g}
thrust: {columns: [fz], scale: -1}
torque: {columns: [mx, my, mz]}
"""


@pytest.fixture(scope="module")
def flight(fly):
    return fly(seed=4, seconds=6.0, noise=1.0, vigour=1.5, attitude_noise=0.004)


@pytest.fixture(scope="module")
def specific(flight):
    """Return the reading of an accelerometer in FLU [m/s²]."""
    return attitude.rotate_back(flight.q, flight.a + [0.0, 0.0, 9.81])


@pytest.fixture(scope="module")
def throttle(flight):
    """Return the throttle of every rotor, a thrust of 24 N at 1."""
    return np.sqrt(np.maximum(flight.u @ np.linalg.inv(_mixer()).T, 0.0) / 12.0)


def _mixer():
    return Vehicle().mixer


def named(names, values):
    return dict(zip(names, np.asarray(values, float).T, strict=True))


def imported(path, text="", tmp_path=None):
    """Import through a map in YAML, or by the log's own names."""
    if not text:
        return import_log(path)
    assert len(text.strip().splitlines()) <= 20
    file = tmp_path / "map.yaml"
    file.write_text(text)
    return import_log(path, load_map_file(file).values)


def assert_same(found, log, tolerance, *, clock=1e-6, command=True, accelerations=True):
    """Compare array by array; `clock`: resolution of the times [s]."""
    (dut,) = found.flights
    assert len(dut) == len(log)
    assert np.allclose(dut.t, log.t - log.t[0], rtol=0, atol=clock)
    q = dut.q * np.sign(np.sum(dut.q * log.q, axis=1, keepdims=True))
    pairs = {"p": (dut.p, log.p), "v": (dut.v, log.v), "q": (q, log.q), "w": (dut.w, log.w)}
    if accelerations:
        pairs["a"] = (dut.a, log.a)
    if command:
        pairs["u"] = (dut.u, log.u)
    for name, (ours, theirs) in pairs.items():
        scale = max(1.0, float(np.abs(theirs).max()))
        assert np.allclose(ours, theirs, rtol=0, atol=tolerance * scale), name
    return dut


XYZ = "xyz"


def test_crazyflie(flight, specific, writer, tmp_path):
    estimate = named(
        [
            *(f"stateEstimate.{a}" for a in XYZ),
            *(f"stateEstimate.v{a}" for a in XYZ),
            *(f"stateEstimate.q{a}" for a in "wxyz"),
        ],
        np.column_stack([flight.p, flight.v, flight.q]),
    )
    sensors = named(
        [*(f"gyro.{a}" for a in XYZ), *(f"acc.{a}" for a in XYZ)],
        np.column_stack([np.rad2deg(flight.w), specific / 9.80665]),
    )
    control = named(["ctrlLee.thrustSi", *(f"ctrlLee.torque{a}" for a in XYZ)], flight.u)
    streams = {n: Stream(flight.t, c) for n, c in (("e", estimate), ("s", sensors), ("c", control))}
    writer("crazyflie").write(tmp_path / "log00", streams)
    assert_same(imported(tmp_path / "log00"), flight, SINGLE)


def ned(value):
    return value[:, [1, 0, 2]] * [1, 1, -1]


def frd(value):
    return value * [1, -1, -1]


def q_ned_frd(q):
    """Return w, x, y, z from FRD to NED."""
    half = np.sqrt(0.5)
    world, body = np.array([0, half, half, 0]), np.array([0, 1.0, 0, 0])
    return attitude.multiply(
        attitude.multiply(np.tile(world, (len(q), 1)), q), np.tile(body, (len(q), 1))
    )


def test_ulog(flight, throttle, autopilots, writer, tmp_path):
    pytest.importorskip("pyulog", reason="ULog needs pyulog")
    streams = autopilots.px4(flight, {"actuator_motors": throttle})
    writer("ulog").write(tmp_path / "log.ulg", streams)
    dut = assert_same(imported(tmp_path / "log.ulg"), flight, DOUBLE, command=False)
    assert dut.input == "normalised"
    assert np.allclose(dut.throttle, throttle, atol=1e-9)


def test_dataflash(flight, throttle, autopilots, writer, tmp_path):
    pytest.importorskip("pymavlink", reason="DataFlash needs pymavlink")
    streams = autopilots.ardupilot(flight, 1000 + 1000 * throttle)
    writer("dataflash").write(tmp_path / "log.bin", streams)
    dut = assert_same(imported(tmp_path / "log.bin"), flight, DOUBLE, command=False)
    assert np.allclose(dut.throttle, throttle, atol=1e-9)


def vectors(**quantities):
    """Return columns `name[i]` of whole numbers."""
    return {
        f"{name}[{i}]": np.round(v[:, i])
        for name, v in quantities.items()
        for i in range(v.shape[1])
    }


COUNT = 0.01  # of a centimetre in a second, the coarsest of its whole numbers


@pytest.mark.parametrize("turned", [False, True])
def test_blackbox_of_indiflight(flight, specific, throttle, writer, tmp_path, turned):
    rates, forces = np.rad2deg(10 * flight.w), specific / 9.80665 * 2048
    hover = np.zeros((len(flight), 4))
    # the IMU is learnt to be turned about y, 0.1 s after its turn of the flight before is forgotten
    if turned:
        turn = np.array([0.8, 0.0, 0.6, 0.0])
        rates, forces = (
            attitude.rotate(np.tile(turn, (len(flight), 1)), frd(v)) for v in (rates, forces)
        )
        hover[:] = 8127 * turn
    columns = vectors(
        pos=1000 * ned(flight.p),
        vel=100 * ned(flight.v),
        quat=8127 * q_ned_frd(flight.q),
        gyroADC=rates,
        accSmooth=forces,
        motor=158 + 1889 * throttle,
        omegaUnfiltered=2000 * throttle,
        **({"hoverAttitude": hover} if turned else {}),
    )
    options = {"step": round(1e6 * (flight.t[1] - flight.t[0])), "settings": INDIFLIGHT}
    writer("blackbox").write(tmp_path / "log.BFL", writer("blackbox").main_log(columns, **options))
    found = imported(tmp_path / "log.BFL")
    dut = assert_same(found, flight, COUNT, command=False)
    assert dut.name == "log"
    assert dut.input == "rotor_speed"
    assert np.allclose(dut.rotor, 2000 * throttle, atol=0.6)
    assert np.allclose(dut.throttle, throttle, atol=0.6 / 1889)
    assert found.sheet.rotors.source == "Betaflight, Quad X"


INDIFLIGHT = {
    "Firmware revision": "Indiflight 5.0.0 (norevision) STM32H743",
    "blackbox_high_resolution": "1",
}


@pytest.mark.parametrize("storage", ["mcap"])
def test_ros(flight, specific, writer, tmp_path, storage):
    pytest.importorskip("rosbags", reason="ROS bags need rosbags")
    pose = [f"pose.pose.position.{a}" for a in XYZ] + [f"pose.pose.orientation.{a}" for a in "wxyz"]
    odometry = named(
        [*pose, *(f"twist.twist.linear.{a}" for a in XYZ)],
        np.column_stack([flight.p, flight.q, attitude.rotate_back(flight.q, flight.v)]),
    )
    imu = named(
        [f"{n}.{a}" for n in ("angular_velocity", "linear_acceleration") for a in XYZ],
        np.column_stack([flight.w, specific]),
    )
    wrench = named(["wrench.force.z", *(f"wrench.torque.{a}" for a in XYZ)], flight.u)
    wrench["wrench.force.x"] = 0 * flight.t
    streams = {
        n: Stream(flight.t, c) for n, c in (("/odom", odometry), ("/imu", imu), ("/wrench", wrench))
    }
    path = tmp_path / f"bag.{storage}"
    writer("ros").write(path, streams)
    assert_same(imported(path, ROS, tmp_path), flight, 1e-8, clock=1e-6)


@pytest.mark.parametrize("suffix", ["tsv", "parquet"])
def test_a_table_in_ned_frd_by_its_map(flight, specific, writer, tmp_path, suffix):
    if suffix == "parquet":
        pytest.importorskip("pyarrow", reason="Parquet needs pyarrow")
    names = [
        *("x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz", "p", "q", "r", "ax", "ay", "az")
    ]
    values = [
        ned(flight.p),
        ned(flight.v),
        q_ned_frd(flight.q),
        np.rad2deg(frd(flight.w)),
        frd(specific) / 9.80665,
    ]
    columns = named(names, np.column_stack(values))
    columns |= named(
        ["fz", "mx", "my", "mz"], np.column_stack([-flight.u[:, 0], frd(flight.u[:, 1:])])
    )
    columns["stamp"] = 1e6 * flight.t
    path = tmp_path / f"flight.{suffix}"
    writer("table").write(
        path, {"table": Stream(0 * flight.t, columns)}, "\t" if suffix == "tsv" else ","
    )
    assert_same(imported(path, NED_CSV, tmp_path), flight, DOUBLE)


@pytest.mark.parametrize("kind", ["throttle", "collective", "thrust_only", "rotor_speed"])
def test_our_own_log_of_any_input_comes_back_without_a_map(flight, throttle, tmp_path, kind):
    rest = np.full((len(flight), 3), np.nan)
    log = {
        "throttle": dc.replace(flight, throttle=throttle, input="normalised"),
        "collective": dc.replace(
            flight, throttle=throttle.mean(axis=1)[:, None], input="normalised"
        ),
        "thrust_only": dc.replace(
            flight, u=np.column_stack([flight.u[:, 0], rest]), input="thrust_only"
        ),
        "rotor_speed": dc.replace(flight, rotor=800 * throttle, input="rotor_speed"),
    }[kind]
    write_log(log, tmp_path / "own.csv")
    (dut,) = imported(tmp_path / "own.csv").flights
    assert dut.input == log.input
    field = {"thrust_only": "u", "rotor_speed": "rotor"}.get(kind, "throttle")
    assert np.allclose(getattr(dut, field), getattr(log, field), rtol=1e-9, equal_nan=True)
