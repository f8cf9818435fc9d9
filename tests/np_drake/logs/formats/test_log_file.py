"""Laws of flight logs as files."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn

from np_drake.logs.errors import LogError
from np_drake.logs.formats import parquet_file, text_table
from np_drake.logs.formats.log_file import SUFFIXES, write_log
from np_drake.logs.formats.log_file import read as read_flights
from np_drake.logs.opening import open_flights
from np_drake.vehicle import Vehicle

ARRAYS = ("t", "p", "q", "v", "w", "u", "a", "al", "rotor")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_was_written_is_read_back(flight, tmp_path, suffix):
    if suffix == ".parquet":
        pytest.importorskip("pyarrow", reason="Parquet needs pyarrow")
    flight = dc.replace(flight, bridged=(flight.t > 2.0) & (flight.t < 2.3))
    write_log(flight, tmp_path / f"made{suffix}")
    dut = open_flights(tmp_path / f"made{suffix}", Vehicle())[0][0]
    for name in ARRAYS:
        np.testing.assert_allclose(
            getattr(dut, name), getattr(flight, name), rtol=0, atol=1e-15
        )  # one norm
    np.testing.assert_array_equal(dut.bridged, flight.bridged)
    assert (dut.name, dut.input, dut.notes) == ("made", "command", [])


@given(stn.arrays(float, st.tuples(st.integers(1, 6), st.just(2)), elements=st.floats()))
def test_every_number_survives_a_csv_bit_for_bit(tmp_path_factory, values):
    path = tmp_path_factory.mktemp("csv") / "any.csv"
    text_table.write_csv(path, {"a": values[:, 0], "b": values[:, 1]})
    dut = text_table.read_csv(path)
    assert not dut.unreadable
    np.testing.assert_array_equal(dut.array(("a", "b")), values)


@pytest.mark.parametrize("field", ["a", "al", "rotor"])
def test_optional_columns_may_be_missing_or_empty(flight, tmp_path, field):
    empty = dc.replace(flight, **{field: np.full_like(getattr(flight, field), np.nan)})
    for log in (dc.replace(flight, **{field: None}), empty):
        write_log(log, tmp_path / "made.csv")
        assert getattr(read_flights(tmp_path / "made.csv")[0], field) is None


def test_columns_may_stand_in_any_order_with_blanks_and_strangers(flight, tmp_path):
    write_log(flight, tmp_path / "made.csv")
    rows = [line.split(",") for line in (tmp_path / "made.csv").read_text().splitlines()]
    text = "\n".join(", ".join([*reversed(row), "1"]) for row in rows).replace("t, 1", "t, vbat", 1)
    (tmp_path / "other.csv").write_text("\ufeff" + text + "\n\n", encoding="utf-8")
    dut = read_flights(tmp_path / "other.csv")[0]
    np.testing.assert_array_equal(dut.v, flight.v)
    assert dut.notes == ["columns not used: vbat"]


def test_without_a_command_thrust_comes_from_rotor_speed(flight, tmp_path):
    vehicle = Vehicle()
    write_log(dc.replace(flight, input="rotor_speed"), tmp_path / "made.csv")
    dut = open_flights(tmp_path / "made.csv", vehicle)[0][0]
    thrust = vehicle.thrust_coefficient * np.sum(flight.rotor**2, axis=1)
    np.testing.assert_allclose(dut.u[:, 0], thrust, rtol=1e-12)
    assert dut.input == "rotor_speed"
    assert any("rotor_speed" in note for note in dut.notes)


def test_zeros_of_an_esc_in_flight_are_filled_in_and_do_not_count(flight, tmp_path):
    rotor = np.full((len(flight), 4), 800.0)
    rotor[20:22, 0] = rotor[50:80, 2] = 0.0
    write_log(dc.replace(flight, rotor=rotor, input="rotor_speed"), tmp_path / "made.csv")
    dut = read_flights(tmp_path / "made.csv")[0]
    np.testing.assert_array_equal(dut.rotor, 800.0)
    np.testing.assert_array_equal(np.flatnonzero(dut.in_gap), [20, 21, *range(50, 80)])
    assert dut.notes[-1].endswith("32 rows filled in")


def test_no_command_and_no_way_to_one_is_refused(flight, tmp_path):
    write_log(dc.replace(flight, input="rotor_speed"), tmp_path / "made.csv")
    table = text_table.read_csv(tmp_path / "made.csv").columns
    kept = {name: column for name, column in table.items() if "rotor" not in name}
    text_table.write_csv(tmp_path / "made.csv", kept)
    with pytest.raises(LogError, match=r"thrust.*rotor1"):
        read_flights(tmp_path / "made.csv")


def test_a_rotor_log_without_rotor_speed_cannot_be_written(flight, tmp_path):
    with pytest.raises(LogError, match="rotor speed"):
        write_log(dc.replace(flight, input="rotor_speed", rotor=None), tmp_path / "made.csv")


def test_an_unknown_suffix_is_refused(flight, tmp_path):
    with pytest.raises(LogError, match=r"\.csv, \.csv\.gz, \.parquet"):
        write_log(flight, tmp_path / "made.txt")


def test_parquet_without_pyarrow_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(LogError, match=r"pip install 'np_drake\[parquet\]'"):
        parquet_file.read_parquet(tmp_path / "made.parquet")
