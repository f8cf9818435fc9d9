"""SDF files: as Drake's parser reads them, and flown in Drake under the forces of Gazebo's plugins.

Drake's parser is the library sdformat itself; its Python bindings are in no package registry.
Gazebo is not at hand: the plugins' forces are written here from their source (gz-sim,
MulticopterMotorModel.cc and Hydrodynamics.cc), not from the export.
"""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import BallRpyJoint
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import BasicVector, DiagramBuilder, LeafSystem

from diagrams.exports.sdf import write_sdf
from np_drake import attitude
from np_drake.effects.base import Motion
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.combine import mass_properties, total_wrench
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.rotor_inflow import RotorInflow
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle.vehicle import Vehicle, load_vehicle, preset_names
from systems.plant import spatial_inertia

AT_ONCE = 1e-4  # time constant below which a rotor follows its command [s]


def plugins(path: Path, name: str) -> list[dict[str, str]]:
    """Parameters of every plugin of that name, as text."""
    found = ElementTree.parse(path).getroot().iter("plugin")
    return [
        {e.tag: e.text or "" for e in p} for p in found if p.attrib["name"].endswith(f"::{name}")
    ]


def hydrodynamic_wrench(plugin: dict[str, str], velocity: np.ndarray) -> np.ndarray:
    """[force, torque] (6,) in the link's axes; velocity (6,) [u, v, w, p, q, r] relative to the
    current.
    """
    out = np.zeros(6)
    for i, x in enumerate("xyzkmn"):
        for j, u in enumerate("UVWPQR"):
            out[i] += float(plugin.get(x + u, 0)) * velocity[j]
            for k, v in enumerate("UVWPQR"):
                out[i] += float(plugin.get(x + u + v, 0)) * velocity[j] * velocity[k]
                out[i] += float(plugin.get(f"{x}{u}abs{v}", 0)) * velocity[j] * abs(velocity[k])
    return out


class GazeboForces(LeafSystem):
    """Rotor forces and hydrodynamics; input: rotor speeds (4,) [rad/s]; state: rotor speed."""

    def __init__(self, plant: MultibodyPlant, path: Path, speed: np.ndarray):
        super().__init__()
        self._plant = plant
        self._motors = plugins(path, "MulticopterMotorModel")
        self._air = plugins(path, "Hydrodynamics")
        self._command = self.DeclareVectorInputPort("command", 4)
        self._poses = self.DeclareAbstractInputPort("poses", Value[list[RigidTransform]]())
        self._velocities = self.DeclareAbstractInputPort(
            "velocities", Value[list[SpatialVelocity]]()
        )
        self.DeclareContinuousState(BasicVector(speed))
        self.DeclareAbstractOutputPort(
            "forces", Value[list[ExternallyAppliedSpatialForce]], self._calc
        )

    def DoCalcTimeDerivatives(self, context, derivatives):
        lag = np.array([float(m["timeConstantUp"]) for m in self._motors])
        most = np.array([float(m["maxRotVelocity"]) for m in self._motors])
        command = np.minimum(self._command.Eval(context), most)
        speed = context.get_continuous_state_vector().CopyToVector()
        derivatives.SetFromVector((command - speed) / lag if lag[0] > AT_ONCE else np.zeros(4))

    def _speed(self, context) -> np.ndarray:
        if float(self._motors[0]["timeConstantUp"]) > AT_ONCE:
            return context.get_continuous_state_vector().CopyToVector()
        return self._command.Eval(context)

    def _calc(self, context, output):
        poses, velocities = self._poses.Eval(context), self._velocities.Eval(context)
        speed, forces = self._speed(context), []

        def apply(link: str, f_B: np.ndarray, tau_B: np.ndarray) -> None:
            force = ExternallyAppliedSpatialForce()
            force.body_index = self._plant.GetBodyByName(link).index()
            R = poses[int(force.body_index)].rotation().matrix()
            force.F_Bq_W = SpatialForce(R @ tau_B, R @ f_B)
            forces.append(force)

        for motor in self._motors:
            thrust = float(motor["motorConstant"]) * speed[int(motor["motorNumber"])] ** 2
            turning = {"ccw": 1, "cw": -1}[motor["turningDirection"]]
            apply(motor["linkName"], np.array([0, 0, thrust]), np.zeros(3))
            apply(
                "quadrotor",
                np.zeros(3),
                np.array([0, 0, -turning * thrust * float(motor["momentConstant"])]),
            )
        for air in self._air:
            index = int(self._plant.GetBodyByName(air["link_name"]).index())
            R = poses[index].rotation().matrix()
            wind = np.array(air["default_current"].split(), float)
            through = np.concatenate(
                [
                    R.T @ (velocities[index].translational() - wind),
                    R.T @ velocities[index].rotational(),
                ]
            )
            wrench = hydrodynamic_wrench(air, through)
            apply(air["link_name"], wrench[:3], wrench[3:])
        output.set_value(forces)


