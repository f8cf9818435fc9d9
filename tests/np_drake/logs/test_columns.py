"""Bad input gets one line with its place and remedy; gaps are bridged, or split a flight."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.diagnosis.doctor.flight_facts import bridged_rows
from np_drake.logs.columns import LONGEST_GAP as LONGEST
from np_drake.logs.columns import Table, bridge_gaps, disassemble, present_fields, split_at_gaps
from np_drake.logs.errors import LogError
from np_drake.logs.formats.log_file import read as read_flights
from np_drake.logs.formats.text_table import write_csv
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.laws import check_units
from np_drake.logs.opening import open_flights
from np_drake.vehicle import Vehicle


@pytest.fixture
def columns(flight):
    """The file's columns, to be spoilt."""
    return {name: value.copy() for name, value in disassemble(flight).items()}


def set_cell(column, row, value):
    return lambda c: c[column].__setitem__(row, value)


def remove(name):
    return lambda c: c.pop(name)


def scale(names, factor):
    return lambda c: [c.__setitem__(name, c[name] * factor) for name in names.split()]


def cut(n):
    return lambda c: c.update({name: value[:n] for name, value in c.items()})


def leave_out(start, stop):
    return lambda c: c.update(
        {name: np.delete(value, slice(start, stop)) for name, value in c.items()}
    )


def stretch_quaternion(row, factor):
    return lambda c: [
        c[name].__setitem__(row, c[name][row] * factor) for name in ("qw", "qx", "qy", "qz")
    ]


def renamed(names):
    """The quaternion's columns hold these ones."""
    return lambda c: c.update(
        dict(zip(("qw", "qx", "qy", "qz"), [c[n].copy() for n in names.split()], strict=True))
    )


