"""Laws of the shape of an exported vehicle: it is seen, it collides, and it weighs nothing."""

from xml.etree import ElementTree

import numpy as np
import pytest
from pydrake.geometry import SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from diagrams.cli.main import run
from diagrams.exports.mujoco_xml import write_mujoco
from diagrams.exports.sdf import write_sdf
from diagrams.exports.shapes import hull
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle.vehicle import Vehicle, load_vehicle, preset_names

FLOOR = '<geom name="floor" type="plane" size="5 5 0.1" pos="0 0 -0.5"/><body name="quadrotor">'


@pytest.mark.parametrize("name", preset_names())
def test_the_box_that_collides_reaches_as_far_as_the_rotors(name):
    vehicle = load_vehicle(name)
    box, p = hull(vehicle), np.array(vehicle.rotor_positions, float)
    assert np.all(
        np.abs(p - box.center)[:, :2] + vehicle.rotor_radius <= 0.5 * box.size[:2] + 1e-12
    )
    assert np.all(np.abs(box.center) <= 0.5 * box.size)  # Bo lies within
    assert box.size.min() > 0


def test_drake_sees_every_part_of_the_sdf_file(tmp_path):
    write_sdf(Vehicle(), [SuspendedPayload(0.2, 0.7)], tmp_path / "dut.sdf")
    plant, scene = MultibodyPlant(time_step=0.001), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene)
    Parser(plant).AddModels(str(tmp_path / "dut.sdf"))
    links = ("quadrotor", "payload", *(f"rotor_{i}" for i in range(1, 5)))
    seen = {
        link: len(plant.GetVisualGeometriesForBody(plant.GetBodyByName(link))) for link in links
    }
    felt = {
        link: len(plant.GetCollisionGeometriesForBody(plant.GetBodyByName(link))) for link in links
    }
    assert seen == {"quadrotor": 5, "payload": 1} | {f"rotor_{i}": 1 for i in range(1, 5)}
    assert felt == {"quadrotor": 1, "payload": 1} | {f"rotor_{i}": 0 for i in range(1, 5)}


def test_a_vehicle_without_thrust_comes_to_rest_on_mujocos_floor(tmp_path):
    mujoco = pytest.importorskip(
        "mujoco", reason="MuJoCo is not installed: pip install 'np_drake[exports]'"
    )
    path = tmp_path / "dut.xml"
    write_mujoco(Vehicle(), [], path)
    path.write_text(path.read_text().replace('<body name="quadrotor">', FLOOR))
    dut = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(dut)
    for _ in range(1500):  # 3 s
        mujoco.mj_step(dut, data)
    assert data.qpos[2] == pytest.approx(
        -0.5 + 0.5 * hull(Vehicle()).size[2], abs=2e-3
    )  # [m], the floor is soft
    assert np.linalg.norm(data.qvel) < 1e-2
    assert dut.body_mass.sum() == pytest.approx(Vehicle().mass)


@pytest.mark.parametrize("form, shapes", [("sdf", {"collision", "visual"}), ("mujoco", {"geom"})])
def test_the_account_says_that_there_is_a_shape(form, shapes, tmp_path, capsys):
    out = tmp_path / "dut"
    assert run(["export", "paper", "--format", form, "--out", str(out)]) == 0
    assert "shape: approximate" in capsys.readouterr().out
    assert shapes <= {element.tag for element in ElementTree.parse(out).iter()}
