"""Laws that the real flights obey once they are in our frames, what is refused, which files of a
folder are the flights of the estimation table, and what a CSV says of the wrench.
"""

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from np_drake import attitude, labels
from np_drake.logs.errors import LogError
from np_drake.logs.formats.neurobem import (
    RACE_TRACK,
    SOURCE_COLUMNS,
    TESTS,
    TRAINING,
    TRAINING_START,
    published_vehicle,
    read_array,
    read_training,
    read_wrenches,
    table_files,
)
from np_drake.logs.opening import open_flights

MELON = "merged_2021-02-23-11-41-38_seg_3"


@pytest.fixture(scope="module", params=[RACE_TRACK, MELON])
def agile(neurobem, request):
    return open_flights(neurobem / "csv" / f"{request.param}.csv")[0][0]


def test_rotor_speed_carries_the_weight_and_turns_as_the_vehicle_does(agile):
    """Collective thrust within 10 %; each torque of the mixer correlates with what was measured."""
    vehicle = published_vehicle()
    measured = labels.raw_labels(agile, vehicle)[:, 3:] + agile.u[:, 1:]
    thrust = vehicle.mass * np.sum(attitude.body_z(agile.q) * (agile.a + [0, 0, 9.81]), axis=1)
    assert np.sum(thrust * agile.u[:, 0]) / np.sum(agile.u[:, 0] ** 2) == pytest.approx(
        0.96, abs=0.04
    )
    for axis in range(3):
        assert np.corrcoef(measured[:, axis], agile.u[:, 1 + axis])[0, 1] > 0.15
    assert agile.input == "rotor_speed"


def test_the_array_is_the_csv_in_body_axes_with_the_total_wrench(neurobem):
    """f = 0.752 (acc - [0, 0, 9.8]) in body axes, tau = J al + w x J w: no residual."""
    array = read_wrenches(neurobem / "npy" / f"{RACE_TRACK}.npy")
    csv = neurobem / "csv" / f"{RACE_TRACK}.csv"
    log, J = open_flights(csv)[0][0], published_vehicle().J
    torque = log.al @ J + np.cross(log.w, log.w @ J)
    force = 0.752 * (attitude.rotate_back(log.q, log.a + [0, 0, 9.81]) - [0, 0, 9.8])
    np.testing.assert_allclose(array.chi[:, :3], force, atol=1e-5)  # seven digits in the file [N]
    np.testing.assert_allclose(array.chi[:, 3:], torque, atol=1e-5)  # [N·m]
    np.testing.assert_allclose(array.zeta[:, :3], attitude.rotate_back(log.q, log.v), atol=1e-5)
    assert (array.frame, array.step) == ("body", 0.0025)
    made = read_wrenches(csv)
    np.testing.assert_allclose(made.chi, array.chi, atol=1e-5)
    np.testing.assert_allclose(made.zeta, array.zeta, atol=1e-5)
    assert (made.name, made.frame, made.step) == (array.name, "body", 0.0025)


