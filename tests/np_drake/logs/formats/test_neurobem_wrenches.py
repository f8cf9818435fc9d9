"""Which files of a folder are the flights of the estimation table, and what a CSV says of the
wrench.
"""

from pathlib import Path

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.formats.neurobem import (
    SOURCE_COLUMNS,
    TESTS,
    TRAINING,
    TRAINING_START,
    read_training,
    read_wrenches,
    table_files,
)

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
    assert (dut.frame, dut.total) == ("body", True)


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
