"""The plant: its bodies and their inertia, its start in hover, and what happens to it at given
times.

A plain `Simulator` triggers the events, each before the discrete updates of its instant, such as
the controller's.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    QuaternionFloatingJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
    UniversalJoint,
)
from pydrake.systems.framework import Context, LeafSystem, State

from np_drake.effects.base import MassEffect, MassProperties
from np_drake.effects.combine import mass_properties
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig

Update = Callable[[Context, State], None]
_ONCE = 1e9  # period of an event that is to happen once: Drake's scheduled events are periodic [s]


def make_plant(
    vehicle: Vehicle,
    payload: PayloadConfig,
    mass_effects: Sequence[MassEffect] = (),
    *,
    add_bodies: Callable[[MultibodyPlant], None] | None = None,
) -> MultibodyPlant:
    """Return a continuous MultibodyPlant with the bodies `quadrotor` and, unless there is no
    tether, `payload`, and those of `add_bodies`.

    The air brakes a payload on a cable by the damping of its floating joint.

    Args:
        mass_effects: that act from the start.
    """
    plant = MultibodyPlant(time_step=0.0)
    plant.set_name("plant")
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -vehicle.gravity])
    B = add_free_body(plant, "quadrotor", spatial_inertia(mass_properties(vehicle, mass_effects)))
    if payload.tether == "cable":
        add_free_body(plant, "payload", sphere(payload), drag=payload.air_damping * payload.mass)
    elif payload.tether == "rod":
        P = plant.AddRigidBody("payload", sphere(payload))
        T = plant.AddFrame(FixedOffsetFrame("hook", B.body_frame(), RigidTransform(payload.hook)))
        offset = RigidTransform([0.0, 0.0, payload.length])
        F = plant.AddFrame(FixedOffsetFrame("rod_top", P.body_frame(), offset))
        plant.AddJoint(UniversalJoint("rod", T, F))
    if add_bodies is not None:
        add_bodies(plant)
    plant.Finalize()
    return plant


def add_free_body(
    plant: MultibodyPlant, name: str, inertia: SpatialInertia, *, drag: float = 0.0
) -> RigidBody:
    """Add a body on a floating joint of its own name and return it; states follow in the order of
    the calls.

    Args:
        plant: not finalized.
        inertia: about the body's origin.
        drag: force on the body's origin over its velocity in W, against it [N·s/m].
    """
    body = plant.AddRigidBody(name, inertia)
    plant.AddJoint(QuaternionFloatingJoint(name, plant.world_frame(), body.body_frame(), 0.0, drag))
    return body


def sphere(payload: PayloadConfig) -> SpatialInertia:
    """Return the inertia of the solid sphere that a payload is."""
    return SpatialInertia(payload.mass, np.zeros(3), UnitInertia.SolidSphere(payload.radius))


def spatial_inertia(properties: MassProperties) -> SpatialInertia:
    """Return M_BBo_B, about the body's origin Bo, which stays when the centre of mass moves.

    Raises: ValueError: if no rigid body can have these properties.
    """
    J = properties.J
    refusal = ValueError(
        "mass effects: mass must be positive and the moments of inertia those of a rigid body; "
        f"got {properties.mass:g} kg and {J.diagonal()} kg·m²."
    )
    if not properties.mass > 0:  # Drake would end the process
        raise refusal
    try:
        central = RotationalInertia(J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
        return SpatialInertia.MakeFromCentralInertia(properties.mass, properties.p_BoBcm_B, central)
    except RuntimeError as error:
        raise refusal from error


def set_hover(plant: MultibodyPlant, context: Context, payload: PayloadConfig, p_WB) -> None:
    """Set the quadrotor level and at rest, with the payload hanging still at its static stretch.

    Args:
        plant: with quadrotor and payload.
        context: the plant's own.
        payload: that hangs, if by a cable.
        p_WB: (3,) position [m].
    """
    p_WB = np.asarray(p_WB, float)
    plant.SetFreeBodyPose(context, plant.GetBodyByName("quadrotor"), RigidTransform(p_WB))
    if payload.tether != "cable":
        return
    carried = payload.mass + 0.5 * payload.rope_mass
    stretch = carried * -plant.gravity_field().gravity_vector()[2] / payload.stiffness
    p_WP = p_WB + payload.hook - [0.0, 0.0, payload.length + stretch]
    plant.SetFreeBodyPose(context, plant.GetBodyByName("payload"), RigidTransform(p_WP))


def set_vehicle_mass(plant: MultibodyPlant, context: Context, properties: MassProperties) -> None:
    """Replace mass, centre of mass and inertia of the quadrotor in the plant's context."""
    plant.GetBodyByName("quadrotor").SetSpatialInertiaInBodyFrame(
        context, spatial_inertia(properties)
    )


def set_payload_mass(
    plant: MultibodyPlant, context: Context, payload: PayloadConfig, mass: float
) -> None:
    """Replace the payload's mass [kg] in the plant's context; `payload` gives its shape."""
    inertia = sphere(dc.replace(payload, mass=mass))
    plant.GetBodyByName("payload").SetSpatialInertiaInBodyFrame(context, inertia)


def declare_event_at(system: LeafSystem, time: float, update: Update) -> None:
    """Declare an unrestricted update of `system` at one time, at which a step of the integrator
    ends; nothing where it is infinite or not after the start.
    """
    if 0.0 < time < np.inf:
        system.DeclarePeriodicUnrestrictedUpdateEvent(
            period_sec=_ONCE, offset_sec=time, update=update
        )


def setting(value: float) -> Update:
    """Return the update that sets the first discrete state of a system to a value."""

    def update(context: Context, state: State) -> None:
        state.get_mutable_discrete_state(0).SetAtIndex(0, value)

    return update


def declare_impulse(plant: MultibodyPlant, time: float, impulse, mass: float) -> None:
    """Declare that the velocity of the free body `payload` jumps by impulse (3,) over mass, in W
    [N·s, kg].
    """
    start = plant.num_positions() + plant.GetJointByName("payload").velocity_start() + 3
    jump = np.asarray(impulse, float) / mass

    def update(context: Context, state: State) -> None:
        vector = state.get_mutable_continuous_state().get_mutable_vector()
        for axis in range(3):
            vector.SetAtIndex(start + axis, vector.GetAtIndex(start + axis) + jump[axis])

    declare_event_at(plant, time, update)


def declare_hanging(plant: MultibodyPlant, time: float, payload: PayloadConfig) -> None:
    """Declare that the free body `payload`, which has fallen until then, is put vertically under
    the hook, at the tether's length, moving with the hook.
    """
    B = plant.GetBodyByName("quadrotor")
    joint = plant.GetJointByName("payload")
    q_start = joint.position_start()
    v_start = plant.num_positions() + joint.velocity_start()

    def update(context: Context, state: State) -> None:
        X = plant.EvalBodyPoseInWorld(context, B)
        V = plant.EvalBodySpatialVelocityInWorld(context, B)
        hook = X.rotation() @ np.asarray(payload.hook, float)
        p_WP = X.translation() + hook - [0.0, 0.0, payload.length]
        v_WP = V.translational() + np.cross(V.rotational(), hook)
        vector = state.get_mutable_continuous_state().get_mutable_vector()
        for k, value in enumerate([1.0, 0.0, 0.0, 0.0, *p_WP]):
            vector.SetAtIndex(q_start + k, value)
        for k, value in enumerate([0.0, 0.0, 0.0, *v_WP]):
            vector.SetAtIndex(v_start + k, value)

    declare_event_at(plant, time, update)