FAULTS = {  # spoil the columns: (how, what the message must say)
    "missing column": (remove("vx"), r"made\.csv, column vx: is missing"),
    "part of a group": (remove("alz"), r"column alz: is missing"),
    "NaN": (set_cell("vy", 56, np.nan), r"made\.csv, column vy, row 57 \(line 58\): .*finite"),
    "time stands": (set_cell("t", 10, 0.09), r"column t, row 11 \(line 12\): time must increase"),
    "quaternion norm": (set_cell("qw", 5, 0.5), r"column qw, row 6 .*norm"),
    "quaternion x, y, z, w": (renamed("qx qy qz qw"), r"column qw: .*order x, y, z, w"),
    "quaternion from W to body": (scale("qx qy qz", -1), r"column qw: .*from W to body"),
    "milliseconds": (scale("t", 1000), r"column t: .*in seconds"),
    "millimetres": (scale("px py pz", 1000), r"column px: position.*SI units"),
    "degrees per second": (scale("wx wy wz", 57.3), r"column qw: attitude.*SI units"),
    "accelerations in g": (scale("ax ay az", 1 / 9.81), r"column vx: velocity.*SI units"),
    "rpm": (scale("rotor1 rotor2 rotor3 rotor4", 9.55), r"column rotor1: .*rpm"),
    "velocity turned about": (scale("vx vy vz", -1), r"column vx: .*of position.*opposite way"),
    "one velocity turned about": (scale("vy", -1), r"column vy: .*Turn its sign, or that of py"),
    "accelerations turned about": (scale("ax ay az", -1), r"column ax: .*the rate of velocity"),
    "angular accelerations turned": (scale("alx", -1), r"column alx: .*the rate of body rates"),
    "thrust downwards": (scale("thrust", -1), r"column thrust: .*upwards.*Turn the sign of thrust"),
    "gravity left in": (lambda c: c["az"].__iadd__(9.81), r"column az: .*without gravity"),
    "grams": (scale("thrust", 102.0), r"column thrust: .*weight of vehicle 'paper'"),
    "too short": (cut(8), r"made\.csv: must have at least 20 rows, .* apart; got 8"),
    "all in gaps": (
        lambda c: c.update(bridged=np.ones(len(c["t"]))),
        r"made\.csv: must have at least 20 rows, `bridged` ones apart; got 0",
    ),
    "no row": (cut(0), r"made\.csv: must hold rows; it has a header and no rows\. Export"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_with_its_place_in_one_line(columns, tmp_path, fault):
    spoil, message = FAULTS[fault]
    spoil(columns)
    write_csv(tmp_path / "made.csv", columns)
    with pytest.raises(LogError, match=message) as error:
        open_flights(tmp_path / "made.csv", Vehicle())[0][0]
    assert "\n" not in str(error.value)


MENDED = {  # by an import
    "NaN": set_cell("vy", 56, np.nan),
    "quaternion too long": stretch_quaternion(9, 1.2),
    "time jumps back": set_cell("t", 99, 0.5),
}


@pytest.mark.parametrize("fault", MENDED)
def test_a_few_bad_rows_are_refused_and_an_import_mends_them(flight, columns, tmp_path, fault):
    MENDED[fault](columns)
    write_csv(tmp_path / "made.csv", columns)
    with pytest.raises(LogError, match="np-drake import"):
        read_flights(tmp_path / "made.csv")[0]
    (dut,) = import_log(tmp_path / "made.csv").flights
    at = np.searchsorted(flight.t, dut.t - 1e-9)
    np.testing.assert_allclose(dut.x, flight.x[at], atol=0.02)  # [SI]


def test_an_attitude_is_bridged_on_the_short_way_round(flight, columns, tmp_path):
    """Ten radians a second about x, the sign of q turned after a gap of seven rows."""
    angle = 10 * flight.t
    sign = np.where(np.arange(600) < 300, 1.0, -1.0)
    columns |= {
        "qw": sign * np.cos(angle / 2),
        "qx": sign * np.sin(angle / 2),
        "wx": 10 + 0 * angle,
    }
    leave_out(297, 304)(columns)
    columns = {name: value for name, value in columns.items() if not name.startswith("al")}
    write_csv(tmp_path / "made.csv", columns)
    dut = read_flights(tmp_path / "made.csv")[0]
    aligned = np.abs(dut.q[:, 0] * np.cos(angle / 2) + dut.q[:, 1] * np.sin(angle / 2))
    assert aligned.min() > 0.9999  # 1.6 degrees; linear interpolation over 0.8 rad


@pytest.mark.parametrize("share", [0.03, 1.0])
def test_a_noisy_velocity_of_the_right_sign_is_never_the_opposite(flight, share):
    draw = np.random.default_rng(5)
    p, v = share * flight.p, share * flight.v
    for _ in range(5):
        noisy = dc.replace(flight, p=p, v=v + 0.3 * draw.normal(size=v.shape), a=None)
        check_units(noisy, "x.csv")


def circling(t: np.ndarray) -> dict[str, np.ndarray]:
    """A metre of circle, a turn in 6 s, with a hovering command."""
    o = 0 * t
    names = {
        "px": np.cos(t),
        "py": np.sin(t),
        "pz": 1 + o,
        "vx": -np.sin(t),
        "vy": np.cos(t),
        "vz": o,
    }
    q = {"qw": 1 + o, "qx": o, "qy": o, "qz": o, "wx": o, "wy": o, "wz": o}
    return {"t": t, **names, **q, "thrust": 20.0 + np.arange(len(t)) % 2, "tx": o, "ty": o, "tz": o}


def without(t: np.ndarray, start: int, count: int) -> np.ndarray:
    return np.delete(t, slice(start, start + count))


T = 0.01 * np.arange(600)


def test_three_lost_rows_are_bridged_marked_and_said_once(tmp_path):
    write_csv(tmp_path / "a.csv", circling(without(T, 200, 3)))
    dut = open_flights(tmp_path / "a.csv")[0][0]
    np.testing.assert_allclose(dut.t, T, atol=1e-12)
    np.testing.assert_array_equal(np.flatnonzero(dut.bridged), [200, 201, 202])
    np.testing.assert_allclose(dut.p[200:203, 0], np.cos(T[200:203]), atol=2e-4)
    assert dut.notes == []
    whole = dc.replace(dut, bridged=None)
    assert bridged_rows([whole]) == []
    (line,) = bridged_rows([dut, whole, dut])
    assert line.startswith(
        "6 rows (0.3\u00a0%) in gaps of 2 of 3 flights were filled in; they do not count"
    )


def test_a_long_gap_splits_the_flight_into_parts_of_one_log(tmp_path):
    write_csv(tmp_path / "a.csv", circling(without(T, 200, 60)))
    first, second = open_flights(tmp_path / "a.csv")[0]
    assert (first.name, second.name) == ("a part 1", "a part 2")
    assert (len(first), len(second)) == (200, 340)
    assert "2 parts" in first.notes[0]


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.integers(30, 570), st.integers(1, 40)), max_size=5))
def test_every_row_is_in_one_part_and_no_part_has_a_long_gap(cuts):
    keep = np.ones(len(T), bool)
    for start, count in cuts:
        keep[start : start + count] = False
    table = Table("made", circling(T[keep]))
    parts, _ = split_at_gaps(table)
    times = np.concatenate([part.columns["t"] for part in parts])
    assert set(times) <= set(T[keep])
    for part in parts:
        assert np.diff(part.columns["t"]).max() <= LONGEST + 1e-9
        whole, bridged = bridge_gaps(part, present_fields(part))
        assert np.diff(whole.columns["t"]).max() <= 2.5 * 0.01  # one lost row is no gap
        np.testing.assert_array_equal(whole.columns["t"][~bridged], part.columns["t"])


