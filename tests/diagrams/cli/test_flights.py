"""Laws of how a verb opens its flights."""

import pytest

from diagrams.cli.train import open_flights
from np_drake.logs.formats.neurobem_wrenches import RACE_TRACK

VEHICLE = "name: mine\nmass: 2.5\n"


def test_a_log_is_labelled_with_the_given_vehicle_or_the_papers(logs, tmp_path):
    (tmp_path / "vehicle.yaml").write_text(VEHICLE)
    assert [flight.vehicle.name for flight in open_flights(logs, None)] == ["paper", "paper"]
    (dut,) = open_flights(logs[:1], tmp_path / "vehicle.yaml")
    assert dut.vehicle.mass == 2.5
    assert dut.frame == "world"


def test_a_real_flight_is_labelled_with_the_published_vehicle(neurobem, capsys):
    (dut,) = open_flights([neurobem / "csv" / f"{RACE_TRACK}.csv"], None)
    assert dut.vehicle.name == "neurobem"
    assert "rotor_speed" in capsys.readouterr().out
    (array,) = open_flights([neurobem / "npy" / f"{RACE_TRACK}.npy"], None)
    assert array.frame == "body"


def test_nothing_is_flown_before_every_file_is_open(logs, tmp_path, monkeypatch):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text("duration: 0.5\n")
    (tmp_path / "bad.csv").write_text("t,px\n0,1\n")
    (tmp_path / "bad.yaml").write_text("duration: none\n")
    monkeypatch.setattr("diagrams.cli.train.fly_all", lambda *_: pytest.fail("flown"))
    for bad in ("bad.csv", "bad.yaml"):
        with pytest.raises(ValueError, match=bad):
            open_flights([scenario, tmp_path / bad], None)


def test_flights_stand_in_the_order_of_their_files(logs, tmp_path):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text("duration: 0.5\n")
    dut = open_flights([scenario, logs[0]], None)
    assert [len(flight.data) == 1500 for flight in dut] == [False, True]  # rows of the log
