"""Bad input gets one line with file, column, row and remedy; a few bad rows can be repaired."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.logs.columns import disassemble
from np_drake.logs.errors import LogError
from np_drake.logs.formats.csv_file import write_csv
from np_drake.logs.formats.log_file import read as read_flights
from np_drake.logs.formats.log_file import write_log
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
    "empty column": (scale("py", np.nan), r"column py: is empty"),
    "NaN": (set_cell("vy", 56, np.nan), r"made\.csv, column vy, row 57 \(line 58\): .*--repair"),
    "infinite": (set_cell("thrust", 3, np.inf), r"column thrust, row 4 \(line 5\)"),
    "time stands": (set_cell("t", 10, 0.09), r"column t, row 11 \(line 12\): time must increase"),
    "time jumps back": (set_cell("t", 99, 0.5), r"column t, row 100 .*--repair"),
    "quaternion norm": (set_cell("qw", 5, 0.5), r"column qw, row 6 .*norm"),
    "quaternion x, y, z, w": (renamed("qx qy qz qw"), r"column qw: .*order x, y, z, w"),
    "quaternion from W to body": (scale("qx qy qz", -1), r"column qw: .*from W to body"),
    "milliseconds": (scale("t", 1000), r"column t: .*in seconds"),
    "millimetres": (scale("px py pz", 1000), r"column px: position.*SI units"),
    "centimetres per second": (scale("vx vy vz", 100), r"column px: position.*SI units"),
    "degrees per second": (scale("wx wy wz", 57.3), r"column qw: attitude.*SI units"),
    "accelerations in g": (scale("ax ay az", 1 / 9.81), r"column vx: velocity.*SI units"),
    "rpm": (scale("rotor1 rotor2 rotor3 rotor4", 9.55), r"column rotor1: .*rpm"),
    "velocity turned about": (
        scale("vx vy vz", -1),
        r"column vx: must be the rate of position.*opposite way",
    ),
    "one velocity turned about": (scale("vy", -1), r"column vy: .*Turn its sign, or that of py"),
    "position down": (scale("px py pz", -1), r"column vx: .*or that of px"),
    "rates turned about": (scale("wx wy wz", -1), r"column qw: .*from W to body"),
    "accelerations turned about": (
        scale("ax ay az", -1),
        r"column ax: must be the rate of velocity",
    ),
    "angular accelerations turned about": (
        scale("alx", -1),
        r"column alx: must be the rate of body rates",
    ),
    "thrust downwards": (scale("thrust", -1), r"column thrust: .*upwards.*Turn the sign of thrust"),
    "gravity left in": (lambda c: c["az"].__iadd__(9.81), r"column az: .*without gravity"),
    "grams": (scale("thrust", 102.0), r"column thrust: .*weight of vehicle 'paper'"),
    "throttle": (scale("thrust", 0.02), r"column thrust: .*weight"),
    "too short": (cut(8), r"made\.csv: must have at least 20 rows; got 8"),
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


# Named, and without the time of writing: pytest's workers must collect the same names.
def test_a_file_cut_off_is_named_and_can_be_repaired(flight, tmp_path):
    write_log(flight, tmp_path / "made.csv")
    text = (tmp_path / "made.csv").read_text()
    (tmp_path / "made.csv").write_text(text[:-60])
    with pytest.raises(LogError, match=r"row 600 \(line 601\).*cut off"):
        read_flights(tmp_path / "made.csv")[0]
    dut = read_flights(tmp_path / "made.csv", repair=True)[0]
    assert len(dut) == 599
    assert dut.notes == ["repaired: 1 of 600 rows left out (time missing or not increasing)"]


REPAIRS = {  # spoil: what the note must say
    "NaN": (set_cell("vy", 56, np.nan), "1 of 600 rows interpolated"),
    "NaN in the first row": (set_cell("px", 0, np.nan), "1 of 600 rows interpolated"),
    "a spike of infinity": (set_cell("wx", slice(100, 104), np.inf), "4 of 600 rows interpolated"),
    "quaternion too long": (stretch_quaternion(9, 1.2), "1 of 600 rows given a unit quaternion"),
    "quaternion of zeros": (stretch_quaternion(300, 0.0), "1 of 600 rows interpolated"),
    "time jumps back": (set_cell("t", 99, 0.5), "1 of 600 rows left out"),
    "time is missing": (set_cell("t", 99, np.nan), "1 of 600 rows left out"),
}


@pytest.mark.parametrize("fault", REPAIRS)
def test_a_few_bad_rows_are_repaired_only_if_asked_and_the_log_says_so(
    flight, columns, tmp_path, fault
):
    spoil, note = REPAIRS[fault]
    spoil(columns)
    write_csv(tmp_path / "made.csv", columns)
    with pytest.raises(LogError):
        read_flights(tmp_path / "made.csv")[0]
    dut = read_flights(tmp_path / "made.csv", repair=True)[0]
    at = np.searchsorted(flight.t, dut.t - 1e-9)
    np.testing.assert_allclose(
        dut.x, flight.x[at], atol=0.02
    )  # a row at either end is held, not drawn on [SI]
    assert len(dut.notes) == 1
    assert note in dut.notes[0]


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


@pytest.mark.parametrize(
    "spoil, message",
    [
        (set_cell("vx", slice(0, 600, 40), np.nan), "at most 2% of the rows; 15 of 600"),
        (set_cell("vx", slice(100, 111), np.nan), r"column vx, row 100 .*at most 0\.1 s"),
        (remove("px"), "column px: is missing"),
    ],
)
def test_more_than_a_few_bad_rows_are_refused(columns, tmp_path, spoil, message):
    spoil(columns)
    write_csv(tmp_path / "made.csv", columns)
    with pytest.raises(LogError, match=message):
        read_flights(tmp_path / "made.csv", repair=True)[0]


def test_a_bias_of_the_velocity_that_turns_with_the_body_is_no_wrong_unit(flight):
    yaw = 0.8 * flight.t
    q = np.column_stack([np.cos(yaw / 2), 0 * yaw, 0 * yaw, np.sin(yaw / 2)])
    w, still = np.tile([0.0, 0.0, 0.8], (len(flight), 1)), np.zeros((len(flight), 3))
    v = 0.6 * np.column_stack([np.cos(yaw), np.sin(yaw), 0 * yaw])
    p = 0.01 * np.random.default_rng(3).normal(size=(len(flight), 3))
    spinning = dc.replace(flight, p=p, q=q, v=v, w=w, a=still, al=still)
    check_units(spinning, "x.csv")
    with pytest.raises(LogError, match="SI units"):
        check_units(dc.replace(spinning, p=1e-3 * np.cumsum(v, axis=0) * flight.step), "x.csv")
    with pytest.raises(LogError, match="SI units"):
        check_units(dc.replace(spinning, p=0 * p), "x.csv")


@pytest.mark.parametrize("name", ["px", "thrust"])
def test_a_cell_of_absurd_size_is_named_without_a_warning(columns, tmp_path, name, recwarn):
    columns[name][5] = 1e300
    write_csv(tmp_path / "made.csv", columns)
    with pytest.raises(
        LogError,
        match=rf"column {name}, row 6 \(line 7\): must be below 1e\+12 in size; got 1e\+300",
    ):
        open_flights(tmp_path / "made.csv", Vehicle())[0][0]
    assert read_flights(tmp_path / "made.csv", repair=True)[0].notes
    assert not recwarn.list


def test_a_vehicle_on_its_back_that_its_thrust_carries_is_refused(flight):
    q = np.column_stack(
        [-flight.q[:, 1], flight.q[:, 0], flight.q[:, 3], -flight.q[:, 2]]
    )  # rolled by 180 degrees
    fallen = dc.replace(flight, q=q, w=flight.w, al=None, a=None)
    with pytest.raises(
        LogError,
        match=r"column qw: thrust must carry the vehicle upwards; body z points -0\.\d+ along",
    ):
        check_units(fallen, "x.csv")


def test_a_flight_that_tumbles_is_no_wrong_sign(flight):
    angle = 12.0 * flight.t
    q = np.column_stack([np.cos(angle / 2), np.sin(angle / 2), 0 * angle, 0 * angle])
    w = np.column_stack([12.0 + 0 * angle, 0 * angle, 0 * angle])
    check_units(dc.replace(flight, q=q, w=w, al=None), "x.csv")


@pytest.mark.parametrize("share", [0.03, 1.0])
def test_a_noisy_velocity_of_the_right_sign_is_never_the_opposite(flight, share):
    draw = np.random.default_rng(5)
    p, v = share * flight.p, share * flight.v
    for _ in range(5):
        noisy = dc.replace(flight, p=p, v=v + 0.3 * draw.normal(size=v.shape), a=None)
        check_units(noisy, "x.csv")
