import numpy as np
import pytest

from np_drake.references.base import Paced
from np_drake.references.config import TRACKS, ReferenceConfig, make_reference
from np_drake.references.track_file import write_trajectory
from np_drake.references.waypoints import ACCELERATION, PointToPoint, Spline, Stops, nearest

SQUARE = "x,y,z\n1,1,1\n-1,1,1\n-1,-1,1.5\n1,-1,1.5\n1,1,1\n"
LINE = "x,y,z\n0,0,1\n3,0,1\n3,1,2\n0,1,2\n"
# p [m], v [m/s], a [m/s²], jerk, snap, as in the docs.
ROUND_TRIP = (1e-8, 1e-6, 1e-4, 1e-2, 1.0)
# near a jump of the snap, of up to 7e2 m/s⁴, as of `steps`
ROUND_TRIP_JUMP = (1e-7, 2e-5, 5e-3, 2.0, np.inf)


def track(tmp_path, text, name="track.csv", **changes):
    (tmp_path / name).write_text(text)
    return make_reference(ReferenceConfig(track=str(tmp_path / name), **changes))


def trajectory(tmp_path, t, p, **changes):
    rows = "\n".join(
        f"{when!r},{x!r},{y!r},{z!r}"
        for when, (x, y, z) in zip(t.tolist(), p.tolist(), strict=True)
    )
    return track(tmp_path, f"t,x,y,z\n{rows}\n", **changes)


def written(tmp_path, reference, duration, **changes):
    write_trajectory(reference, tmp_path / "written.csv", duration=duration)
    return make_reference(ReferenceConfig(track=str(tmp_path / "written.csv"), **changes))


def moving(t):
    """A circle that is in motion from the first."""
    return make_reference(ReferenceConfig(ramp=0.0)).sample(t)[0]


@pytest.mark.parametrize("text", [SQUARE, LINE], ids=["closed", "open"])
def test_a_track_of_waypoints_passes_them_in_turn(tmp_path, text):
    dut = track(tmp_path, text, ramp=1.0, speed=1.0)
    points = np.array([[float(c) for c in row.split(",")] for row in text.split()[1:]])
    p = dut.sample(np.linspace(0.0, min(dut.end, dut.lap + dut.lead), 40_001))[0]
    distance = np.linalg.norm(p[:, None] - points, axis=2)
    assert distance.min(axis=0).max() < 2e-4  # [m]; half the way between two samples
    first = [int(np.argmax(distance[:, k] < 2e-4)) for k in range(len(points) - 1)]
    assert first == sorted(first)


def test_open_waypoints_end_at_rest_and_closed_ones_go_round(tmp_path):
    dut = track(tmp_path, LINE, ramp=1.0)
    flat = dut.sample(np.array([-1.0, 0.0, dut.end, dut.end + 5.0]))
    ends = [[0, 0, 1], [0, 0, 1], [0, 1, 2], [0, 1, 2]]
    np.testing.assert_allclose(flat[0], ends, atol=1e-9)  # [m]
    np.testing.assert_allclose(flat[1:], 0.0, atol=1e-9)
    dut, t = track(tmp_path, SQUARE, ramp=1.0), np.linspace(1.0, 4.0, 50)
    np.testing.assert_allclose(dut.sample(t + dut.lap), dut.sample(t), atol=1e-9)
    assert dut.end == np.inf
    assert 2 * np.pi / dut.rate == pytest.approx(dut.lap)


@pytest.mark.parametrize("ramp", [1.0, 60.0])
@pytest.mark.parametrize("text", [SQUARE, LINE], ids=["closed", "open"])
def test_derivatives_of_waypoints_are_those_of_the_track(tmp_path, text, ramp):
    _require_derivatives(track(tmp_path, text, ramp=ramp), np.linspace(0.05, 9.0, 301))


def _require_derivatives(dut, t):
    h = 1e-5
    slope = (dut.sample(t + h) - dut.sample(t - h)) / (2 * h)
    for k, atol in enumerate((1e-4, 1e-3, 1e-2)):  # [m/s, m/s², m/s³]; truncation and round-off
        np.testing.assert_allclose(slope[k], dut.sample(t)[k + 1], atol=atol, rtol=1e-3)


