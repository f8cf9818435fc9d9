"""Effect `mass_error`: a mass that differs from the vehicle file."""

import dataclasses as dc
from typing import ClassVar

from np_drake.effects.base import MassEffect, MassProperties, Parameter


@dc.dataclass(frozen=True)
class MassError(MassEffect):
    """Additional rigid mass at the centre of mass, m = m_nominal + delta_mass; the inertia stays.

    Source: own choice.
    """

    delta_mass: float = 0.1  # [kg]

    identifier: ClassVar[str] = "mass_error"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("delta_mass", "kg", 0.0, -1.0, 2.0, 0.2),)

    def properties(self, nominal: MassProperties) -> MassProperties:
        """Return `nominal` with the additional mass."""
        return dc.replace(nominal, mass=nominal.mass + self.delta_mass)