def parsed(path: Path, gravity: float = 9.81) -> MultibodyPlant:
    """The continuous plant that Drake's parser makes of the file."""
    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels(str(path))
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -gravity])
    plant.Finalize()
    return plant


def fly_sdf(path: Path, flight) -> np.ndarray:
    """States (26, 13) of a gentle flight of the parsed model under the plugins' forces."""
    commands, period = flight.speeds, flight.period
    builder = DiagramBuilder()
    plant = builder.AddSystem(parsed(path))
    forces = builder.AddSystem(GazeboForces(plant, path, flight.first_speed))
    builder.ExportInput(forces.GetInputPort("command"), "command")
    builder.Connect(plant.get_body_poses_output_port(), forces.GetInputPort("poses"))
    builder.Connect(
        plant.get_body_spatial_velocities_output_port(), forces.GetInputPort("velocities")
    )
    builder.Connect(forces.get_output_port(), plant.get_applied_spatial_force_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    config = SimulatorConfig(
        integration_scheme="runge_kutta3", max_step_size=period, use_error_control=False
    )
    ApplySimulatorConfig(config, simulator)
    context = simulator.get_mutable_context()
    body, plant_context = plant.GetBodyByName("quadrotor"), plant.GetMyContextFromRoot(context)
    states = []
    for k in range(len(commands) + 1):
        if k % flight.rows == 0:
            X_WB, V_WB = (
                evaluate(plant_context, body)
                for evaluate in (plant.EvalBodyPoseInWorld, plant.EvalBodySpatialVelocityInWorld)
            )
            q = X_WB.rotation().ToQuaternion().wxyz()
            w_B = X_WB.rotation().matrix().T @ V_WB.rotational()
            states.append(np.concatenate([X_WB.translation(), q, V_WB.translational(), w_B]))
        if k < len(commands):
            diagram.GetInputPort("command").FixValue(context, commands[k])
            simulator.AdvanceTo((k + 1) * period)
    return np.array(states)


ROTORS = [f"rotor_{i}" for i in (1, 2, 3, 4)]
RIGID = [MassError(0.15), InertiaError(1.2, 0.9, 1.1), CenterOfMassOffset(0.01, -0.02, 0.005)]


def carried_inertia(plant: MultibodyPlant):
    """Spatial inertia of quadrotor and rotors together, about Bo in B."""
    context = plant.CreateDefaultContext()
    bodies = [plant.GetBodyByName(name).index() for name in ["quadrotor", *ROTORS]]
    return plant.CalcSpatialInertia(context, plant.GetFrameByName("quadrotor"), bodies)


@pytest.mark.parametrize("preset", preset_names())
def test_body_and_rotors_together_have_the_corrected_mass_properties(preset, tmp_path):
    vehicle = load_vehicle(preset)
    arm = np.abs(vehicle.rotor_positions).max()
    effects = [
        MassError(0.07 * vehicle.mass),
        InertiaError(1.2, 0.9, 1.1),
        CenterOfMassOffset(0.1 * arm, 0, 0),
    ]
    write_sdf(vehicle, effects, tmp_path / "dut.sdf")
    expected = spatial_inertia(mass_properties(vehicle, effects)).CopyToFullMatrix6()
    dut = carried_inertia(parsed(tmp_path / "dut.sdf")).CopyToFullMatrix6()
    np.testing.assert_allclose(dut, expected, atol=1e-12 * vehicle.mass)  # 15 digits in the file


def test_rotors_stand_where_thrust_acts_and_turn_against_their_torque(tmp_path):
    vehicle = Vehicle()
    write_sdf(vehicle, [WeakRotor(2, 0.8)], tmp_path / "dut.sdf")
    plant = parsed(tmp_path / "dut.sdf")
    context = plant.CreateDefaultContext()
    motors = plugins(tmp_path / "dut.sdf", "MulticopterMotorModel")
    for i, (motor, place) in enumerate(zip(motors, vehicle.rotor_positions, strict=True)):
        pose = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(motor["linkName"]))
        np.testing.assert_allclose(pose.translation(), place, atol=1e-12)
        assert motor["turningDirection"] == ("cw" if vehicle.rotor_directions[i] > 0 else "ccw")
        share = 0.8 if i == 1 else 1.0
        assert float(motor["motorConstant"]) == pytest.approx(
            share * vehicle.thrust_coefficient, rel=1e-12
        )
        assert plant.GetJointByName(motor["jointName"]).num_velocities() == 1


