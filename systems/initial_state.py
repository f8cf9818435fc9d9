"""Setting and changing the plant's state: hover, swing, impulse, added mass."""

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.framework import Context

from systems.tethered_quadrotor import PayloadConfig


def set_hover(plant: MultibodyPlant, context: Context, payload: PayloadConfig, p_WB) -> None:
    """Quadrotor level and at rest at `p_WB` (3,) [m]; payload hanging still at its static stretch.

    Args: context: the plant's own.
    """
    p_WB = np.asarray(p_WB, float)
    plant.SetFreeBodyPose(context, plant.GetBodyByName("quadrotor"), RigidTransform(p_WB))
    if payload.tether != "cable":
        return
    stretch = payload.mass * -plant.gravity_field().gravity_vector()[2] / payload.stiffness
    p_WP = p_WB + payload.hook - [0.0, 0.0, payload.length + stretch]
    plant.SetFreeBodyPose(context, plant.GetBodyByName("payload"), RigidTransform(p_WP))


def apply_impulse(plant: MultibodyPlant, context: Context, impulse) -> None:
    """Adds dv = J / m to the payload of a cable; `impulse` (3,) in W [N·s]."""
    P = plant.GetBodyByName("payload")
    V = plant.EvalBodySpatialVelocityInWorld(context, P)
    dv = np.asarray(impulse, float) / P.get_mass(context)
    plant.SetFreeBodySpatialVelocity(
        context=context, body=P, V_JpJc=SpatialVelocity(V.rotational(), V.translational() + dv)
    )


def set_payload_mass(plant: MultibodyPlant, context: Context, payload: PayloadConfig, mass: float) -> None:
    """Replaces the payload's mass [kg] in flight; call it between two AdvanceTo."""
    if not mass > 0:
        raise ValueError(f"set_payload_mass: mass must be positive [kg]; got {mass}.")
    inertia = SpatialInertia(mass, np.zeros(3), UnitInertia.SolidSphere(payload.radius))
    plant.GetBodyByName("payload").SetSpatialInertiaInBodyFrame(context, inertia)
