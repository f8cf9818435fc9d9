"""Laws of flights along the track of a CSV file."""

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.loop.flight import FlightConfig, load_flight
from diagrams.loop.flight_result import fly
from np_drake.references.config import ReferenceConfig, make_reference
from np_drake.references.track_file import write_trajectory

LINE = "x,y,z\n0,0,1.5\n1,0,1.5\n1,1,2\n0,1,2\n"
SQUARE = "x,y,z\n1,1,1.5\n-1,1,1.5\n-1,-1,2\n1,-1,2\n1,1,1.5\n"
UP = "x,y,z\n0,0,1.5\n0,0,9\n"


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


def test_a_track_with_an_end_gives_the_flight_its_duration(tmp_path):
    config = load_flight(scenario(tmp_path))
    assert config.end == pytest.approx(make_reference(config.reference).end)
    assert load_flight(scenario(tmp_path, more="duration: 3.0\n")).duration == 3.0
    assert load_flight(scenario(tmp_path, SQUARE)).duration == FlightConfig().duration  # closed


def test_a_trajectory_that_begins_at_rest_is_scored_from_the_first_row(tmp_path):
    motion = make_reference(ReferenceConfig(track="lemniscate", ramp=2.0, speed=1.0))
    write_trajectory(motion, tmp_path / "track.csv", duration=1.5)
    config = load_flight(scenario(tmp_path, ""))
    flight = fly(config, seed=0)
    assert flight.scored.all()
    assert config.end == pytest.approx(1.5)
    expected = motion.sample(flight.signals["t"])[0]
    np.testing.assert_allclose(flight.signals["p_ref"], expected, atol=1e-6)  # microsecond later
    assert flight.metrics()["E_xy"] < 0.05
    assert flight.metrics()["solve_failures"] == 0


BAD = {  # track, further lines, fields of the reference: what the line says
    "scaled": (LINE, "scaled: true\n", "", "scaled must be false for the track of a CSV file"),
    "speed": (LINE, "", "speed: 9.0, ramp: 0.1", "must be within controller.mpc.max_speed"),
    "tilt": (LINE, "", "speed: 2.5, ramp: 1.0", "must be within controller.mpc.max_tilt, 0.9 rad"),
    "rotors": (UP, "", "speed: 5.5, ramp: 0.6", "track.csv: must be within max_rotor_thrust, 12 N"),
    "below": ("x,y,z\n0,0,3\n1,0,.05\n2,0,.05\n3,0,3\n", "", "", "must stay above the ground"),
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


@pytest.mark.parametrize(
    "fields, message",
    [
        # v²/r, while 48 N on 2.26 kg are 21 m/s²
        (
            ["speed=6", "radius=0.6"],
            "max_rotor_thrust, 12 N; demands 45.1 N of a rotor for 60 m/s²",
        ),
        (["speed=2.8", "radius=0.6"], "be within controller.mpc.max_tilt, 0.9 rad"),
        (["radius=51"], "stay within 50 m of the origin; is 51"),
    ],
)
def test_a_track_by_name_is_checked_as_one_of_a_file(capsys, fields, message):
    changed = [word for field in fields for word in ("--set", f"reference.{field}")]
    assert run(["fly", "circle", *changed, "--duration", "1", "--controller", "hold"]) == 2
    err = capsys.readouterr().err
    assert "circle: must" in err
    assert message in err
    assert len(err.splitlines()) == 1


def test_waypoints_are_flown_and_those_that_are_not_passed_are_named(tmp_path):
    path = scenario(tmp_path, LINE, "duration: 5.0\n", "speed: 1.0, corners: stop, rest: 0.1")
    flight = fly(load_flight(path), seed=0)
    assert flight.warnings() == []
    assert flight.metrics()["E_xy"] < 0.05
    assert max(flight.metrics()["waypoint_distances"]) < 0.05  # [m]
    flight.config.reference.within = 1e-4
    (said,) = flight.warnings()
    assert "the flight with hold does not come within 0.0001 m of waypoints" in said
