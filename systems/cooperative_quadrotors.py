"""Several quadrotors with one payload: a single plant with rotors, cable and effects of each
vehicle.
"""

from collections.abc import Sequence

import numpy as np
from pydrake.multibody.plant import ExternallyAppliedSpatialForceMultiplexer, MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder, MatrixGain

from np_drake.effects.base import ActuatorEffect, WrenchEffect
from np_drake.effects.combine import mass_properties
from np_drake.vehicle import Vehicle
from systems.cable import Cable
from systems.free_body import add_free_body, spatial_inertia, sphere
from systems.payload_config import PayloadConfig
from systems.plant_readings import BodyAcceleration, VehicleState
from systems.rotors import add_propellers, add_rotor_chain
from systems.wrench_effects import WrenchEffects

PORTS = (
    "x",
    "acceleration",
    "rotor_thrust",
    "nominal_rotor_thrust",
    "tether_wrench",
)  # of every vehicle


def _make_cooperative_plant(vehicle: Vehicle, payload: PayloadConfig, count: int) -> MultibodyPlant:
    """Return a continuous MultibodyPlant with the free bodies `quadrotor_0` … and `payload`."""
    plant = MultibodyPlant(time_step=0.0)
    plant.set_name("plant")
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -vehicle.gravity])
    for i in range(count):
        add_free_body(plant, f"quadrotor_{i}", spatial_inertia(mass_properties(vehicle, ())))
    add_free_body(plant, "payload", sphere(payload), drag=payload.air_damping * payload.mass)
    plant.Finalize()
    return plant


def make_cooperative_quadrotors(
    vehicle: Vehicle,
    payload: PayloadConfig,
    *,
    count: int,
    wrench_effects: Sequence[WrenchEffect] = (),
    actuator_effects: Sequence[ActuatorEffect] = (),
    command_period: float = 0.001,
) -> Diagram:
    """Return a Diagram of `count` equal vehicles on one payload, each with a cable and effects of
    its own.

    Ports of vehicle i carry its number: `u_0` in, `x_0` out, …; sizes and units as
    `make_tethered_quadrotor`.

    | port | size | meaning | unit |
    |---|---|---|---|
    | u_i (in) | 4 | commanded [f_u, tau_m] | N, N·m |
    | x_i, acceleration_i, rotor_thrust_i, nominal_rotor_thrust_i | 13, 6, 4, 4 | true state, … | |
    | tether_wrench_i | 6 | true wrench of cable i on its vehicle, chi order | N, N·m |
    | plant_state | 26 (count + 1) / 2 | Drake's own: vehicles in their order, then the payload | |

    Args:
        vehicle: each of them.
        payload: that they share, on a cable each.
        count: of vehicles [1].
        wrench_effects: on every vehicle.
        actuator_effects: on every vehicle.
        command_period: as of `make_tethered_quadrotor` [s].
    Raises: ValueError: if there is no vehicle, or the payload is impossible or does not hang on
        cables.
    """
    payload.check()
    if count < 1:
        raise ValueError(f"make_cooperative_quadrotors: count must be at least 1; got {count}.")
    if payload.tether != "cable":
        raise ValueError(
            f"make_cooperative_quadrotors: several vehicles share a payload on cables; got "
            f"a {payload.tether}."
        )
    builder = DiagramBuilder()
    plant = builder.AddSystem(_make_cooperative_plant(vehicle, payload, count))
    total = builder.AddNamedSystem("forces", Adder(count, plant.num_velocities()))
    propellers = builder.AddNamedSystem(
        "propellers", ExternallyAppliedSpatialForceMultiplexer(count)
    )
    builder.Connect(total.get_output_port(), plant.get_applied_generalized_force_input_port())
    builder.Connect(propellers.get_output_port(), plant.get_applied_spatial_force_input_port())
    share = vehicle.mass + payload.mass / count
    for i in range(count):
        one = _make_one(
            plant,
            vehicle,
            payload,
            number=i,
            effects=(wrench_effects, actuator_effects),
            hover_thrust=np.full(4, share * vehicle.gravity / 4),
            command_period=command_period,
        )
        builder.AddSystem(one)
        for name, port in (
            ("plant_state", plant.get_state_output_port()),
            ("body_poses", plant.get_body_poses_output_port()),
            ("generalized_acceleration", plant.get_generalized_acceleration_output_port()),
        ):
            builder.Connect(port, one.GetInputPort(name))
        builder.Connect(one.GetOutputPort("generalized_force"), total.get_input_port(i))
        builder.Connect(one.GetOutputPort("spatial_forces"), propellers.get_input_port(i))
        builder.ExportInput(one.GetInputPort("u"), f"u_{i}")
        for name in PORTS:
            builder.ExportOutput(one.GetOutputPort(name), f"{name}_{i}")
    builder.ExportOutput(plant.get_state_output_port(), "plant_state")
    diagram = builder.Build()
    diagram.set_name("cooperative_quadrotors")
    return diagram


