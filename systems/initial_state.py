"""Initial states and mass properties in a context of the plant: hover, formation, added mass."""

import dataclasses as dc

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from np_drake.effects.base import MassProperties
from np_drake.references.payload import payload_drop
from systems.free_body import spatial_inertia, sphere
from systems.payload_config import PayloadConfig


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
    stretch = payload.mass * -plant.gravity_field().gravity_vector()[2] / payload.stiffness
    p_WP = p_WB + payload.hook - [0.0, 0.0, payload.length + stretch]
    plant.SetFreeBodyPose(context, plant.GetBodyByName("payload"), RigidTransform(p_WP))


def set_formation(plant: MultibodyPlant, context: Context, payload: PayloadConfig, p_WB) -> None:
    """Set the quadrotors level and at rest on a regular polygon, with the payload at rest on
    equally taut cables.

    Args:
        plant: with quadrotors and payload.
        context: the plant's own.
        payload: that they carry.
        p_WB: (n, 3) positions [m].
    Raises: ValueError: if the cables do not reach the middle.
    """
    p_WB = np.asarray(p_WB, float)
    center = p_WB.mean(axis=0)
    radius = float(np.linalg.norm(p_WB[0] - center))
    weight = payload.mass * -plant.gravity_field().gravity_vector()[2]
    length = payload.length
    for _ in range(
        4
    ):  # the stretch changes the cable's angle, by which it is found, in the fifth digit only
        cosine = -payload_drop(radius, length, 0.0) / length
        length = payload.length + weight / (len(p_WB) * cosine * payload.stiffness)
    drop = payload_drop(radius, length, payload.hook[2])
    for i, p in enumerate(p_WB):
        plant.SetFreeBodyPose(context, plant.GetBodyByName(f"quadrotor_{i}"), RigidTransform(p))
    plant.SetFreeBodyPose(
        context, plant.GetBodyByName("payload"), RigidTransform(center + [0.0, 0.0, drop])
    )


def set_vehicle_mass(plant: MultibodyPlant, context: Context, properties: MassProperties) -> None:
    """Replace mass, centre of mass and inertia of the quadrotor in a context.

    Args:
        plant: with the quadrotor.
        context: the plant's own.
        properties: the new ones.
    """
    plant.GetBodyByName("quadrotor").SetSpatialInertiaInBodyFrame(
        context, spatial_inertia(properties)
    )


def set_payload_mass(
    plant: MultibodyPlant, context: Context, payload: PayloadConfig, mass: float
) -> None:
    """Replace the payload's mass [kg] in a context.

    Args:
        plant: with the payload.
        context: the plant's own.
        payload: gives its shape.
        mass: the new one [kg].
    Raises: ValueError: if the mass is not positive.
    """
    if not mass > 0:
        raise ValueError(f"set_payload_mass: mass must be positive [kg]; got {mass}.")
    inertia = sphere(dc.replace(payload, mass=mass))
    plant.GetBodyByName("payload").SetSpatialInertiaInBodyFrame(context, inertia)
