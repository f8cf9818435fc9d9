"""An array on file takes no more memory than it has bytes, and no damage of it is a traceback."""

import contextlib
import struct
import tracemalloc

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.neurobem import read_neurobem_npy
from np_drake.logs.npy_file import read_array


def header(text: str, version=b"\x01\x00") -> bytes:
    line = text.ljust(117) + "\n"
    return b"\x93NUMPY" + version + struct.pack("<H", len(line)) + line.encode()


def described(shape: str, kind: str = "<f8") -> bytes:
    return header(f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}")


DAMAGES = {
    "empty": b"",
    "cut off": described("(9, 12)") + bytes(8),
    "announces terabytes": described("(1000000000000, 12)") + bytes(96),
    "announces gigabytes": described("(100000000, 12)") + bytes(96),
    "overflows": described(f"({10**30}, {10**30})") + bytes(96),
    "negative": described("(-1, 12)") + bytes(96),
    "a header that is no Python": header("{'descr': [('a','<f8')], 'fortran") + bytes(96),
    "a nested header": header("(" * 110) + bytes(96),
    "an object": described("(1,)", "|O") + b"\x80\x04\x95",
    "another version": described("(1, 12)").replace(b"\x01\x00", b"\x09\x00", 1) + bytes(96),
    "noise": b"\xff" * 300,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_array_is_refused_in_one_line(tmp_path, damage):
    (tmp_path / "a.npy").write_bytes(DAMAGES[damage])
    tracemalloc.start()
    with pytest.raises(LogError, match=r"a\.npy: must be a plain NumPy array") as found:
        read_array(tmp_path / "a.npy")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2e6  # [byte]
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("size", [None, 100, 3])
def test_an_archive_is_refused_whole_or_cut_off(tmp_path, size):
    np.savez(tmp_path / "a.npz", a=np.zeros((9, 12)))
    (tmp_path / "a.npy").write_bytes((tmp_path / "a.npz").read_bytes()[:size])
    with pytest.raises(LogError, match=r"it is an archive \(\.npz\)\. Save the array by itself"):
        read_neurobem_npy(tmp_path / "a.npy")


def test_no_flip_of_a_byte_is_more_than_a_refusal(tmp_path):
    draw = np.random.default_rng(0)
    np.save(tmp_path / "a.npy", draw.normal(size=(5, 12)))
    content = (tmp_path / "a.npy").read_bytes()
    for at in range(128):
        (tmp_path / "a.npy").write_bytes(content[:at] + bytes([draw.integers(256)]) + content[at + 1 :])
        with contextlib.suppress(LogError):
            read_array(tmp_path / "a.npy")


def test_a_whole_array_is_read_and_outlives_its_file(tmp_path):
    np.save(tmp_path / "a.npy", np.arange(24.0).reshape(2, 12))
    dut = read_array(tmp_path / "a.npy")
    (tmp_path / "a.npy").write_bytes(b"")
    np.testing.assert_array_equal(dut, np.arange(24.0).reshape(2, 12))
