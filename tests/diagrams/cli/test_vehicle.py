"""Laws of `np-drake vehicle` and of --vehicle with a name."""

import pytest

from diagrams.cli.main import run
from np_drake.vehicle import load_vehicle, preset_names


def test_new_writes_a_file_that_every_verb_takes(tmp_path, capsys):
    out = tmp_path / "lifter.yaml"
    measures = ["--mass", "20", "--wheelbase", "1.4", "--propeller", "0.72", "--hover-throttle", "0.5"]
    assert run(["vehicle", "new", *measures, "--name", "lifter", "--out", str(out)]) == 0
    assert load_vehicle(out).name == "lifter"
    assert run(["fly", "circle", "--vehicle", str(out), "--duration", "0.2"]) == 0
    assert "controller: hold" in capsys.readouterr().out


def test_new_without_out_prints_the_file(capsys, tmp_path):
    assert run(["vehicle", "new", "--preset", "crazyflie", "--mass", "0.035"]) == 0
    (tmp_path / "mine.yaml").write_text(capsys.readouterr().out)
    dut, preset = load_vehicle(tmp_path / "mine.yaml"), load_vehicle("crazyflie")
    assert dut == preset.with_mass(0.035)


@pytest.mark.parametrize(
    "arguments, text",
    [
        (["--mass", "1"], "--wheelbase"),
        (["--preset", "nobody"], "crazyflie, hummingbird"),
        (["--preset", "crazyflie", "--mass", "1"], "max_rotor_thrust"),
        (["--preset", "crazyflie", "--propeller", "0.1"], "--propeller"),
        (
            ["--mass", "1", "--wheelbase", "0.4", "--propeller", "0.2", "--hover-throttle", "50"],
            "0.05 to 0.95",
        ),
    ],
)
def test_bad_measures_are_one_line(arguments, text, capsys):
    assert run(["vehicle", "new", *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert text in error
    assert "\n" not in error


def test_list_names_every_preset(capsys):
    assert run(["vehicle", "list"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in preset_names())


def test_show_prints_source_and_default_flight(capsys):
    assert run(["vehicle", "show", "crazyflie"]) == 0
    printed = capsys.readouterr().out
    assert "Förster" in printed
    assert "control period" in printed
