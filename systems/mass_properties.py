"""Mass wrapper: effects that change mass, inertia and centre of mass of the quadrotor's body."""

from pydrake.multibody.tree import RotationalInertia, SpatialInertia

from np_drake.effects.base import MassProperties


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