def _make_one(
    plant,
    vehicle: Vehicle,
    payload: PayloadConfig,
    *,
    number: int,
    effects,
    hover_thrust,
    command_period,
) -> Diagram:
    """Return rotors, cable, effects and readings of one vehicle; the plant itself lies outside."""
    wrench_effects, actuator_effects = effects
    body = f"quadrotor_{number}"
    builder = DiagramBuilder()
    state = builder.AddNamedSystem("state", VehicleState(plant, body))
    rotors = add_rotor_chain(
        builder, vehicle, actuator_effects, hover_thrust=hover_thrust, command_period=command_period
    )
    propellers = add_propellers(builder, plant, vehicle, rotors.thrust, body=body)
    pair = builder.AddNamedSystem("pair", MatrixGain(pair_state(plant, body)))
    cable = builder.AddNamedSystem(
        "cable",
        Cable(
            length=payload.length,
            hook=payload.hook,
            stiffness=payload.stiffness,
            damping=payload.damping,
        ),
    )
    builder.Connect(pair.get_output_port(), cable.get_input_port())
    forces = [cable.GetOutputPort("generalized_force")]
    if wrench_effects:
        pushes = builder.AddNamedSystem(
            "wrench_effects", WrenchEffects(vehicle, wrench_effects, 12)
        )
        builder.Connect(state.get_output_port(), pushes.GetInputPort("x"))
        builder.Connect(rotors.thrust, pushes.GetInputPort("rotor_thrust"))
        if rotors.rate is not None and any(effect.feels_rotor_rate for effect in wrench_effects):
            builder.Connect(rotors.rate, pushes.GetInputPort("rotor_rate"))
        forces.append(pushes.GetOutputPort("generalized_force"))
    force = builder.AddNamedSystem("forces", Adder(len(forces), 12))
    for i, port in enumerate(forces):
        builder.Connect(port, force.get_input_port(i))
    spread = builder.AddNamedSystem("spread", MatrixGain(_pair_velocities(plant, body).T))
    builder.Connect(force.get_output_port(), spread.get_input_port())
    acceleration = builder.AddNamedSystem("acceleration", BodyAcceleration(plant, body))
    builder.ExportInput(state.get_input_port(), "plant_state")
    builder.ConnectInput("plant_state", pair.get_input_port())
    builder.ExportInput(propellers.get_body_poses_input_port(), "body_poses")
    builder.ConnectInput("plant_state", acceleration.GetInputPort("plant_state"))
    port = acceleration.GetInputPort("generalized_acceleration")
    builder.ExportInput(port, port.get_name())
    outputs = (
        *(state.get_output_port(), acceleration.get_output_port()),
        *(rotors.thrust, rotors.nominal_thrust, cable.GetOutputPort("tether_wrench")),
    )
    for name, port in zip(PORTS, outputs, strict=True):
        builder.ExportOutput(port, name)
    builder.ExportOutput(spread.get_output_port(), "generalized_force")
    builder.ExportOutput(propellers.get_spatial_forces_output_port(), "spatial_forces")
    diagram = builder.Build()
    diagram.set_name(body)
    return diagram


def pair_state(plant: MultibodyPlant, body: str) -> np.ndarray:
    """Return the matrix that selects the input of `Cable` from the plant's state, (26, nq + nv).

    The input is [q_WB, p_WB, q_WP, p_WP, V_WB, V_WP].

    Args:
        plant: with the vehicle and the payload.
        body: name of the vehicle's body.
    """
    rows = np.zeros((14, plant.num_multibody_states()))
    for k, name in enumerate((body, "payload")):
        start = plant.GetJointByName(name).position_start()
        rows[7 * k : 7 * k + 7, start : start + 7] = np.eye(7)
    velocities = np.hstack([np.zeros((12, plant.num_positions())), _pair_velocities(plant, body)])
    return np.vstack([rows, velocities])


def _pair_velocities(plant: MultibodyPlant, body: str) -> np.ndarray:
    """Return the matrix that selects [V_WB, V_WP], (12, nv); its transpose maps the pair's
    generalized forces back.
    """
    rows = np.zeros((12, plant.num_velocities()))
    for k, name in enumerate((body, "payload")):
        start = plant.GetJointByName(name).velocity_start()
        rows[6 * k : 6 * k + 6, start : start + 6] = np.eye(6)
    return rows