@pytest.fixture
def turning(flight):
    """The made flight, rocking about every axis in turn, with the torque that this takes."""
    t, o = flight.t, 0 * flight.t
    third = np.minimum(np.arange(600) // 200, 2)
    rate, al = 0.8 * np.sin(np.pi * t), 0.8 * np.pi * np.cos(np.pi * t)
    w, al = (np.stack([np.where(third == i, x, o) for i in range(3)], axis=1) for x in (rate, al))
    half = 0.5 * 0.8 / np.pi * (1 - np.cos(np.pi * t))
    q = np.stack([np.cos(half), *(np.where(third == i, np.sin(half), o) for i in range(3))], axis=1)
    return dc.replace(
        flight, q=q, w=w, al=al, u=np.column_stack([flight.u[:, 0], al @ Vehicle().J])
    )


UNIT = r"column tx: torque must be what turns .* its integral changes .*in N·m.*kg·m²"
TORQUES = {  # factors of tx, ty, tz: what the message must say
    "millinewton metres": ([1000, 1000, 1000], UNIT),
    "kilonewton metres": ([1e-3, 1e-3, 1e-3], UNIT),
    "opposite": ([-1, -1, -1], r"column tx: .*what turns .*body x it goes against .*body axes"),
    "a rotor's drag the other way": ([1, 1, -1], r"column tz: .*body z it goes against"),
}


@pytest.mark.parametrize("fault", TORQUES)
def test_torque_in_another_unit_or_sign_is_refused_with_its_column(turning, fault):
    factors, message = TORQUES[fault]
    check_units(turning, "made.csv", Vehicle())
    with pytest.raises(LogError, match=rf"made\.csv, {message}") as error:
        check_units(dc.replace(turning, u=turning.u * [1, *factors]), "made.csv", Vehicle())
    assert "\n" not in str(error.value)


def test_torque_against_a_disturbance_is_no_wrong_sign(turning):
    """A load pushes, the controller holds against it: what is left of the turn is small, and
    early.
    """
    draw = np.random.default_rng(1)
    w = 0.02 * np.sin(2 * turning.t)[:, None] + 0.01 * draw.normal(size=(600, 3))
    q = np.tile([1.0, 0, 0, 0], (600, 1))
    held = np.column_stack([turning.u[:, 0], -0.3 * np.stack([np.cos(2 * turning.t)] * 3, axis=1)])
    check_units(dc.replace(turning, w=w, q=q, al=None, u=held), "made.csv", Vehicle())
