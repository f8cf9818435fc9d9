"""SDF files as Drake's parser, which is the library sdformat itself, reads them.

Gazebo is not at hand: the plugins' forces are written here from their source (gz-sim,
MulticopterMotorModel.cc and Hydrodynamics.cc), not from the export.
"""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BallRpyJoint

from diagrams.exports.formats import write_sdf
from np_drake import attitude
from np_drake import effects as fx
from np_drake.effects.base import Motion
from np_drake.effects.combine import mass_properties, total_wrench
from np_drake.effects.uneven_lag import UnevenLag
from np_drake.vehicle.vehicle import Vehicle, load_vehicle, preset_names
from systems.plant import spatial_inertia


def plugins(path: Path, name: str) -> list[dict[str, str]]:
    """Parameters of every plugin of that name, as text."""
    found = ElementTree.parse(path).getroot().iter("plugin")
    return [
        {e.tag: e.text or "" for e in p} for p in found if p.attrib["name"].endswith(f"::{name}")
    ]


def hydrodynamic_wrench(plugin: dict[str, str], velocity: np.ndarray) -> np.ndarray:
    """[force, torque] (6,) in the link's axes; velocity (6,) relative to the current."""
    out = np.zeros(6)
    for i, x in enumerate("xyzkmn"):
        for j, u in enumerate("UVWPQR"):
            out[i] += float(plugin.get(x + u, 0)) * velocity[j]
            for k, v in enumerate("UVWPQR"):
                out[i] += float(plugin.get(x + u + v, 0)) * velocity[j] * velocity[k]
                out[i] += float(plugin.get(f"{x}{u}abs{v}", 0)) * velocity[j] * abs(velocity[k])
    return out


def parsed(path: Path, gravity: float = 9.81) -> MultibodyPlant:
    """The continuous plant that Drake's parser makes of the file."""
    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels(str(path))
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -gravity])
    plant.Finalize()
    return plant


ROTORS = [f"rotor_{i}" for i in (1, 2, 3, 4)]


@pytest.mark.parametrize("preset", preset_names())
def test_body_and_rotors_together_have_the_corrected_mass_properties(preset, tmp_path):
    vehicle = load_vehicle(preset)
    offset = fx.CenterOfMassOffset(0.1 * np.abs(vehicle.rotor_positions).max(), 0, 0)
    effects = [fx.MassError(0.07 * vehicle.mass), fx.InertiaError(1.2, 0.9, 1.1), offset]
    write_sdf(vehicle, effects, tmp_path / "dut.sdf")
    expected = spatial_inertia(mass_properties(vehicle, effects)).CopyToFullMatrix6()
    plant = parsed(tmp_path / "dut.sdf")
    links = [plant.GetBodyByName(name).index() for name in ["quadrotor", *ROTORS]]
    frame = plant.GetFrameByName("quadrotor")
    dut = plant.CalcSpatialInertia(plant.CreateDefaultContext(), frame, links)
    # 15 digits are in the file.
    np.testing.assert_allclose(dut.CopyToFullMatrix6(), expected, atol=1e-12 * vehicle.mass)


def test_rotors_with_mixer_gain_have_its_torque_and_a_weak_one_its_share(tmp_path):
    vehicle, gain = Vehicle(), fx.MixerGain(0.7, 0.8, 0.9)
    write_sdf(vehicle, [gain, fx.WeakRotor(2, 0.8)], tmp_path / "dut.sdf")
    plant = parsed(tmp_path / "dut.sdf")
    context, torque = plant.CreateDefaultContext(), np.zeros(3)
    thrust = np.array([5.0, 4.0, 6.0, 3.0])
    motors = plugins(tmp_path / "dut.sdf", "MulticopterMotorModel")
    for f, motor in zip(thrust, motors, strict=True):
        link = plant.GetBodyByName(motor["linkName"])
        place = plant.EvalBodyPoseInWorld(context, link).translation()
        turning = {"ccw": 1, "cw": -1}[motor["turningDirection"]]
        torque += np.cross(place, [0, 0, f]) - [0, 0, turning * f * float(motor["momentConstant"])]
        share = 0.8 if motor["motorNumber"] == "1" else 1.0
        constant = share * vehicle.thrust_coefficient
        assert float(motor["motorConstant"]) == pytest.approx(constant, rel=1e-12)
    motion = Motion(0.0, np.array([0.0, 0, 0, 1, *np.zeros(9)]), thrust)
    expected = (vehicle.mixer @ thrust)[1:] + gain.wrench(vehicle, motion)[3:]
    np.testing.assert_allclose(torque, expected, atol=1e-12)  # [N·m]


