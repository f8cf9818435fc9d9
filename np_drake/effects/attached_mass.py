"""Effect `attached_mass`: a mass that is fixed to the arm of a rotor."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import MassEffect, MassProperties, Parameter
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class AttachedMass(MassEffect):
    """Point mass at a rotor: mass, centre of mass and inertia change together.

    Source: parallel axis theorem.
    """

    rotor: float = 1  # 1..4, as in the vehicle file
    mass: float = 0.05  # [kg]

    role = "change"
    sudden = True
    named = "a mass at a rotor"
    phrase = "{mass} at {rotor}"
    bench_check = "look at this arm, and weigh the vehicle"
    excited_by = "thrust steps and roll and pitch doublets"
    requires = ("torque",)
    linear = False
    parameters = (
        Parameter("rotor", "", 1.0, 1.0, 4.0, 1.0, choices=(1.0, 2.0, 3.0, 4.0)),
        Parameter("mass", "kg", 0.0, 0.0, 10.0, 0.1, departure="{rotor}: mass {signed}"),
    )

    def possible(self, vehicle: Vehicle, height: float) -> bool:
        """Return whether a vehicle carries the mass on an arm.

        Args:
            vehicle: the nominal vehicle.
            height: not used.
        """
        return self.mass < vehicle.mass

    def properties(self, nominal: MassProperties) -> MassProperties:
        """Return `nominal` with the mass at the rotor."""
        total = nominal.mass + self.mass
        arm = nominal.rotor_positions_B[round(self.rotor) - 1] - nominal.p_BoBcm_B
        # Of two bodies about their common centre the reduced mass turns with their distance.
        reduced = nominal.mass * self.mass / total
        J = nominal.J + reduced * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return dc.replace(
            nominal, mass=total, p_BoBcm_B=nominal.p_BoBcm_B + self.mass / total * arm, J=J
        )
