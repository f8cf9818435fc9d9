"""Free bodies of a plant: vehicles, and a payload that the air brakes."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import QuaternionFloatingJoint, RigidBody, SpatialInertia, UnitInertia

from systems.payload_config import PayloadConfig


def add_free_body(
    plant: MultibodyPlant, name: str, inertia: SpatialInertia, *, drag: float = 0.0
) -> RigidBody:
    """Add a body on a floating joint of its own name and return it; states follow in the order of the calls.

    Args: drag: force on the body's origin over its velocity in W, against it [N·s/m].
    """
    body = plant.AddRigidBody(name, inertia)
    plant.AddJoint(QuaternionFloatingJoint(name, plant.world_frame(), body.body_frame(), 0.0, drag))
    return body


def sphere(payload: PayloadConfig) -> SpatialInertia:
    """Return the inertia of the solid sphere that a payload is."""
    return SpatialInertia(payload.mass, np.zeros(3), UnitInertia.SolidSphere(payload.radius))
