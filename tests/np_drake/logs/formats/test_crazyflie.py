"""Laws of Crazyflie micro-SD logs: what was written is read, and what the real flights obey."""

import struct
import zlib
from functools import partial

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.formats.crazyflie import CRAZYFLIE
from np_drake.logs.formats.format import Stream
from np_drake.logs.formats.known_formats import format_of
from np_drake.logs.importing.import_log import import_log
from tests.np_drake.logs.formats import crazyflie_writer
from tests.np_drake.logs.formats.made_files import read

STATE = [f"stateEstimate.{c}" for c in ("x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz")]
SENSORS = [f"{group}.{axis}" for group in ("gyro", "acc") for axis in "xyz"]
RPM = [f"rpm.m{i}" for i in (1, 2, 3, 4)]


@pytest.fixture(scope="module")
def made() -> dict[str, Stream]:
    """Return two streams of different rates and phases."""
    rng = np.random.default_rng(1)
    t = 12.0 + np.arange(400) * 0.002
    slow = t[::7] + 0.0005
    return {
        "fixedFrequency": Stream(
            t, {c: rng.standard_normal(len(t)) for c in ("stateEstimate.x", "gyro.z")}
        ),
        "estPose": Stream(slow, {"locSrv.x": rng.standard_normal(len(slow))}),
        "startup": Stream(t[:1] + 0.001, {}),
    }


everything = partial(read, CRAZYFLIE)


@pytest.mark.parametrize(("version", "resolution"), [(1, 1e-3), (2, 1e-6)])
def test_what_is_written_is_read(log, made, version, resolution):
    crazyflie_writer.write(
        log, made, version=version, kinds={"stateEstimate.x": "d", "gyro.z": "f", "locSrv.x": "d"}
    )
    dut = everything(log)
    assert format_of(log) is CRAZYFLIE
    assert dut.notes == ()
    for name, stream in made.items():
        assert dut.streams[name].t == pytest.approx(stream.t, abs=0.51 * resolution)  # [s], rounded
    x, z = (dut.streams["fixedFrequency"].columns[c] for c in ("stateEstimate.x", "gyro.z"))
    assert np.array_equal(x, made["fixedFrequency"].columns["stateEstimate.x"])
    assert z == pytest.approx(made["fixedFrequency"].columns["gyro.z"], rel=1e-7)  # a float32
    assert np.array_equal(
        dut.streams["estPose"].columns["locSrv.x"], made["estPose"].columns["locSrv.x"]
    )


EXTREMES = {"?": (0, 1), "e": (-2.0, 65504.0), "f": (-2.0, 2.0**127), "d": (-1e300, 1e-300)}
for letter, bits in zip("bhilq", (8, 16, 32, 32, 64), strict=True):
    top = 2 ** (min(bits, 53) - 1) - 1  # whole numbers that a float64 holds
    EXTREMES |= {letter: (-top, top), letter.upper(): (0, 2 * top + 1)}


@pytest.mark.parametrize("letter", EXTREMES)
def test_every_struct_type_keeps_its_value(log, letter):
    values = np.array([0.0, 1.0, *EXTREMES[letter]])
    crazyflie_writer.write(
        log,
        {"a": Stream(np.arange(4.0), {"v": values, "w": values})},
        kinds={"v": letter, "w": letter},
    )
    assert np.array_equal(everything(log).streams["a"].columns["v"], values)
    assert np.array_equal(everything(log).streams["a"].columns["w"], values)


def test_a_wrong_checksum_is_noted_and_the_values_are_kept(log, made):
    content = bytearray(crazyflie_writer.encode(made))
    content[-1] ^= 0xFF
    log.write_bytes(content)
    dut = everything(log)
    assert "checksum" in dut.notes[0]
    assert len(dut.streams["fixedFrequency"]) == 400


