"""Laws of flights along the track of a CSV file."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.loop.flight import FlightConfig, load_flight
from diagrams.loop.flight_result import fly
from np_drake.references.config import ReferenceConfig, make_reference
from np_drake.references.track_file import write_trajectory
from np_drake.vehicle import load_vehicle

LINE = "x,y,z\n0,0,1.5\n1,0,1.5\n1,1,2\n0,1,2\n"
SQUARE = "x,y,z\n1,1,1.5\n-1,1,1.5\n-1,-1,2\n1,-1,2\n1,1,1.5\n"


def scenario(folder, text=LINE, more="", reference="speed: 1.0, ramp: 1.0"):
    """Write a track and a scenario beside it, and return the path of the latter."""
    folder.mkdir(exist_ok=True)
    if text:
        (folder / "track.csv").write_text(text)
    (folder / "mine.yaml").write_text(
        f"name: mine\nreference: {{track: track.csv, {reference}}}\ncontroller: "
        f"{{kind: hold, solver: sqp}}\n{more}"
    )
    return str(folder / "mine.yaml")


def test_the_track_lies_beside_the_scenario_file(tmp_path, monkeypatch):
    path = scenario(tmp_path / "inner")
    monkeypatch.chdir(tmp_path)
    assert load_flight("inner/mine.yaml").reference.track == "inner/track.csv"
    assert load_flight(path).reference.track == str(tmp_path / "inner" / "track.csv")


def test_an_absolute_path_stays_as_it_is(tmp_path):
    path = scenario(tmp_path / "inner")
    (tmp_path / "inner" / "track.csv").rename(tmp_path / "other.csv")
    text = (
        (tmp_path / "inner" / "mine.yaml")
        .read_text()
        .replace("track.csv", str(tmp_path / "other.csv"))
    )
    (tmp_path / "inner" / "mine.yaml").write_text(text)
    assert load_flight(path).reference.track == str(tmp_path / "other.csv")


def test_a_track_with_an_end_gives_the_flight_its_duration(tmp_path):
    config = load_flight(scenario(tmp_path))
    assert config.end == pytest.approx(make_reference(config.reference).end)
    assert load_flight(scenario(tmp_path, more="duration: 3.0\n")).duration == 3.0


def test_a_closed_track_flies_as_long_as_others(tmp_path):
    assert load_flight(scenario(tmp_path, SQUARE)).duration == FlightConfig().duration


def test_a_trajectory_that_begins_at_rest_is_scored_from_the_first_row(tmp_path):
    motion = make_reference(ReferenceConfig(track="lemniscate", ramp=2.0, speed=1.0))
    write_trajectory(motion, tmp_path / "track.csv", duration=3.0)
    config = load_flight(scenario(tmp_path, ""))
    flight = fly(config, seed=0)
    assert flight.scored.all()
    assert config.end == pytest.approx(3.0)
    t = flight.signals["t"]
    np.testing.assert_allclose(
        flight.signals["p_ref"], motion.sample(t)[0], atol=1e-6
    )  # [m]; microsecond later
    assert flight.metrics()["E_xy"] < 0.05
    assert flight.metrics()["solve_failures"] == 0


def test_waypoints_are_flown(tmp_path):
    metrics = fly(load_flight(scenario(tmp_path)), seed=0).metrics()
    assert metrics["E_xy"] < 0.05
    assert metrics["solve_failures"] == 0


def test_the_track_of_a_file_stays_in_si_for_any_vehicle(tmp_path):
    path = scenario(
        tmp_path, "x,y,z\n0,0,1.5\n.2,0,1.5\n.2,.2,1.5\n", reference="speed: 0.3, ramp: 1.0"
    )
    p = [
        make_reference(load_flight(path, v).reference).sample(np.linspace(0, 2, 9))
        for v in (None, small())
    ]
    np.testing.assert_array_equal(*p)


def small():
    return load_vehicle("crazyflie")


BAD = {  # track, further lines, fields of the reference: what the line says
    "scaled": (LINE, "scaled: true\n", "", "scaled must be false for the track of a CSV file"),
    "missing": ("", "", "", "track.csv: must be a CSV file of a track (No such file or directory)"),
    "cell": (
        LINE.replace("1,1,2", "1,nan,2"),
        "",
        "",
        "track.csv, column y, row 3 (line 4): must be a finite",
    ),
    "speed": (LINE, "", "speed: 9.0, ramp: 0.1", "must be within controller.mpc.max_speed"),
    "tilt": (
        LINE,
        "",
        "speed: 2.5, ramp: 1.0",
        "must be within controller.mpc.max_tilt, 0.9 rad; demands",
    ),
    "rotors": (
        "x,y,z\n0,0,1.5\n0,0,9\n",
        "",
        "speed: 5.5, ramp: 0.6",
        "track.csv: must be within max_rotor_thrust, 12 N",
    ),
    "arena": (LINE.replace("1,1,2", "99,1,2"), "", "", "must stay within 50 m of the origin"),
    "below": ("x,y,z\n0,0,3\n1,0,.05\n2,0,.05\n3,0,3\n", "", "", "must stay above the ground"),
    "no ramp": (LINE, "", "ramp: 0.0", "needs a ramp"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_track_that_cannot_be_flown_is_refused_in_one_line(tmp_path, monkeypatch, capsys, case):
    text, more, reference, message = BAD[case]
    monkeypatch.chdir(tmp_path)
    scenario(tmp_path / "x", text, more, reference or "speed: 1.0")
    assert run(["fly", "x/mine.yaml", "--out", "out"]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_rotors_are_held_against_the_thrust_that_is_left(tmp_path):
    config = load_flight(
        scenario(tmp_path, "x,y,z\n0,0,1.5\n0,0,9\n", reference="speed: 3.6, ramp: 1.0")
    )
    config.check()
    config.reality.thrust_scale = 0.8
    with pytest.raises(ValueError, match="max_rotor_thrust"):
        config.check()


def test_a_flight_from_python_is_checked_too(tmp_path):
    config = load_flight(scenario(tmp_path))
    config.reference = dc.replace(config.reference, speed=9.0)
    with pytest.raises(ValueError, match="max_speed"):
        config.check()


FLAT = "x,y,z\n0,0,1.5\n1,0,1.5\n1,1,1.5\n0,1,1.5\n0,0,1.5\n"  # a square of 1 m


def test_a_square_that_is_flown_round_is_a_warning_with_the_distance(tmp_path):
    (said,) = load_flight(scenario(tmp_path, FLAT)).warnings()
    assert "leaves the straight leg from waypoint" in said
    assert "by 0.21 m; reference.corners: stop keeps to the legs." in said
    wider = load_flight(scenario(tmp_path, FLAT, reference="speed: 1.0, ramp: 1.0, within: 0.3"))
    assert wider.warnings() == []


def test_stops_at_the_corners_of_a_square_are_no_warning(tmp_path):
    config = load_flight(
        scenario(tmp_path, FLAT, "duration: 9.0\n", "speed: 1.0, corners: stop, rest: 0.3")
    )
    assert config.warnings() == []
    flight = fly(config, seed=0)
    assert flight.warnings() == []
    assert max(flight.metrics()["waypoint_distances"]) < 0.05  # [m]


def test_waypoints_beyond_the_end_are_named_with_their_distance(tmp_path):
    config = load_flight(
        scenario(tmp_path, "x,y,z\n0,0,1.5\n1,0,1.5\n2,0,1.5\n", "duration: 0.5\n")
    )
    (said,) = config.warnings()
    assert said == "the track does not come within 0.1 m of waypoint 3 (1.00 m)."


def test_what_the_flight_itself_misses_is_named_too(tmp_path):
    config = load_flight(
        scenario(tmp_path, FLAT, "duration: 5.0\n", "speed: 1.0, corners: snap, within: 0.3")
    )
    flight = fly(config, seed=0)
    assert flight.warnings() == []
    flight.config.reference.within = 1e-4
    assert (
        "the flight with hold does not come within 0.0001 m of waypoints" in flight.warnings()[-1]
    )


@pytest.mark.parametrize(
    "reference, said",
    [
        ("corners: sharp", "corners must be one of round, stop, snap"),
        ("follow: wing", "follow must be one of vehicle, payload"),
        ("within: 0.0", "within must be positive"),
    ],
)
def test_an_unknown_word_of_a_track_is_refused_with_those_there_are(tmp_path, reference, said):
    with pytest.raises(ValueError, match=said):
        load_flight(scenario(tmp_path, FLAT, reference=f"speed: 1.0, ramp: 1.0, {reference}"))


def test_corners_are_for_waypoints(tmp_path):
    (tmp_path / "c.yaml").write_text("reference: {track: circle, corners: stop}\n")
    with pytest.raises(
        ValueError, match="corners is for the waypoints of a CSV file; got stop and circle"
    ):
        load_flight(str(tmp_path / "c.yaml"))
    times = "t,x,y,z\n" + "\n".join(f"{k},{0.01 * k},0,1.5" for k in range(9))
    with pytest.raises(ValueError, match="corners stop is for waypoints"):
        load_flight(scenario(tmp_path, times, reference="ramp: 1.0, corners: stop"))


def test_a_payload_that_is_to_follow_the_track_does(tmp_path):
    (tmp_path / "led.yaml").write_text(
        "duration: 3.0\nreference: {track: circle, height: 1.0, ramp: 3.0, follow: payload}\n"
        "controller: {kind: payload_filter}\n"
    )
    config = load_flight(str(tmp_path / "led.yaml"))
    flight = fly(config, seed=0)
    errors = flight.metrics()["payload"]
    assert errors["E_xy"] < 0.02  # [m]; under a vehicle on the circle itself it is 18 cm off
    assert errors["E_z"] < 0.01
    np.testing.assert_allclose(flight.payload_position[0], [1.0, 0.0, 1.0], atol=1e-3)
    assert np.linalg.norm(flight.signals["p_ref"][-1, :2]) < 0.85  # [m]; the vehicle leans in


@pytest.mark.parametrize(
    "reality, said",
    [("{tether: none}", "needs a payload on a cable; got none"), ("{tether: rod}", "got rod")],
)
def test_a_payload_that_is_to_follow_must_hang_on_a_cable(tmp_path, reality, said):
    (tmp_path / "led.yaml").write_text(
        f"reference: {{follow: payload}}\nreality: {{payload: {reality}}}\n"
    )
    with pytest.raises(ValueError, match=said):
        load_flight(str(tmp_path / "led.yaml"))


def test_a_track_on_which_the_cable_goes_slack_is_refused(tmp_path):
    (tmp_path / "led.yaml").write_text(
        "reference: {track: vertical, follow: payload, speed: 4.0, length: 0.3, rise: 0.8}\n"
    )
    with pytest.raises(ValueError, match="must keep the cable taut; its pull falls to"):
        load_flight(str(tmp_path / "led.yaml"))


LATE = "effects: [{effect: suspended_payload, onset: 2.0, parameters: {mass: 0.2, length: 0.8}}]"


@pytest.mark.parametrize(
    "more, told",
    [
        ("events: [{kind: release, time: 3.0}]", "released at 3 s"),
        (f"reality: {{payload: {{tether: none}}, {LATE}}}", "hung on at 2 s"),
    ],
)
def test_a_payload_that_leads_must_hang_all_the_time(more, told, tmp_path, capsys):
    (tmp_path / "led.yaml").write_text(f"reference: {{follow: payload}}\n{more}\n")
    assert run(["fly", str(tmp_path / "led.yaml"), "--controller", "hold"]) == 2
    error = capsys.readouterr().err
    assert (
        f"follow: payload needs a payload that hangs all the time; it is {told}. Follow the vehicle"
        in error
    )
    assert error.count("\n") == 1


def test_a_payload_that_leads_may_get_heavier_and_be_pushed(tmp_path):
    events = (
        "[{kind: attach, time: 1.0, mass: 0.05}, {kind: impulse, time: 1.5, impulse: [0.01, 0, 0]}]"
    )
    (tmp_path / "led.yaml").write_text(f"reference: {{follow: payload}}\nevents: {events}\n")
    assert load_flight(str(tmp_path / "led.yaml")).follows_payload
