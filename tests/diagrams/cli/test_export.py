"""Laws of `np-drake export`."""

from xml.etree import ElementTree

import pytest

from diagrams.cli.main import run
from diagrams.cli.vehicle import NAMES


@pytest.mark.parametrize("form", NAMES)
def test_a_preset_is_written_in_every_format(form, tmp_path, capsys):
    out = tmp_path / "dut"
    assert run(["export", "crazyflie", "--format", form, "--out", str(out)]) == 0
    assert ElementTree.parse(out).getroot().tag == {"sdf": "sdf", "mujoco": "mujoco"}[form]
    assert f"{form}: " in " ".join(capsys.readouterr().out.split())


def test_a_vehicle_file_is_written_and_never_overwritten(tmp_path, capsys):
    mine = tmp_path / "mine.yaml"
    mine.write_text("name: mine\nmass: 1.5\n")
    assert (
        run(["export", str(mine), "--format", "mujoco", "--out", str(tmp_path / "mine.xml")]) == 0
    )
    assert 'mass="1.5"' in (tmp_path / "mine.xml").read_text()
    capsys.readouterr()
    other_name = tmp_path / "." / "mine.yaml"
    assert run(["export", str(mine), "--format", "sdf", "--out", str(other_name)]) == 2
    assert "must not be a file that is read" in capsys.readouterr().err
    (tmp_path / "link.yaml").symlink_to(mine)
    assert run(["export", str(mine), "--format", "sdf", "--out", str(tmp_path / "link.yaml")]) == 2
    assert mine.read_text() == "name: mine\nmass: 1.5\n"


def test_a_scenario_is_exported_with_its_effects(tmp_path, capsys):
    scenario, out = tmp_path / "mine.yaml", tmp_path / "mine.xml"
    scenario.write_text(
        "name: mine\nreality:\n  payload: {tether: none}\n  effects:\n"
        "  - {effect: mass_error, parameters: {delta_mass: 0.2}, onset: 3.0}\n"
    )
    assert run(["export", str(scenario), "--format", "mujoco", "--out", str(out)]) == 0, (
        capsys.readouterr().err
    )
    told = capsys.readouterr()
    assert "mass_error" in told.out
    assert "mass_error: begins at 3 s in the scenario" in told.out + told.err
    assert 'mass="2.2' in out.read_text()
