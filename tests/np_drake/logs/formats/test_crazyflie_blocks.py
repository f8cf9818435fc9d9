"""Laws of Crazyflie micro-SD logs of early firmware: what was written in blocks is read, also where
it is cut.
"""

import gzip
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake import attitude
from np_drake.logs.errors import LogError
from np_drake.logs.formats.crazyflie import CRAZYFLIE
from np_drake.logs.formats.format import no_progress
from np_drake.logs.formats.known_formats import format_of

NAMES = ("tick(I)", "stateEstimateZ.x(h)", "stateEstimateZ.quat(I)", "pm.vbatMV(H)")
RECORD = struct.Struct("<IhIH")
WANTED = ["stateEstimateZ.x", "pm.vbatMV", *(f"stateEstimateZ.q{a}" for a in "xyzw")]


def packed(q):
    """Return a quaternion x, y, z, w in 32 bits, as the firmware packs it."""
    largest = int(np.argmax(np.abs(q)))
    q = q * np.sign(q[largest])
    out = largest
    for i in (i for i in range(4) if i != largest):
        out = out << 10 | int(q[i] < 0) << 9 | round(abs(q[i]) / np.sqrt(0.5) * 511)
    return out


def encode(t, x, q, voltage, sizes=(4, 2, 7)):
    """Return the bytes of a log in blocks of these sizes in turn."""
    out = bytes([len(NAMES)]) + "".join(f"{name}," for name in NAMES).encode() + b"CRC0"
    ticks, k = np.round(1e6 * t).astype(np.int64) % 2**32, 0
    for count in np.resize(sizes, len(t)):
        rows = range(k, min(k + int(count), len(t)))
        out += bytes([len(rows)])
        out += (
            b"".join(
                RECORD.pack(int(ticks[i]), int(x[i]), packed(q[i]), int(voltage[i])) for i in rows
            )
            + b"CRC1"
        )
        k = rows.stop
        if k >= len(t):
            break
    return out


@pytest.fixture
def made():
    t = 0.01 + 0.01 * np.arange(200)
    q = np.random.default_rng(2).normal(size=(200, 4))
    return (
        t,
        np.arange(200) - 100,
        q / np.linalg.norm(q, axis=1, keepdims=True),
        3700 - np.arange(200),
    )


def read(path):
    return CRAZYFLIE.read(path, {"log": WANTED}, no_progress)


@pytest.mark.parametrize("suffix", ["", ".gz"])
def test_what_was_written_in_blocks_is_read(made, tmp_path, suffix):
    path = tmp_path / f"log00{suffix}"
    path.write_bytes(gzip.compress(encode(*made)) if suffix else encode(*made))
    assert format_of(path) is CRAZYFLIE
    assert set(WANTED) < set(CRAZYFLIE.contents(path)["log"])
    dut = read(path)
    t, x, _, voltage = made
    assert dut.notes == ()
    stream = dut.streams["log"]
    np.testing.assert_allclose(stream.t, t, atol=1e-9)
    assert np.array_equal(stream.columns["stateEstimateZ.x"], x)
    assert np.array_equal(stream.columns["pm.vbatMV"], voltage)


@given(st.integers(0, 2**31))
@settings(max_examples=50, deadline=None)
def test_a_packed_attitude_is_that_to_two_milliradians(tmp_path_factory, seed):
    q = np.random.default_rng(seed).normal(size=(1, 4))
    q /= np.linalg.norm(q)
    path = tmp_path_factory.mktemp("blocks") / "log00"
    path.write_bytes(encode(np.array([0.01]), np.zeros(1), q, np.ones(1)))
    columns = read(path).streams["log"].columns
    found = np.stack([columns[f"stateEstimateZ.q{a}"] for a in "wxyz"], axis=1)
    turn = attitude.rotation_vector(
        attitude.multiply(attitude.conjugate(found), np.roll(q, 1, axis=1))
    )
    assert np.linalg.norm(turn) < 5e-3


@pytest.mark.parametrize("left", [1, 5, 300])
def test_a_log_that_is_cut_is_read_up_to_there(made, tmp_path, left):
    (tmp_path / "log00").write_bytes(encode(*made)[:-left])
    dut = read(tmp_path / "log00")
    assert "the log is cut" in dut.notes[0]
    assert 160 < len(dut.streams["log"]) < 200


def test_a_time_that_is_damaged_ends_the_log(made, tmp_path):
    t = made[0].copy()
    t[150] += 2000.0
    (tmp_path / "log00").write_bytes(encode(t, *made[1:]))
    dut = read(tmp_path / "log00")
    assert "row 151: the time is damaged" in dut.notes[0]
    assert len(dut.streams["log"]) == 150


def test_a_counter_that_begins_anew_goes_on(made, tmp_path):
    t = made[0] + 2**32 / 1e6 - 1.0
    (tmp_path / "log00").write_bytes(encode(t, *made[1:]))
    np.testing.assert_allclose(np.diff(read(tmp_path / "log00").streams["log"].t), 0.01, atol=2e-6)


@pytest.mark.parametrize(
    "content", [b"\x04tick(I),x(", b"\x04tick(I),x(z),y(h),z(h),CRC0", b"\x01tick(I),CRC0"]
)
def test_a_header_or_log_without_records_is_refused(tmp_path, content):
    (tmp_path / "log00").write_bytes(content)
    with pytest.raises(LogError, match=r"header: |must hold at least one whole block"):
        CRAZYFLIE.read(tmp_path / "log00", {"log": []}, no_progress)
