"""Laws of how a verb opens its flights."""

from diagrams.cli.flights import open_flights
from np_drake.logs.neurobem import RACE_TRACK

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