def test_rotors_with_mixer_gain_have_its_torque(tmp_path):
    vehicle, gain = Vehicle(), MixerGain(0.7, 0.8, 0.9)
    write_sdf(vehicle, [gain], tmp_path / "dut.sdf")
    plant = parsed(tmp_path / "dut.sdf")
    context, torque = plant.CreateDefaultContext(), np.zeros(3)
    thrust = np.array([5.0, 4.0, 6.0, 3.0])
    for f, motor in zip(
        thrust, plugins(tmp_path / "dut.sdf", "MulticopterMotorModel"), strict=True
    ):
        place = plant.EvalBodyPoseInWorld(
            context, plant.GetBodyByName(motor["linkName"])
        ).translation()
        turning = {"ccw": 1, "cw": -1}[motor["turningDirection"]]
        torque += np.cross(place, [0, 0, f]) - [0, 0, turning * f * float(motor["momentConstant"])]
    motion = Motion(0.0, np.array([0.0, 0, 0, 1, *np.zeros(9)]), thrust)
    expected = (vehicle.mixer @ thrust)[1:] + gain.wrench(vehicle, motion)[3:]
    np.testing.assert_allclose(torque, expected, atol=1e-12)  # [N·m]


AIR = [
    [
        QuadraticDrag(0.05, 0.06, 0.07),
        BladeFlapping(0.03),
        TranslationalLift(0.04),
        ConstantWind(1, -2, 0.5),
    ],
    [LinearDrag(0.3, 0.2, 0.25), MassError(0.2), ConstantWind(1, -2, 0.5)],
]


@pytest.mark.parametrize("effects", AIR, ids=["exact", "linear drag in hover"])
def test_the_air_plugin_has_the_wrench_of_the_effects(effects, tmp_path):
    vehicle, rng = Vehicle(), np.random.default_rng(0)
    write_sdf(vehicle, effects, tmp_path / "dut.sdf")
    (air,) = plugins(tmp_path / "dut.sdf", "Hydrodynamics")
    mass = vehicle.mass + sum(e.delta_mass for e in effects if isinstance(e, MassError))
    for _ in range(20):
        q = rng.normal(size=4)
        x = np.concatenate([np.zeros(3), q / np.linalg.norm(q), rng.normal(size=6)])
        motion = Motion(0.0, x, np.full(4, mass * vehicle.gravity / 4))
        chi = total_wrench(vehicle, [e for e in effects if not isinstance(e, MassError)], motion)
        R = attitude.rotation_matrix(x[3:7])
        wind = np.array(air["default_current"].split(), float)
        wrench = hydrodynamic_wrench(air, np.concatenate([R.T @ (x[7:10] - wind), x[10:]]))
        np.testing.assert_allclose(
            np.concatenate([R @ wrench[:3], wrench[3:]]), chi, atol=1e-12
        )  # [N, N·m]