def test_of_a_log_that_was_cut_the_whole_records_are_kept(log, made):
    content = crazyflie_writer.encode(made)
    begin, record = len(crazyflie_writer.header(made)), struct.calcsize("<HQff")
    log.write_bytes(
        content[: begin + record + 10 + record + record // 2]
    )  # 'startup' has no variables
    dut = everything(log)
    assert len(dut.streams["fixedFrequency"]) + len(dut.streams["startup"]) + len(
        dut.streams["estPose"]
    ) in (2, 3)
    assert "cut" in dut.notes[0]
    log.write_bytes(content[:-4])
    assert len(everything(log).streams["fixedFrequency"]) == 400
    assert "cut" in everything(log).notes[0]


def test_what_follows_a_record_of_no_known_type_is_left_out(log, made):
    content = crazyflie_writer.encode({"fixedFrequency": made["fixedFrequency"]})
    record = struct.calcsize("<HQff")
    begin = len(content) - 4 - 400 * record
    place = begin + 100 * record
    log.write_bytes(content[:place] + b"\xee\xee" + content[place + 2 :])
    dut = everything(log)
    assert len(dut.streams["fixedFrequency"]) == 100
    assert f"byte {place}" in dut.notes[0]


def test_names_that_stand_twice_get_a_number(log):
    stream = Stream(np.zeros(1), {"a": np.ones(1)})
    content = crazyflie_writer.header({"e": stream}).replace(
        b"\x01\x00a(f)\0", b"\x03\x00a(f)\0a.1(f)\0a(f)\0"
    )
    content += struct.pack("<HQfff", crazyflie_writer.FIRST_ID, 0, 1, 2, 3)
    log.write_bytes(content + struct.pack("<I", zlib.crc32(content)))
    dut = everything(log).streams["e"].columns
    assert {name: float(v[0]) for name, v in dut.items()} == {"a": 1, "a.1": 2, "a.2": 3}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "must begin with the header"),
        (b"\xbc", "must begin with the header"),
        (struct.pack("<BHH", 0xBC, 3, 1), "version 1 or 2; got 3"),
        (struct.pack("<BHH", 0xBC, 2, 0), "must name an event type"),
        (struct.pack("<BHH", 0xBC, 2, 0xFFFF), "cut or damaged"),
        (struct.pack("<BHHH", 0xBC, 2, 1, 0) + b"e\0\xff\xff", "cut or damaged"),
        (struct.pack("<BHHH", 0xBC, 2, 1, 0) + b"e\0\1\0gyro.x(s)\0", "got 'gyro.x\\(s\\)'"),
        (struct.pack("<BHHH", 0xBC, 2, 1, 0) + b"e\0\1\0gyro.x\0", "got 'gyro.x'"),
        (struct.pack("<BHHH", 0xBC, 2, 1, 0) + b"\xff\0\0\0", "cut or damaged"),
        (struct.pack("<BHHH", 0xBC, 2, 2, 0) + b"e\0\0\0\0\0f\0\0\0", "event type 0 stands twice"),
    ],
)
def test_a_damaged_header_is_refused_in_one_line(log, content, said):
    log.write_bytes(content)
    with pytest.raises(LogError, match=said) as refused:
        CRAZYFLIE.contents(log)
    assert str(log) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_map_takes_the_firmwares_names():
    dut = CRAZYFLIE.default_map(
        {"fixedFrequency": (*STATE, *SENSORS, *RPM, "pm.vbatMV", "motor.m1")}
    )
    assert dut is not None
    assert dut.check() is dut
    assert dut.attitude.columns == [f"fixedFrequency/stateEstimate.q{a}" for a in "xyzw"]
    assert (dut.world, dut.body, dut.attitude.order, dut.command) == (
        "enu",
        "flu",
        "xyzw",
        "unknown",
    )
    assert (dut.rates.unit, dut.acceleration.unit, dut.acceleration.kind) == (
        "deg/s",
        "g",
        "specific_force",
    )
    assert (dut.rotor_speed.unit, dut.voltage.unit) == ("rpm", "mV")
    assert not dut.throttle


def test_the_map_takes_rotor_speed_before_thrust_and_throttle_beside():
    lee = ("ctrlLee.thrustSi", *(f"ctrlLee.torque{a}" for a in "xyz"))
    pwm = tuple(f"pwm.m{i}_pwm" for i in (1, 2, 3, 4))
    motor = tuple(f"motor.m{i}" for i in (1, 2, 3, 4))
    for inputs, names in [
        ((*RPM, *lee, *pwm, *motor), ["rotor_speed", "throttle"]),
        ((*RPM, *lee), ["rotor_speed"]),
        ((*lee, *pwm, *motor), ["thrust", "torque", "throttle"]),
        ((*pwm, *motor), ["throttle"]),
        (motor, ["throttle"]),
        ((), []),
    ]:
        dut = CRAZYFLIE.default_map({"a": (*STATE, *inputs)})
        assert dut is not None
        found = [
            name
            for name, _ in dut.sources()
            if name in ("rotor_speed", "thrust", "torque", "throttle")
        ]
        assert found == names


def test_without_attitude_or_motion_only_its_user_knows_the_map():
    attitude = tuple(name for name in STATE if ".q" in name)
    assert (
        CRAZYFLIE.default_map({"a": tuple(name for name in STATE if name not in attitude)}) is None
    )
    assert CRAZYFLIE.default_map({"a": attitude}) is None
    # as without a positioning system
    assert CRAZYFLIE.default_map({"a": (*attitude, *SENSORS)}).acceleration


def test_real_flights_agree_with_the_conventions_of_the_default_map(real_flights):
    flights = [p for kind in ("bare", "payload") for p in (real_flights / "imrc" / kind).iterdir()]
    for found in map(import_log, flights):
        assert found.sheet.content["conventions"].startswith("agree with the log in ")
        assert 3.4 < found.flights[0].voltage.min() < found.flights[0].voltage.max() < 4.3  # [V]


def test_rotor_speed_of_real_flights_carries_the_mass(real_flights):
    """k omega² over g, of the mean over slow flights, is the mass of vehicle and payload within 4
    %.
    """
    for name, mass in (("bare/eckart00", 0.0370), ("payload/eckart06", 0.0444)):
        (log,) = import_log(real_flights / "imrc" / name).flights
        lift = 3.704e-8 * np.sum(log.rotor**2, axis=1).mean()  # [N]; k of bare flights
        assert lift / 9.81 == pytest.approx(mass, rel=0.04)
