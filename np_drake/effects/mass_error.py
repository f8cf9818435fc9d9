"""Effect `mass_error`: a mass that differs from the vehicle file."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import MassEffect, MassProperties, Parameter, signed
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class MassError(MassEffect):
    """Additional rigid mass at the centre of mass, m = m_nominal + delta_mass; the inertia stays.

    Source: own choice.
    """

    delta_mass: float = 0.1  # [kg]

    sudden = True
    named = "a mass error"
    bench_check = "weigh the vehicle with its battery"
    excited_by = (
        "steep climbs and descents with roll and pitch doublets (torque tells thrust from mass)"
    )
    told_from = {
        "thrust_scale": "fast roll and pitch doublets: torque scales with thrust, not with mass"
    }
    requires = ("thrust",)
    tolerance = "mass"
    parameters = (Parameter("delta_mass", "kg", 0.0, -20.0, 40.0, 0.2, departure="mass {signed}"),)

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        return {"delta_mass": float(vehicle.mass * np.clip(signed(rng, 0.01, 0.25), -0.15, 0.25))}

    def properties(self, nominal: MassProperties) -> MassProperties:
        """Return `nominal` with the additional mass."""
        return dc.replace(nominal, mass=nominal.mass + self.delta_mass)