def test_a_pickled_array_is_never_loaded(tmp_path):
    np.save(tmp_path / "evil.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(LogError, match="pickled files are refused"):
        read_wrenches(tmp_path / "evil.npy")


@pytest.mark.parametrize("array", [np.zeros((5, 11)), np.zeros(12), np.full((5, 12), "a")])
def test_an_array_of_another_shape_is_refused(tmp_path, array):
    np.save(tmp_path / "odd.npy", array)
    with pytest.raises(LogError, match=r"odd\.npy"):
        read_wrenches(tmp_path / "odd.npy")


def test_a_truncated_or_non_finite_array_is_refused(tmp_path):
    data = np.zeros((30, 12))
    np.save(tmp_path / "cut.npy", data)
    (tmp_path / "cut.npy").write_bytes((tmp_path / "cut.npy").read_bytes()[:-100])
    data[4, 2] = np.nan
    np.save(tmp_path / "nan.npy", data)
    with pytest.raises(LogError, match="cut off"):
        read_wrenches(tmp_path / "cut.npy")
    with pytest.raises(LogError, match="column 3, row 5"):
        read_wrenches(tmp_path / "nan.npy")


def test_a_neurobem_file_without_a_column_is_refused(tmp_path):
    (tmp_path / "some.csv").write_text("t,ang acc x,ang acc y\n0,1,2\n")
    with pytest.raises(LogError, match="29 columns"):
        open_flights(tmp_path / "some.csv")[0][0]


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


def test_a_whole_array_is_read_and_outlives_its_file(tmp_path):
    np.save(tmp_path / "a.npy", np.arange(24.0).reshape(2, 12))
    dut = read_array(tmp_path / "a.npy")
    (tmp_path / "a.npy").write_bytes(b"")
    np.testing.assert_array_equal(dut, np.arange(24.0).reshape(2, 12))


STEMS = {name: stem for stem, name in TESTS.items()}


def made_csv(path: Path, rows: int, step: float = 0.0025) -> np.ndarray:
    """Write a level flight along x, and return its specific force less 9.8 m/s² up (rows, 3)."""
    n = np.arange(rows)
    acceleration = np.stack([np.sin(0.02 * n), np.cos(0.03 * n), 0.5 * np.sin(0.05 * n)], axis=1)
    values = dict.fromkeys(
        (name for names in SOURCE_COLUMNS.values() for name in names), np.zeros(rows)
    )
    values |= {
        "t": step * (1 + n),
        "quat w": np.ones(rows),
        "pos z": np.ones(rows),
        "vel x": 0.001 * n,
    }
    values |= {
        f"acc {axis}": acceleration[:, i] + [0.0, 0.0, 9.81][i] for i, axis in enumerate("xyz")
    }
    values |= {f"mot {i}": np.full(rows, 1100.0) for i in range(1, 5)}
    values |= {name: np.zeros(rows) for name in ("dmot 1", "dmot 2", "dmot 3", "dmot 4", "vbat")}
    names = ["t", *(f"ang acc {axis}" for axis in "xyz")]
    names += [name for name in values if name not in names]
    table = np.stack([values[name] for name in names], axis=1)
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="")
    return acceleration + [0.0, 0.0, 0.01]


def made_array(path: Path, rows: int = 40) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, np.arange(12.0 * rows).reshape(rows, 12))


def test_the_tables_flights_come_first_and_arrays_before_csvs(tmp_path):
    for name in ("ellipse", "race track 1"):
        made_array(tmp_path / "npy" / f"{STEMS[name]}.npy")
    made_array(tmp_path / "npy" / "merged_2021-01-01-00-00-00_seg_1.npy")
    made_array(tmp_path / "npy" / f"{TRAINING}.npy")
    for name in ("melon 1", "race track 1"):
        made_csv(tmp_path / "csv" / f"{STEMS[name]}.csv", 40)
    made_csv(
        tmp_path / "csv" / "merged_2021-01-01-00-00-00_seg_2.csv", 40
    )  # a transit, no flight of the table
    found = table_files(tmp_path)
    assert list(found) == ["race track 1", "melon 1", "ellipse", "2021-01-01-00-00-00_seg_1"]
    assert [path.suffix for path in found.values()] == [".npy", ".csv", ".npy", ".npy"]


def test_a_folder_without_flights_is_refused(tmp_path):
    made_array(tmp_path / "npy" / f"{TRAINING}.npy")
    with pytest.raises(
        FileNotFoundError, match="must hold flights of the NeuroBEM data set in npy/ or csv/"
    ):
        table_files(tmp_path)


def test_a_csv_says_mass_times_specific_force_less_gravity(tmp_path):
    expected = made_csv(tmp_path / "flight.csv", 60)
    dut = read_wrenches(tmp_path / "flight.csv")
    np.testing.assert_allclose(dut.chi, np.hstack([0.752 * expected, np.zeros((60, 3))]), atol=1e-9)
    np.testing.assert_allclose(dut.zeta[:, 0], 0.001 * np.arange(60), atol=1e-12)
    assert not dut.zeta[:, 1:].any()
    assert dut.frame == "body"


def test_a_csv_of_another_rate_is_refused(tmp_path):
    made_csv(tmp_path / "slow.csv", 60, step=0.006)
    with pytest.raises(LogError, match=r"slow\.csv: must have a row every 2\.5 ms"):
        read_wrenches(tmp_path / "slow.csv")


def test_the_training_flight_goes_on_where_its_csv_is_there(tmp_path):
    made_array(tmp_path / "npy" / f"{TRAINING}.npy", 40)
    assert len(read_training(tmp_path)) == 40
    expected = made_csv(tmp_path / "csv" / f"{TRAINING}.csv", TRAINING_START + 100)
    dut = read_training(tmp_path)
    np.testing.assert_allclose(dut.chi[:, :3], 0.752 * expected[TRAINING_START:], atol=1e-9)