def test_inflow_has_its_slope_in_climb_about_hover(tmp_path):
    vehicle, inflow, climb = Vehicle(), RotorInflow(0.6), 1e-4  # [m/s]
    write_sdf(vehicle, [inflow], tmp_path / "dut.sdf")
    (air,) = plugins(tmp_path / "dut.sdf", "Hydrodynamics")
    x = np.array([0.0, 0, 0, 1, 0, 0, 0, 0, 0, climb, 0, 0, 0])
    chi = inflow.wrench(vehicle, Motion(0.0, x, np.full(4, vehicle.mass * vehicle.gravity / 4)))
    assert float(air["zW"]) == pytest.approx(
        chi[2] / climb, rel=1e-4
    )  # the next term is climb / 8 v_h


def test_the_payload_hangs_from_the_hook_at_the_length_of_the_tether(tmp_path):
    payload = SuspendedPayload(mass=0.3, length=0.7, hook_x=0.02, hook_y=-0.01, hook_z=-0.05)
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
    vehicle, effect = Vehicle(), RotorGyroscopic(6e-5)
    account = write_sdf(vehicle, [effect], tmp_path / "dut.sdf")
    assert account[0].how == "exact"
    plant = parsed(tmp_path / "dut.sdf")
    context, thrust = plant.CreateDefaultContext(), np.array([5.0, 4.0, 6.0, 3.0])
    for f, motor in zip(
        thrust, plugins(tmp_path / "dut.sdf", "MulticopterMotorModel"), strict=True
    ):
        assert float(motor["rotorVelocitySlowdownSim"]) == 1.0
        turning = {"ccw": 1, "cw": -1}[motor["turningDirection"]]
        speed = turning * np.sqrt(f / float(motor["motorConstant"]))
        plant.GetJointByName(motor["jointName"]).set_angular_rate(context, speed)
    h = plant.CalcSpatialMomentumInWorldAboutPoint(context, np.zeros(3)).rotational()
    w = np.array([0.3, -0.2, 0.1])
    x = np.concatenate([[0.0, 0, 0, 1, 0, 0, 0, 0, 0, 0], w])
    chi = effect.wrench(vehicle, Motion(0.0, x, thrust))
    np.testing.assert_allclose(-np.cross(w, h), chi[3:], rtol=1e-9, atol=1e-15)  # [N·m]


def test_a_rotor_inertia_that_no_link_can_have_is_left_out_or_refused(tmp_path):
    assert write_sdf(Vehicle(), [RotorGyroscopic(-1e-5)], tmp_path / "a.sdf")[0].how == "left out"
    with pytest.raises(ValueError, match="rotor links must leave a rigid body"):
        write_sdf(load_vehicle("crazyflie"), [RotorGyroscopic(1e-4)], tmp_path / "b.sdf")
    assert not (tmp_path / "b.sdf").exists()


# Position [m], attitude [rad]: the free rotor links take 1e-5 of the yaw inertia and drift against
# the body; linear drag at constant rotor speed is wrong by the 2 % of its sway; the rod does not
# stretch, but its sphere turns with it, whose inertia is 6e-4 of m L², and which a cable would
# leave level.
FLIGHTS = {
    "nominal": (2e-5, 5e-6),
    "exact": (2e-5, 5e-6),
    "lag": (2e-5, 5e-6),
    "drag": (5e-3, 5e-6),
    "all": (5e-3, 5e-6),
    "payload": (3e-3, 3e-4),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_of_the_parsed_model_is_that_of_drake(name, gentle, tmp_path):
    flight = gentle.Flight(gentle.effects[name])
    write_sdf(flight.vehicle, flight.effects, tmp_path / "dut.sdf")
    expected = flight.drake()
    assert np.linalg.norm(expected[-1, :3]) > 5.0  # it flew [m]
    position, turn = gentle.furthest(fly_sdf(tmp_path / "dut.sdf", flight), expected)
    assert position < FLIGHTS[name][0]
    assert turn < FLIGHTS[name][1]
