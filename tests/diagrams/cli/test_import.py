"""Laws of `np-drake import`."""

import errno
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from diagrams.cli.main import run
from np_drake.logs.opening import open_flights
from np_drake.vehicle import Vehicle

T = 0.01 * np.arange(800)
MAP = """
time: {columns: [stamp], unit: ms}
position: {columns: [x, y, z]}
velocity: {columns: [vx, vy, vz]}
attitude: {columns: [qw, qx, qy, qz]}
rates: {columns: [p, q, r], unit: deg/s}
thrust: {columns: [lift]}
"""


def swaying(t: np.ndarray) -> dict[str, np.ndarray]:
    """A flight along y: it rolls by `roll`, and is accelerated by g tan(roll)."""
    roll, o = 0.3 * np.sin(2 * t), 0 * t
    vy = np.cumsum(-9.81 * np.tan(roll)) * 0.01
    return {
        "stamp": 1e3 * t,
        **{"x": o, "y": np.cumsum(vy) * 0.01, "z": 1 + o, "vx": o, "vy": vy, "vz": o},
        **{"qw": np.cos(roll / 2), "qx": np.sin(roll / 2), "qy": o, "qz": o},
        **{"p": np.degrees(0.6 * np.cos(2 * t)), "q": o, "r": o, "lift": 19.62 / np.cos(roll)},
    }


def write_table(path, columns: dict[str, np.ndarray]):
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")
    return path


@pytest.fixture
def table(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "map.yaml").write_text(MAP)
    return write_table(tmp_path / "flight.csv", swaying(T))


def test_a_table_is_imported_by_its_map_with_a_sheet_beside(table, tmp_path, capsys):
    assert (
        run(["import", "flight.csv", "--map", "map.yaml", "--out", "mine", "--json", "m.json"]) == 0
    )
    log = open_flights(tmp_path / "mine" / "flight.csv", vehicle=Vehicle())[0][0]
    assert (log.input, len(log)) == ("thrust_only", len(T))
    np.testing.assert_allclose(log.w[:, 0], 0.6 * np.cos(2 * T), atol=1e-9)
    sheet = yaml.safe_load((tmp_path / "mine" / "flight.import.yaml").read_text())
    assert sheet["source"] == "flight.csv"
    assert sheet["columns"]["rates"]["unit"] == "deg/s"
    assert json.loads((tmp_path / "m.json").read_text())["files"] == ["mine/flight.csv"]


def test_an_imported_log_keeps_the_clock_of_its_source(table, tmp_path, capsys):
    columns = swaying(T)
    write_table(table, {**columns, "stamp": columns["stamp"] + 123e3})
    assert run(["import", "flight.csv", "--map", "map.yaml", "--out", "mine"]) == 0
    (log,), _ = open_flights(tmp_path / "mine" / "flight.csv", vehicle=Vehicle())
    assert log.t[0] == 0.0
    assert log.start == pytest.approx(123.0)  # [s]


def test_nothing_that_is_there_is_overwritten(table, tmp_path, capsys):
    assert run(["import", "flight.csv", "--map", "map.yaml", "--out", "."]) == 2
    assert "must not be there" in capsys.readouterr().err
    np.testing.assert_allclose(np.loadtxt(table, delimiter=",", skiprows=1)[:, 0], 1e3 * T)
    assert not (tmp_path / "flight.import.yaml").exists()


def test_a_full_disk_is_no_fault_of_the_log(table, tmp_path, capsys, monkeypatch):
    def fills(path, content):
        path.touch()
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", fills)  # of the sheet, behind its flight
    assert run(["import", "flight.csv", "--map", "map.yaml", "--out", "mine"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("np-drake import: mine/flight.import.yaml: No space left on device (")
    assert "MB are free). Free some room" in error
    assert not (tmp_path / "mine").exists()


def test_good_logs_are_imported_beside_a_bad_one_which_is_named(table, tmp_path, capsys):
    (tmp_path / "broken.csv").write_text("a,b\n1,2\n")
    assert run(["import", "broken.csv", "flight.csv", "--map", "map.yaml", "--out", "mine"]) == 2
    assert (tmp_path / "mine" / "flight.csv").is_file()
    error = capsys.readouterr().err
    assert "broken.csv" in error
    assert "1 of 2 logs failed" in error


def test_a_wrong_convention_is_named_and_can_be_adopted(table, tmp_path, capsys):
    (tmp_path / "map.yaml").write_text(MAP.replace(", unit: deg/s", ""))
    assert run(["import", "flight.csv", "--map", "map.yaml", "--out", "mine"]) == 2
    assert "rates.unit: deg/s" in capsys.readouterr().err
    assert not list((tmp_path / "mine").glob("*.csv"))
    assert run(["import", "flight.csv", "--map", "map.yaml", "--out", "mine", "--adopt"]) == 0
    sheet = yaml.safe_load((tmp_path / "mine" / "flight.import.yaml").read_text())
    assert "adopted: rates.unit: deg/s" in sheet["conventions"]


def test_every_real_log_is_imported_without_a_map(real_flights, tmp_path, capsys):
    logs = [
        *sorted((real_flights / "imrc").glob("*/*")),
        *sorted((real_flights / "neural_fly").glob("*.csv.gz")),
        *sorted((real_flights / "ulog").glob("sample_px4*.ulg")),
    ]
    assert run(["import", *map(str, logs), "--out", str(tmp_path)]) == 0
    sheets = list(tmp_path.glob("*.import.yaml"))
    assert len(sheets) >= len(logs)
    vehicle = Vehicle(name="any", mass=1.0, max_rotor_thrust=100.0)
    for path in (
        p for p in tmp_path.glob("*.csv") if not p.name.startswith(("eckart", "figure8_", "hover_"))
    ):
        assert open_flights(path, vehicle=vehicle)[0][0].input == "normalised"
