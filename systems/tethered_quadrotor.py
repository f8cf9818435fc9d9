"""The quadrotor with its payload: plant, rotors, tether and whatever the nominal model leaves out."""

import dataclasses as dc

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant, Propeller, PropellerInfo
from pydrake.multibody.tree import FixedOffsetFrame, SpatialInertia, UnitInertia, UniversalJoint
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder, MatrixGain, Saturation

from np_drake.effects.base import ActuatorEffect, WrenchEffect
from np_drake.effects.motor_lag import MotorLag
from np_drake.vehicle import Vehicle
from systems.actuator_effects import ActuatorEffects
from systems.cable import Cable
from systems.plant_readings import BodyAcceleration, RodWrench, VehicleState
from systems.wrench_effects import WrenchEffects


@dc.dataclass
class PayloadConfig:
    """The payload and what it hangs on."""

    tether: str = "cable"  # cable | rod | none
    mass: float = 0.26  # [kg]
    length: float = 0.8  # [m]
    hook: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, -0.025])  # p_BoTo_B [m]
    radius: float = 0.03  # of the solid sphere that the payload is [m]
    stiffness: float = 2.0e4  # of the cable [N/m]
    damping: float = 40.0  # of the cable [N·s/m]

    def check(self) -> "PayloadConfig":
        """Returns self; raises ValueError on an unknown tether or an impossible size."""
        if self.tether not in ("cable", "rod", "none"):
            raise ValueError(f"PayloadConfig: tether must be cable, rod or none; got {self.tether!r}.")
        for name in ("mass", "length", "radius", "stiffness"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(
                    f"PayloadConfig: {name} must be positive and finite; got {getattr(self, name)}."
                )
        if not self.damping >= 0 or np.shape(self.hook) != (3,):
            raise ValueError("PayloadConfig: damping must not be negative and hook must be (3,) [m].")
        return self


def make_plant(vehicle: Vehicle, payload: PayloadConfig) -> MultibodyPlant:
    """Continuous MultibodyPlant with the bodies `quadrotor` and, unless there is no tether, `payload`."""
    plant = MultibodyPlant(time_step=0.0)
    plant.set_name("plant")
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -vehicle.gravity])
    J = vehicle.J / vehicle.mass
    inertia = UnitInertia(J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    B = plant.AddRigidBody("quadrotor", SpatialInertia(vehicle.mass, np.zeros(3), inertia))
    if payload.tether != "none":
        sphere = UnitInertia.SolidSphere(payload.radius)
        P = plant.AddRigidBody("payload", SpatialInertia(payload.mass, np.zeros(3), sphere))
        if payload.tether == "rod":
            T = plant.AddFrame(FixedOffsetFrame("hook", B.body_frame(), RigidTransform(payload.hook)))
            offset = RigidTransform([0.0, 0.0, payload.length])
            F = plant.AddFrame(FixedOffsetFrame("rod_top", P.body_frame(), offset))
            plant.AddJoint(UniversalJoint("rod", T, F))
    plant.Finalize()
    return plant


def make_tethered_quadrotor(
    vehicle: Vehicle,
    payload: PayloadConfig,
    *,
    wrench_effects: list[WrenchEffect] | None = None,
    actuator_effects: list[ActuatorEffect] | None = None,
) -> Diagram:
    """The real vehicle as one Diagram, hovering at rest at the world origin by default.

    | port | size | meaning | unit |
    |---|---|---|---|
    | u (in) | 4 | commanded [f_u, tau_m]; saturated in rotor space | N, N·m |
    | x | 13 | true state [p_WB, q_WB, v_WB, w_WB_B] | |
    | acceleration | 6 | true [a in W, al in B] | m/s², rad/s² |
    | rotor_thrust | 4 | actual rotor thrust | N |
    | nominal_rotor_thrust | 4 | what nominal rotors would give at the actual rotor speed | N |
    | plant_state | nq + nv | Drake's own | |
    | tether_wrench | 6 | true wrench of cable or rod on B, chi order (with a payload only) | N, N·m |
    """
    payload.check()
    builder = DiagramBuilder()
    plant = builder.AddSystem(make_plant(vehicle, payload))
    state = builder.AddNamedSystem("state", VehicleState(plant))
    builder.Connect(plant.get_state_output_port(), state.get_input_port())
    thrust, nominal_thrust = _add_rotors(builder, plant, vehicle, payload, actuator_effects or [])
    forces = []
    if wrench_effects:
        effects = builder.AddNamedSystem(
            "wrench_effects", WrenchEffects(vehicle, wrench_effects, plant.num_velocities())
        )
        builder.Connect(state.get_output_port(), effects.GetInputPort("x"))
        builder.Connect(thrust, effects.GetInputPort("rotor_thrust"))
        forces.append(effects.GetOutputPort("generalized_force"))
    cable = None
    if payload.tether == "cable":
        cable = builder.AddNamedSystem(
            "cable",
            Cable(
                length=payload.length, hook=payload.hook, stiffness=payload.stiffness, damping=payload.damping
            ),
        )
        builder.Connect(plant.get_state_output_port(), cable.get_input_port())
        forces.append(cable.GetOutputPort("generalized_force"))
    _sum_forces(builder, plant, forces)
    acceleration = builder.AddNamedSystem("acceleration", BodyAcceleration(plant, "quadrotor"))
    builder.Connect(
        plant.get_body_spatial_accelerations_output_port(), acceleration.GetInputPort("accelerations")
    )
    builder.Connect(state.get_output_port(), acceleration.GetInputPort("x"))
    builder.ExportOutput(state.get_output_port(), "x")
    builder.ExportOutput(acceleration.get_output_port(), "acceleration")
    builder.ExportOutput(thrust, "rotor_thrust")
    builder.ExportOutput(nominal_thrust, "nominal_rotor_thrust")
    builder.ExportOutput(plant.get_state_output_port(), "plant_state")
    if cable is not None:
        builder.ExportOutput(cable.GetOutputPort("tether_wrench"), "tether_wrench")
    elif payload.tether == "rod":
        rod = builder.AddNamedSystem("rod_wrench", RodWrench(plant, "rod"))
        builder.Connect(plant.get_reaction_forces_output_port(), rod.GetInputPort("reaction_forces"))
        builder.Connect(plant.get_body_poses_output_port(), rod.GetInputPort("body_poses"))
        builder.ExportOutput(rod.get_output_port(), "tether_wrench")
    diagram = builder.Build()
    diagram.set_name("tethered_quadrotor")
    return diagram


def _add_rotors(builder, plant, vehicle: Vehicle, payload: PayloadConfig, effects):
    """Mixer, saturation, lag and propellers; returns the ports of actual and of nominal rotor thrust."""
    mixer = builder.AddNamedSystem("mixer", MatrixGain(vehicle.unmixer))
    limit = builder.AddNamedSystem(
        "saturation", Saturation(np.zeros(4), np.full(4, vehicle.max_rotor_thrust))
    )
    builder.ExportInput(mixer.get_input_port(), "u")
    builder.Connect(mixer.get_output_port(), limit.get_input_port())
    chain = list(effects)
    # The nominal lag of the vehicle file, unless reality brings a lag of its own.
    if vehicle.rotor_time_constant > 0 and not any(isinstance(effect, MotorLag) for effect in chain):
        chain.insert(0, MotorLag(vehicle.rotor_time_constant))
    thrust = nominal_thrust = limit.get_output_port()
    if chain:
        carried = vehicle.mass + (payload.mass if payload.tether != "none" else 0.0)
        hover = np.full(4, carried * vehicle.gravity / 4)
        actuators = builder.AddNamedSystem("actuators", ActuatorEffects(vehicle, chain, hover))
        builder.Connect(thrust, actuators.get_input_port())
        thrust = actuators.GetOutputPort("thrust")
        nominal_thrust = actuators.GetOutputPort("nominal_thrust")
    kappa = vehicle.torque_coefficient / vehicle.thrust_coefficient
    body = plant.GetBodyByName("quadrotor").index()
    info = [
        PropellerInfo(body, RigidTransform(p), thrust_ratio=1.0, moment_ratio=direction * kappa)
        for p, direction in zip(vehicle.rotor_positions, vehicle.rotor_directions, strict=True)
    ]
    propellers = builder.AddNamedSystem("propellers", Propeller(info))
    builder.Connect(thrust, propellers.get_command_input_port())
    builder.Connect(plant.get_body_poses_output_port(), propellers.get_body_poses_input_port())
    builder.Connect(propellers.get_spatial_forces_output_port(), plant.get_applied_spatial_force_input_port())
    return thrust, nominal_thrust


def _sum_forces(builder, plant, forces) -> None:
    if len(forces) == 1:
        builder.Connect(forces[0], plant.get_applied_generalized_force_input_port())
    elif forces:
        total = builder.AddNamedSystem("forces", Adder(len(forces), plant.num_velocities()))
        for i, port in enumerate(forces):
            builder.Connect(port, total.get_input_port(i))
        builder.Connect(total.get_output_port(), plant.get_applied_generalized_force_input_port())