def test_a_rotor_lags_both_ways_and_has_the_speed_of_the_largest_thrust(tmp_path):
    vehicle = Vehicle()
    for effects, up, down in (([UnevenLag(0.04, 0.06)], 0.04, 0.06), ([], 1e-6, 1e-6)):
        write_sdf(vehicle, [*effects, fx.ThrustScale(0.9)], tmp_path / "dut.sdf")
        for motor in plugins(tmp_path / "dut.sdf", "MulticopterMotorModel"):
            assert (float(motor["timeConstantUp"]), float(motor["timeConstantDown"])) == (up, down)
            most = float(motor["motorConstant"]) * float(motor["maxRotVelocity"]) ** 2
            assert most == pytest.approx(0.9 * vehicle.max_rotor_thrust)


WIND = fx.ConstantWind(1, -2, 0.5)
AIR = [
    [fx.QuadraticDrag(0.05, 0.06, 0.07), fx.BladeFlapping(0.03), fx.TranslationalLift(0.04), WIND],
    [fx.LinearDrag(0.3, 0.2, 0.25), fx.MassError(0.2), WIND],
]


@pytest.mark.parametrize("effects", AIR, ids=["exact", "linear drag in hover"])
def test_the_air_plugin_has_the_wrench_of_the_effects(effects, tmp_path):
    vehicle, rng = Vehicle(), np.random.default_rng(0)
    write_sdf(vehicle, effects, tmp_path / "dut.sdf")
    (air,) = plugins(tmp_path / "dut.sdf", "Hydrodynamics")
    mass = vehicle.mass + sum(e.delta_mass for e in effects if isinstance(e, fx.MassError))
    for _ in range(20):
        q = rng.normal(size=4)
        x = np.concatenate([np.zeros(3), q / np.linalg.norm(q), rng.normal(size=6)])
        motion = Motion(0.0, x, np.full(4, mass * vehicle.gravity / 4))
        chi = total_wrench(vehicle, [e for e in effects if not isinstance(e, fx.MassError)], motion)
        R = attitude.rotation_matrix(x[3:7])
        wind = np.array(air["default_current"].split(), float)
        wrench = hydrodynamic_wrench(air, np.concatenate([R.T @ (x[7:10] - wind), x[10:]]))
        found = np.concatenate([R @ wrench[:3], wrench[3:]])
        np.testing.assert_allclose(found, chi, atol=1e-12)  # [N, N·m]


def test_the_payload_hangs_from_the_hook_at_the_length_of_the_tether(tmp_path):
    payload = fx.SuspendedPayload(mass=0.3, length=0.7, hook_x=0.02, hook_y=-0.01, hook_z=-0.05)
    write_sdf(Vehicle(), [payload], tmp_path / "dut.sdf")
    plant = parsed(tmp_path / "dut.sdf")
    joint, body = plant.GetJointByName("tether"), plant.GetBodyByName("payload")
    assert isinstance(joint, BallRpyJoint)
    hook = joint.frame_on_parent().GetFixedPoseInBodyFrame().translation()
    top = joint.frame_on_child().GetFixedPoseInBodyFrame().translation()
    np.testing.assert_allclose(hook, [0.02, -0.01, -0.05], atol=1e-12)
    np.testing.assert_allclose(top, [0, 0, 0.7], atol=1e-12)
    assert body.default_mass() == 0.3
    assert joint.parent_body().name() == "quadrotor"


def test_turning_rotor_links_have_the_angular_momentum_of_the_effect(tmp_path):
    vehicle, effect = Vehicle(), fx.RotorGyroscopic(6e-5)
    account = write_sdf(vehicle, [effect], tmp_path / "dut.sdf")
    assert account[0].how == "exact"
    plant = parsed(tmp_path / "dut.sdf")
    context, thrust = plant.CreateDefaultContext(), np.array([5.0, 4.0, 6.0, 3.0])
    motors = plugins(tmp_path / "dut.sdf", "MulticopterMotorModel")
    for f, motor in zip(thrust, motors, strict=True):
        assert float(motor["rotorVelocitySlowdownSim"]) == 1.0
        turning = {"ccw": 1, "cw": -1}[motor["turningDirection"]]
        speed = turning * np.sqrt(f / float(motor["motorConstant"]))
        plant.GetJointByName(motor["jointName"]).set_angular_rate(context, speed)
    h = plant.CalcSpatialMomentumInWorldAboutPoint(context, np.zeros(3)).rotational()
    w = np.array([0.3, -0.2, 0.1])
    x = np.concatenate([[0.0, 0, 0, 1, 0, 0, 0, 0, 0, 0], w])
    chi = effect.wrench(vehicle, Motion(0.0, x, thrust))
    np.testing.assert_allclose(-np.cross(w, h), chi[3:], rtol=1e-9, atol=1e-15)  # [N·m]
