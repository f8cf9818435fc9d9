"""Free bodies of a plant and their inertia: vehicles, and a payload that the air brakes."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    QuaternionFloatingJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
)

from np_drake.effects.base import MassProperties
from systems.payload_config import PayloadConfig


def add_free_body(
    plant: MultibodyPlant, name: str, inertia: SpatialInertia, *, drag: float = 0.0
) -> RigidBody:
    """Add a body on a floating joint of its own name and return it; states follow in the order of
    the calls.

    Args:
        plant: not finalized.
        name: of body and joint.
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
