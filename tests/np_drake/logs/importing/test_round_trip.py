"""A simulated flight in every format, in the format's own conventions, is the flight again after an
import.
"""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.logs.formats.format import Stream
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.log_map import load_map_file
from tests.np_drake.logs.formats.made_files import writer
from tests.np_drake.logs.importing import autopilot_streams as autopilots

SINGLE = 1e-6  # resolution of a float32 of a few [m, m/s, 1, rad/s]
DOUBLE = 1e-9
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
throttle: {columns: [a, b, c, d]}
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
    return autopilots.throttle(flight)


def imported(path, text="", tmp_path=None):
    """Import through a map in YAML, or by the log's own names."""
    if not text:
        return import_log(path)
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


def test_crazyflie(flight, specific, throttle, tmp_path):
    estimate = autopilots.named(
        [
            *(f"stateEstimate.{a}" for a in XYZ),
            *(f"stateEstimate.v{a}" for a in XYZ),
            *(f"stateEstimate.q{a}" for a in "wxyz"),
        ],
        np.column_stack([flight.p, flight.v, flight.q]),
    )
    sensors = autopilots.named(
        [*(f"gyro.{a}" for a in XYZ), *(f"acc.{a}" for a in XYZ)],
        np.column_stack([np.rad2deg(flight.w), specific / 9.80665]),
    )
    control = autopilots.named(["ctrlLee.thrustSi", *(f"ctrlLee.torque{a}" for a in XYZ)], flight.u)
    control |= autopilots.named([f"pwm.m{n}_pwm" for n in (1, 2, 3, 4)], 65535 * throttle)
    streams = {n: Stream(flight.t, c) for n, c in (("e", estimate), ("s", sensors), ("c", control))}
    writer("crazyflie").write(tmp_path / "log00", streams)
    dut = assert_same(imported(tmp_path / "log00"), flight, SINGLE)
    assert dut.motors == ("Crazyflie m1", "Crazyflie m2", "Crazyflie m3", "Crazyflie m4")


def test_ulog(flight, throttle, tmp_path):
    pytest.importorskip("pyulog", reason="ULog needs pyulog")
    streams = autopilots.px4(flight, {"actuator_motors": throttle})
    writer("ulog").write(tmp_path / "log.ulg", streams)
    dut = assert_same(imported(tmp_path / "log.ulg"), flight, DOUBLE, command=False)
    assert dut.input == "normalised"
    assert np.allclose(dut.throttle, throttle, atol=1e-9)


def vectors(**quantities):
    """Return columns `name[i]` of whole numbers."""
    return {
        f"{name}[{i}]": np.round(v[:, i])
        for name, v in quantities.items()
        for i in range(v.shape[1])
    }


COUNT = 0.01  # of a centimetre in a second, the coarsest of its whole numbers


def test_blackbox_of_indiflight(flight, specific, throttle, tmp_path):
    columns = vectors(
        pos=1000 * autopilots.ned(flight.p),
        vel=100 * autopilots.ned(flight.v),
        quat=8127 * autopilots.q_ned_frd(flight.q),
        gyroADC=np.rad2deg(10 * flight.w),
        accSmooth=specific / 9.80665 * 2048,
        motor=158 + 1889 * throttle,
        omegaUnfiltered=2000 * throttle,
    )
    options = {"step": round(1e6 * (flight.t[1] - flight.t[0])), "settings": INDIFLIGHT}
    writer("blackbox").write(tmp_path / "log.BFL", writer("blackbox").main_log(columns, **options))
    found = imported(tmp_path / "log.BFL")
    dut = assert_same(found, flight, COUNT, command=False)
    assert (dut.name, dut.input, dut.motors[2]) == ("log", "rotor_speed", "Indiflight motor 3")
    assert np.allclose(dut.rotor, 2000 * throttle, atol=0.6)
    assert np.allclose(dut.throttle, throttle, atol=0.6 / 1889)
    assert found.sheet.rotors.source == "Betaflight, Quad X"


INDIFLIGHT = {
    "Firmware revision": "Indiflight 5.0.0 (norevision) STM32H743",
    "blackbox_high_resolution": "1",
}


@pytest.mark.parametrize("suffix", ["tsv", "parquet"])
def test_a_table_in_ned_frd_by_its_map(flight, specific, throttle, tmp_path, suffix):
    if suffix == "parquet":
        pytest.importorskip("pyarrow", reason="Parquet needs pyarrow")
    names = [
        *("x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz", "p", "q", "r", "ax", "ay", "az")
    ]
    values = [
        autopilots.ned(flight.p),
        autopilots.ned(flight.v),
        autopilots.q_ned_frd(flight.q),
        np.rad2deg(autopilots.frd(flight.w)),
        autopilots.frd(specific) / 9.80665,
    ]
    columns = autopilots.named(names, np.column_stack(values))
    columns |= autopilots.named(
        ["fz", "mx", "my", "mz"],
        np.column_stack([-flight.u[:, 0], autopilots.frd(flight.u[:, 1:])]),
    )
    columns["stamp"] = 1e6 * flight.t
    columns |= autopilots.named(["a", "b", "c", "d"], throttle)
    path = tmp_path / f"flight.{suffix}"
    writer("table").write(
        path, {"table": Stream(0 * flight.t, columns)}, "\t" if suffix == "tsv" else ","
    )
    dut = assert_same(imported(path, NED_CSV, tmp_path), flight, DOUBLE)
    assert dut.motors == ("column a", "column b", "column c", "column d")
