"""Quadrotor with its payload: plant, rotors, tether and the effects that the nominal model leaves
out.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder

from np_drake.checks import require
from np_drake.effects.base import ActuatorEffect, MassEffect, WrenchEffect
from np_drake.effects.combine import NO_ONSETS, Onsets, acting, mass_properties
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.files.yaml_file import check_numbers
from np_drake.vehicle import Vehicle
from systems.cable import Cable, Rope
from systems.mass_change import Change, MassChange
from systems.payload_config import PayloadConfig, PayloadEvent
from systems.plant import (
    declare_event_at,
    declare_hanging,
    declare_impulse,
    make_plant,
    set_payload_mass,
    set_vehicle_mass,
)
from systems.plant_readings import BodyAcceleration, RodWrench, VehicleState
from systems.rotors import RotorPorts, add_rotors
from systems.vehicle_forces import SteadyEffects, add_vehicle_forces
from systems.wrench_effects import ExternalForces, WrenchEffects, export_pushes


def make_tethered_quadrotor(
    vehicle: Vehicle,
    payload: PayloadConfig,
    *,
    wrench_effects: Sequence[WrenchEffect] = (),
    actuator_effects: Sequence[ActuatorEffect] = (),
    mass_effects: Sequence[MassEffect] = (),
    command_period: float = 0.001,
    onsets: Onsets = NO_ONSETS,
    hangs_at: float = 0.0,
    events: Sequence[PayloadEvent] = (),
    add_bodies: Callable[[MultibodyPlant], None] | None = None,
) -> Diagram:
    """Return the real vehicle as one Diagram, its rotors at the thrust of hovering.

    Quadrotor and payload begin at the world's origin, one in the other: `set_hover` hangs the
    payload below.

    Args:
        vehicle: as its file says.
        payload: what hangs under it, and how.
        wrench_effects: act as force and torque on the body.
        actuator_effects: act between command and thrust, in this order.
        mass_effects: change the mass properties.
        command_period: `u` changes at multiples of it; matters to delayed commands alone, and the
            longer the faster (`CommandBuffer`) [s].
        onsets: when effects begin that do not act from the start [s].
        hangs_at: when the payload is hung on the cable; it has fallen freely until then [s].
        events: of a payload on a cable.
        add_bodies: adds bodies of one's own, on joints to `quadrotor` or `payload`, before the
            plant is finalized.

    | port | size | meaning | unit |
    |---|---|---|---|
    | u (in) | 4 | commanded [f_u, tau_m]; saturated in rotor space | N, N·m |
    | external_wrench (in) | 6 | on B, chi order; unconnected: zero | N, N·m |
    | payload_force (in) | 3 | on the payload in W (with one only); unconnected: zero | N |
    | x | 13 | true state [p_WB, q_WB, v_WB, w_WB_B] | |
    | acceleration | 6 | true [a in W, al in B] | m/s², rad/s² |
    | rotor_thrust | 4 | actual rotor thrust | N |
    | nominal_rotor_thrust | 4 | what nominal rotors would give at the actual rotor speed | N |
    | plant_state | nq + nv | Drake's own | |
    | rope | 3 n | places of the point masses of a cable with mass, in W | m |
    | tether_wrench | 6 | true wrench of cable or rod on B, chi order (with a payload only) | N, N·m |

    `x` and `acceleration` are those of Bo, wherever the centre of mass is.
    Raises: ValueError: if a payload is among the wrench effects, events lack a cable, or a value is
        impossible.
    """  # noqa: E501
    _check(payload, wrench_effects, hangs_at, events)
    builder = DiagramBuilder()
    first = acting(mass_effects, onsets, 0.0)
    plant = builder.AddSystem(make_plant(vehicle, payload, first, add_bodies=add_bodies))
    state = builder.AddNamedSystem("state", VehicleState(plant))
    builder.Connect(plant.get_state_output_port(), state.get_input_port())
    carried = plant.CalcTotalMass(plant.CreateDefaultContext()) + payload.rope_mass
    carried -= payload.mass if payload.tether != "none" and hangs_at > 0.0 else 0.0
    start: dict[str, Any] = {
        "hover_thrust": np.full(4, carried * vehicle.gravity / 4),
        "command_period": command_period,
    }
    cable = within = None  # a cable without mass is within the compiled forces
    if payload.tether == "cable":
        cut_at = min((event.time for event in events if event.kind == "release"), default=np.inf)
        kind = Rope if payload.rope_mass else Cable
        cable = builder.AddNamedSystem(
            "cable", kind(plant, payload, tied_at=hangs_at, cut_at=cut_at)
        )
        builder.Connect(plant.get_state_output_port(), cable.get_input_port())
    changes = _declare_events(plant, vehicle, payload, mass_effects, onsets, hangs_at, events)
    steady = (
        SteadyEffects.of(vehicle, actuator_effects, wrench_effects, onsets)
        if payload.tether != "rod" and add_bodies is None
        else None
    )
    if steady is not None:
        within = None if payload.rope_mass else cable
        rotors, force = add_vehicle_forces(builder, plant, vehicle, steady, within, **start)
        forces = [force]
        pushing = steady.others
    else:
        rotors = add_rotors(builder, plant, vehicle, actuator_effects, onsets=onsets, **start)
        forces = []
        pushing = list(wrench_effects)
        external = builder.AddNamedSystem("external_forces", ExternalForces(plant))
        builder.Connect(plant.get_state_output_port(), external.get_input_port(0))
        export_pushes(builder, external)
        forces.append(external.get_output_port())
    if pushing:
        forces.append(_add_wrench_effects(builder, plant, vehicle, pushing, onsets, state, rotors))
    if cable is not None and cable is not within:
        forces.append(cable.GetOutputPort("generalized_force"))
    force = _sum_forces(builder, forces)
    if changes:
        change = builder.AddNamedSystem("mass_change", MassChange(plant, vehicle, changes))
        builder.Connect(plant.get_state_output_port(), change.GetInputPort("plant_state"))
        if steady is None:  # else the force holds that of the rotors
            builder.Connect(rotors.thrust, change.GetInputPort("rotor_thrust"))
        builder.Connect(force, change.GetInputPort("generalized_force"))
        force = change.get_output_port()
    builder.Connect(force, plant.get_applied_generalized_force_input_port())
    acceleration = builder.AddNamedSystem("acceleration", BodyAcceleration(plant))
    builder.Connect(plant.get_state_output_port(), acceleration.GetInputPort("plant_state"))
    builder.Connect(
        plant.get_generalized_acceleration_output_port(),
        acceleration.GetInputPort("generalized_acceleration"),
    )
    builder.ExportOutput(state.get_output_port(), "x")
    builder.ExportOutput(acceleration.get_output_port(), "acceleration")
    builder.ExportOutput(rotors.thrust, "rotor_thrust")
    builder.ExportOutput(rotors.nominal_thrust, "nominal_rotor_thrust")
    builder.ExportOutput(plant.get_state_output_port(), "plant_state")
    _export_tether(builder, plant, payload, cable)
    diagram = builder.Build()
    diagram.set_name("tethered_quadrotor")
    return diagram


def _check(
    payload: PayloadConfig,
    wrench_effects: Sequence[WrenchEffect],
    hangs_at: float,
    events: Sequence[PayloadEvent],
) -> None:
    """Raises: ValueError: as of `make_tethered_quadrotor`."""
    payload.check()
    check_numbers("make_tethered_quadrotor: hangs_at", hangs_at, "s")
    for event in events:
        event.check()
    require(
        not events or payload.tether == "cable",
        f"make_tethered_quadrotor: events need a payload on a cable; got {payload.tether}.",
    )
    require(
        all(not isinstance(effect, SuspendedPayload) for effect in wrench_effects),
        "make_tethered_quadrotor: suspended_payload must be a body here, not a wrench effect; "
        "pass payload=payload_config(effect).",
    )
    require(
        not payload.rope_mass or hangs_at <= 0.0,
        f"make_tethered_quadrotor: a cable with mass must hang from the start; got {hangs_at} s.",
    )


def _add_wrench_effects(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    vehicle: Vehicle,
    effects: Sequence[WrenchEffect],
    onsets: Onsets,
    state: VehicleState,
    rotors: RotorPorts,
) -> OutputPort:
    """Add effects that are evaluated one by one, and return the port of their force."""
    wrenches = WrenchEffects(vehicle, effects, plant.num_velocities(), onsets=onsets)
    added = builder.AddNamedSystem("wrench_effects", wrenches)
    builder.Connect(state.get_output_port(), added.GetInputPort("x"))
    builder.Connect(rotors.thrust, added.GetInputPort("rotor_thrust"))
    builder.Connect(rotors.nominal_thrust, added.GetInputPort("nominal_thrust"))
    if rotors.rate is not None:
        builder.Connect(rotors.rate, added.GetInputPort("rotor_rate"))
    return added.get_output_port()


def _export_tether(
    builder: DiagramBuilder, plant: MultibodyPlant, payload: PayloadConfig, cable: Cable | None
) -> None:
    """Export what a cable or rod pulls, and where the point masses of a rope are."""
    if cable is not None:
        builder.ExportOutput(cable.GetOutputPort("tether_wrench"), "tether_wrench")
        if payload.rope_mass:
            builder.ExportOutput(cable.GetOutputPort("rope"), "rope")
    elif payload.tether == "rod":
        rod = builder.AddNamedSystem("rod_wrench", RodWrench(plant, "rod"))
        forces = plant.get_reaction_forces_output_port()
        builder.Connect(forces, rod.GetInputPort("reaction_forces"))
        builder.Connect(plant.get_body_poses_output_port(), rod.GetInputPort("body_poses"))
        builder.ExportOutput(rod.get_output_port(), "tether_wrench")


def _declare_events(
    plant, vehicle, payload, mass_effects, onsets, hangs_at, events
) -> list[Change]:
    """Declare what changes the plant's state in flight, and return the changes of mass properties
    by time.
    """
    changes: list[Change] = []
    for t in sorted({onsets[e] for e in mass_effects if onsets.get(e, 0.0) > 0.0}):
        properties = mass_properties(vehicle, acting(mass_effects, onsets, t))
        changes.append((t, partial(set_vehicle_mass, properties=properties)))
    mass = payload.mass
    for event in sorted(events, key=lambda event: event.time):
        if event.kind == "attach":
            mass += event.mass
            changes.append((event.time, partial(set_payload_mass, payload=payload, mass=mass)))
        elif event.kind == "impulse":
            declare_impulse(plant, event.time, event.impulse, mass)
    if payload.tether == "cable":
        declare_hanging(plant, hangs_at, payload)
    for t in {*onsets.values()}:
        declare_event_at(plant, t, lambda context, state: None)  # a step of the integrator ends
    return sorted(changes, key=lambda change: change[0])


def _sum_forces(builder: DiagramBuilder, forces: list[OutputPort]) -> OutputPort:
    """Return the port of the sum of generalized forces."""
    total = builder.AddNamedSystem("forces", Adder(len(forces), forces[0].size()))
    for i, port in enumerate(forces):
        builder.Connect(port, total.get_input_port(i))
    return total.get_output_port()