MOTIONS = {
    **{name: ReferenceConfig(track=name, ramp=2.0) for name in TRACKS},
    "dither": ReferenceConfig(dither=[0.05, 0.05, 0.05], ramp=2.0),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_written_motion_read_back_is_the_same(tmp_path, name):
    motion = make_reference(MOTIONS[name])
    dut = written(tmp_path, motion, 12.0)
    t = np.linspace(0.0, 12.0, 4321)
    error = np.abs(dut.sample(t) - motion.sample(t)).max(axis=(1, 2))
    assert dut.lead == 0.0
    assert (error <= (ROUND_TRIP_JUMP if name == "steps" else ROUND_TRIP)).all(), error


def test_rounded_positions_leave_the_snap_smooth(tmp_path):
    motion = make_reference(ReferenceConfig(track="lemniscate", ramp=3.0))
    t = np.arange(1201) / 100
    dut = trajectory(tmp_path, t, np.round(motion.sample(t)[0], 6))
    fine = np.linspace(0.5, 11.5, 3001)
    error = np.abs(dut.sample(fine) - motion.sample(fine)).max(axis=(1, 2))
    assert error[0] < 1e-6  # [m]; one unit of the last decimal
    assert error[4] < 1.0  # [m/s⁴]; a spline through the rounded rows is off by some hundred


def test_a_motion_that_begins_moving_is_ramped_along_its_own_track(tmp_path):
    t = np.arange(801) / 100
    dut = trajectory(tmp_path, t, moving(t), ramp=2.0)
    assert (dut.lead, dut.end) == (2.0, pytest.approx(9.0))
    np.testing.assert_allclose(dut.sample(np.zeros(1))[1:], 0.0, atol=1e-12)
    later = np.linspace(2.0, 9.0, 50)
    np.testing.assert_allclose(dut.sample(later)[0], moving(later - 1.0), atol=1e-8)  # [m]
    _require_derivatives(dut, np.linspace(0.05, 8.9, 100))


def test_after_an_end_in_motion_it_brakes_to_rest(tmp_path):
    t = np.arange(801) / 100
    dut = trajectory(tmp_path, t, moving(t), ramp=2.0)
    _require_derivatives(dut, np.linspace(dut.end + 0.01, dut.end + 3.0, 100))
    either = dut.sample(dut.end + np.array([-1e-7, 1e-7]))
    np.testing.assert_allclose(either[:4, 0], either[:4, 1], atol=1e-3)  # up to the jerk
    after = dut.sample(dut.end + np.array([5.0, 50.0]))
    assert not after[1:].any()
    np.testing.assert_array_equal(after[0, 0], after[0, 1])


def test_a_changed_file_is_read_anew(tmp_path):
    first = track(tmp_path, LINE).sample(np.zeros(1))[0, 0]
    second = track(tmp_path, LINE.replace("0,0,1\n", "0.5,0,1.25\n", 1)).sample(np.zeros(1))[0, 0]
    np.testing.assert_allclose([first, second], [[0, 0, 1], [0.5, 0, 1.25]], atol=1e-12)


RAMPED = "t,x,y,z\n" + "".join(f"{0.1 * k:.1f},{0.1 * k:.1f},0,1\n" for k in range(20))
BAD = {  # text: what the line says
    "empty": ("", "empty"),
    "half a velocity": ("t,x,y,z,vx\n", "must have the column vy"),
    "unknown": ("t,x,y,z,yaw\n", "column yaw: is no column of a trajectory"),
    "not a number": (LINE.replace("3,1,2", "3,a,2"), "row 3 (line 4): must be a number; got 'a'"),
    "infinite": (LINE.replace("3,1,2", "3,inf,2"), "must be a finite number; got inf"),
    "underground": (LINE.replace("3,1,2", "3,1,-2"), "must be above the ground"),
    "millimetres": (LINE.replace("3,1,2", "3,1500,2"), "must be within 1000 m"),
    "one point": ("x,y,z\n0,0,1\n", "at least 2 waypoints; got 1"),
    "there and back": ("x,y,z\n0,0,1\n1,0,1\n0,0,1\n", "at least 3 waypoints besides the last"),
    "twice": (LINE.replace("3,1,2", "3,0,1"), "row 3 (line 4): must be another waypoint"),
    "few rows": ("\n".join(RAMPED.splitlines()[:6]), "at least 8 rows of a trajectory; got 5"),
    "time stands still": (RAMPED.replace("0.5,0.5", "0.4,0.5"), "row 6 (line 7): must be later"),
    "false velocity": (
        "t,x,y,z,vx,vy,vz\n" + "".join(f"{0.1 * k},{0.1 * k},0,1,3.6,0,0\n" for k in range(20)),
        "column vx, row 1 (line 2): must be the slope of the positions, 1, within 0.41; got 3.6",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_refused_in_one_line_with_place_and_remedy(tmp_path, case):
    text, message = BAD[case]
    with pytest.raises(ValueError) as caught:
        track(tmp_path, text)
    assert message in str(caught.value)
    assert "track.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


POINTS = np.array([[0, 0, 1.0], [1, 0, 1.0], [1, 1, 1.5], [0, 1, 1.5]])
ROUND = np.concatenate([POINTS, POINTS[:1]])
RESTING = {
    "stops": PointToPoint(POINTS, speed=0.8, rest=0.5),
    "stops round": PointToPoint(ROUND, speed=0.8, rest=0.5),
}
STOPS = Stops(POINTS, np.array([0.5, 2.0, 3.5]), np.array([1.0, 1.5, 1.2]))
SPLINE = Spline(POINTS, np.array([0.0, 1.5, 3.0, 4.5]))


@pytest.mark.parametrize("dut", [*RESTING.values(), STOPS, SPLINE, Paced(STOPS, 0.7)])
def test_derivatives_are_those_of_the_motion(dut):
    _require_derivatives(dut, np.linspace(0.05, 7.0, 80))


@pytest.mark.parametrize("name", RESTING)
def test_it_passes_every_waypoint_from_rest_and_an_open_one_to_rest(name):
    dut = RESTING[name]
    t = np.linspace(0.0, min(dut.end, 14.0), 20_000)
    assert nearest(dut.points, dut.sample(t)[0]).max() < 1e-6  # [m]
    flat = dut.sample(np.array([-1.0, 0.0, min(dut.end, 1e3) + 1.0]))
    np.testing.assert_allclose(flat[0, :2], POINTS[[0, 0]], atol=1e-12)
    np.testing.assert_allclose(flat[1:4, :2], 0.0, atol=1e-8)
    if dut.end < np.inf:
        np.testing.assert_allclose(flat[0, 2], POINTS[-1], atol=1e-12)
        np.testing.assert_allclose(flat[1:, 2], 0.0, atol=1e-9)


def test_timed_points_are_passed_at_their_times():
    flat = STOPS.sample(np.array([-1.0, 1.7, 3.5, 4.8, 9.0]))
    np.testing.assert_allclose(flat[0], POINTS[[0, 1, 2, 3, 3]], atol=1e-12)
    np.testing.assert_allclose(flat[1], 0.0, atol=1e-12)
    flat = SPLINE.sample(np.array([-1.0, 1.5, 3.0, 9.0]))
    np.testing.assert_allclose(flat[0], POINTS, atol=1e-12)
    np.testing.assert_allclose(flat[1:4, [0, -1]], 0.0, atol=1e-9)


def test_stops_stay_on_the_legs_and_rest_at_each_corner():
    dut = RESTING["stops round"]
    t = np.linspace(0.0, 14.0, 14_001)
    flat = dut.sample(t)
    assert nearest(flat[0][::20], ROUND).max() < 1e-9  # [m]
    still = np.linalg.norm(flat[1], axis=1) < 1e-9
    at_corner = np.linalg.norm(flat[0][:, None] - ROUND, axis=2).min(axis=1) < 1e-9
    assert at_corner[still].all()
    assert 0.4 * 7 < np.sum(still) * 1e-3 < 0.6 * 8  # [s]; half a second at each of seven corners


def test_a_short_leg_between_stops_takes_longer_than_its_speed_says():
    flat = RESTING["stops"].sample(np.linspace(0.0, 8.0, 8001))
    assert np.linalg.norm(flat[2], axis=1).max() == pytest.approx(ACCELERATION, rel=1e-3)
    long = PointToPoint(np.array([[0, 0, 1.0], [9, 0, 1.0]]), speed=0.5, rest=0.0)
    assert long.end == pytest.approx(9 / 0.5)


def test_a_point_between_two_rows_is_passed():
    p = np.array([[0, 0, 1.0], [1.0, 0, 1.0]])
    np.testing.assert_allclose(nearest(np.array([[0.4, 0.3, 1.0], [2.0, 0, 1.0]]), p), [0.3, 1.0])
    np.testing.assert_allclose(nearest(np.array([[0.4, 0.3, 1.0]]), p[:1]), [0.5])
