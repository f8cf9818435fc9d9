"""Laws of an import: our own flight comes back, wrong conventions are refused with their name, and
the sheet says what was done.
"""

import dataclasses as dc

import numpy as np
import pytest
import yaml

from np_drake.logs.columns import COLUMNS
from np_drake.logs.errors import LogError
from np_drake.logs.formats.log_file import read, write_log
from np_drake.logs.formats.text_table import write_csv
from np_drake.logs.importing.alignment import POSE
from np_drake.logs.importing.conventions import WrongConventions, changed
from np_drake.logs.importing.import_log import import_log, lacking, looks
from np_drake.logs.importing.log_map import Source, load_map_file


@pytest.fixture
def written(excited, conventions, tmp_path):
    """Return a function that writes the excited flight in conventions, and imports it with a
    map.
    """

    def go(own=(), declared=(), *, t=None, log=excited, pose=slice(None), **options):
        log_map = changed(conventions.plain_map(command="held_after"), own)
        columns = conventions.columns_in(log_map, conventions.quantities_of(log))
        table = {"t": log.t if t is None else t}
        for name, source in log_map.sources():
            rows = pose if name in POSE else slice(None)
            table |= dict(zip(source.columns, columns[name][rows].T, strict=True))
        lines = [",".join(table)] + [
            ",".join(map(repr, map(float, row))) for row in zip(*table.values(), strict=True)
        ]
        path = tmp_path / "flight.csv"
        path.write_text("\n".join(lines) + "\n")
        return import_log(
            path, changed(conventions.plain_map(command="held_after"), declared), **options
        )

    return go


def same(flight, log):
    q = flight.q * np.sign(np.sum(flight.q * log.q, axis=1, keepdims=True))
    ours, theirs = (np.hstack([x.p, x.v, x.w, x.u]) for x in (flight, log))
    assert np.allclose(q, log.q, rtol=0, atol=1e-9)
    assert np.allclose(ours, theirs, rtol=0, atol=1e-9)


def test_a_log_of_ours_comes_back_without_a_map(excited, tmp_path):
    write_log(excited, tmp_path / "own.csv")
    (flight,) = import_log(tmp_path / "own.csv").flights
    same(flight, excited)
    assert np.allclose(flight.a, excited.a, rtol=0, atol=1e-9)
    assert flight.timing == 0.0


def test_a_frozen_pose_is_bridged_and_the_flight_stays_one(written, flown):
    kept = np.arange(len(flown))
    kept[200:240], kept[500:555] = 200, 500
    kept[555:559] = 530  # an old pose, before it thaws
    found = written(log=flown, pose=kept)
    (flight,) = found.flights
    said = "the pose repeats while the gyro turns: 98 rows, 1 s in 2 stretches, left out"
    assert found.shown == (said,)
    assert flight.in_gap.sum() == pytest.approx(98, abs=3)
    assert np.abs(flight.p - flown.p).max() < 0.02  # [m]
    assert np.abs(flight.v - flown.v).max() < 0.1  # [m/s]


def test_a_planar_pose_is_refused_and_never_taken_for_millimetres(written, excited):
    w, x, y, z = excited.q.T
    half = np.arctan2(w * z + x * y, 0.5 - y * y - z * z) / 2
    o = np.zeros(len(excited))
    level = np.stack([np.cos(half), o, o, np.sin(half)], axis=1)
    planar = dc.replace(excited, q=level, w=excited.w * [0, 0, 1])
    with pytest.raises(
        LogError, match="must tilt where the vehicle accelerates sideways"
    ) as caught:
        written(log=planar)
    assert "mm" not in str(caught.value).replace("mrad", "")


NED_FRD = (("world", "ned"), ("body", "frd"))


@pytest.mark.parametrize(
    "own",
    [
        NED_FRD,
        (("attitude.order", "xyzw"),),
        (("rates.unit", "deg/s"), ("thrust.scale", -1.0)),
        (("time.unit", "ms"),),
    ],
    ids=["NED/FRD", "xyzw", "deg/s and -f", "ms"],
)
def test_a_log_is_the_flight_in_its_conventions_and_refused_in_others(written, excited, own):
    t = excited.t * (1000.0 if own[0][0] == "time.unit" else 1.0)
    (flight,) = written(own, own, t=t).flights
    same(flight, excited)
    with pytest.raises(WrongConventions, match="does not fit the conventions declared") as caught:
        written(own, (), t=t)
    assert set(own) == set(caught.value.verdict.changes)
    assert all(f"{option}: {value}" in str(caught.value) for option, value in own)


