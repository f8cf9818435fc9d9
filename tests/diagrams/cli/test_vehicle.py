"""Laws of `np-drake vehicle` and of --vehicle with a name."""

import dataclasses as dc

import pytest

from diagrams.cli.main import run
from np_drake.vehicle.text import save_vehicle
from np_drake.vehicle.vehicle import load_vehicle

MEASURES = "--mass 20 --wheelbase 1.4 --propeller 0.72 --hover-throttle 0.5 --order px4"


def test_new_writes_a_file_that_every_verb_takes(tmp_path, capsys):
    out = tmp_path / "lifter.yaml"
    assert run(["vehicle", "new", *MEASURES.split(), "--name", "lifter", "--out", str(out)]) == 0
    assert load_vehicle(out).name == "lifter"
    assert run(["fly", "circle", "--vehicle", str(out), "--duration", "0.2"]) == 0
    assert "controller: hold" in capsys.readouterr().out


def test_a_file_is_copied_with_another_mass_and_what_is_said_of_others(tmp_path, capsys):
    file, out = tmp_path / "found.yaml", tmp_path / "heavy.yaml"
    said = {
        "sources": {"mass": "weighed"},
        "intervals": {"mass": [[0.026, 0.028]], "thrust_coefficient": [[2e-8, 3e-8]]},
    }
    known = dc.replace(load_vehicle("crazyflie"), thrust_uncertainty=0.01, **said)
    save_vehicle(known, file)
    assert run(["vehicle", "new", "--preset", str(file), "--mass", "0.03", "--out", str(out)]) == 0
    dut = load_vehicle(out)
    assert dut == dc.replace(known, mass=0.03)
    assert dut.intervals == {"thrust_coefficient": [[2e-8, 3e-8]]}
    assert "0.028 kg" in dut.sources["mass"]
    assert run(["vehicle", "new", "--preset", "nowhere", "--out", str(out)]) == 2
    assert "no preset; the presets are crazyflie" in capsys.readouterr().err


def test_show_says_where_each_value_comes_from(tmp_path, capsys):
    out = tmp_path / "mine.yaml"
    out.write_text(
        "mass: 1.5\nthrust_coefficient: 1.0e-5\ncalibration: {command_delay: 0.01}\n"
        "sources: {thrust_coefficient: identified from 3 flights, 'inertia[0][1]': 'prior: "
        "no roll'}\n"
        "intervals: {thrust_coefficient: [[0.99e-5, 1.02e-5]]}\n"
    )
    assert run(["vehicle", "show", str(out)]) == 0
    said = capsys.readouterr().out.splitlines()
    dut = {line.split()[0]: line for line in said if line.strip()}
    assert dut["mass"].split() == ["mass", "1.5", "kg", "file"]
    assert dut["calibration.command_delay"].split()[1:] == ["0.01", "s", "file"]
    assert dut["calibration.clock_offset"].endswith("default")
    assert dut["max_rotor_thrust"].split()[1:] == ["12", "N", "default"]
    assert "9.9e-06 …" in dut["thrust_coefficient"]
    assert "identified" in dut["thrust_coefficient"]
    assert dut["inertia[0][1]"].split()[1:] == ["0", "kg·m²", "prior:", "no", "roll"]
    assert not any(field.startswith("measurement_noise") for field in dut)


@pytest.mark.parametrize(
    "start", [MEASURES.split(), ("--preset", "crazyflie")], ids=["measures", "preset"]
)
@pytest.mark.parametrize("name", [r"\1 \g<0>", "null", "a: b # c", "a\ngravity: 1", "飞机"])
def test_new_writes_any_name_as_its_reader_reads_it(start, name, tmp_path):
    out = tmp_path / "mine.yaml"
    assert run(["vehicle", "new", *start, "--name", name, "--out", str(out)]) == 0
    assert load_vehicle(out).name == name