@pytest.mark.parametrize(
    "command, timing",
    [("held_before", 0), ("averaged", 0.5), ("sampled", 12**-0.5), ("unknown", 0.5)],
)
def test_what_a_row_means_is_carried_as_uncertainty_of_time(written, command, timing):
    dut = written((), (("command", command),))
    assert dut.flights[0].timing == dut.sheet.timing == pytest.approx(timing * 0.01, abs=1e-12)


def test_ticks_of_a_coarse_clock_are_an_uncertainty_of_time(written, excited):
    dut = written(t=0.004 * np.floor(excited.t / 0.004 + 1e-9))
    assert dut.flights[0].timing == pytest.approx(0.004 / np.sqrt(12), rel=1e-3)
    assert any("times are rounded to 4 ms" in note for note in dut.sheet.content["notes"])


def test_a_map_is_read_from_yaml_and_its_faults_are_named(tmp_path):
    path = tmp_path / "map.yaml"
    path.write_text(
        yaml.safe_dump({"world": "ned", "attitude": {"columns": list("abcd"), "order": "xyzw"}})
    )
    dut = load_map_file(path).values
    assert dut.attitude == Source(list("abcd"), order="xyzw")
    path.write_text("world: nwd\n")
    with pytest.raises(ValueError, match=r"world must be one of enu, ned, .*; got 'nwd'"):
        load_map_file(path)


@pytest.mark.parametrize("names", [("attitude", "rates"), ("position", "velocity", "acceleration")])
def test_a_map_without_the_state_is_refused_before_the_log_is_read(written, names):
    with pytest.raises(LogError, match=f"must tell columns of {names[0]}"):
        written(declared=tuple((f"{name}.columns", []) for name in names))


def test_times_of_whole_seconds_are_not_taken_for_milliseconds(written, excited):
    with pytest.raises(
        LogError, match=r"got 1 s\. Log at a higher rate, or export the times with all"
    ):
        written((), t=100.0 + np.arange(40), adopt=True, log=excited.rows(0, 40))


OURS = ["t", "px", "py", "pz", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz", "thrust"]


OR = ", or gyro and accelerometer (wx wy wz sx sy sz)"


@pytest.mark.parametrize(
    "names, said",
    [
        ([n for n in OURS if n != "qz"], f"attitude (qz, or Euler angles by a map){OR}"),
        (OURS[1:], "time (t)"),
        (
            OURS[:1] + OURS[4:8],
            "position (px py pz), velocity (vx vy vz) or acceleration (ax ay az)",
        ),
        (OURS, ""),
    ],
)
def test_what_the_names_of_a_table_do_not_tell_is_listed(names, said):
    assert lacking({"table": tuple(names)}) == said


def test_columns_that_look_like_what_is_missing_are_shown_and_first(tmp_path):
    names = [f"x{i}" for i in range(9)] + ["quat_w", "quat_x", "quat_y", "quat_z", "pos_n"]
    assert looks({"table": tuple(names)}, "qp") == (
        " Columns that look like attitude: quat_w, quat_x, quat_y, quat_z; position: pos_n."
    )
    assert looks({"table": (*names, *COLUMNS["q"])}, "q") == ""
    own = [n for n in OURS if n != "qz"] + [f"x{i}" for i in range(9)] + ["q_z"]
    path = tmp_path / "made.csv"
    write_csv(path, {name: np.linspace(0.0, 1.0, 40) for name in own})
    with pytest.raises(LogError, match=r"column qz: is missing.*header has: qw, qx, qy, q_z, t"):
        read(path)


@pytest.mark.parametrize(
    "start, said",
    [
        (b"ULogEnc\x01" + bytes(range(256)), "encrypted PX4 log; decrypt it"),
        (bytes(5000), "only zeros.*copy it again"),
        (bytes(40), "only zeros.*copy it again"),
        (b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
        (b"PK\x03\x04" + bytes(99), "unpack it"),
    ],
)
@pytest.mark.parametrize("name", ["log.ulg", "log.csv", "log"])
def test_a_file_that_is_no_log_is_refused_by_what_it_is(tmp_path, start, said, name):
    path = tmp_path / name
    path.write_bytes(start)
    with pytest.raises(LogError, match=rf"must hold a flight log; it is .*{said}"):
        import_log(path)
