"""More or less mass than the vehicle file says."""

import dataclasses as dc
from typing import ClassVar

from np_drake.effects.base import MassEffect, MassProperties, Parameter


@dc.dataclass(frozen=True)
class MassError(MassEffect):
    """m = m_nominal + delta_mass, rigid and at the centre of mass; the inertia stays.   Source: own choice."""

    delta_mass: float = 0.1  # [kg]

    identifier: ClassVar[str] = "mass_error"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("delta_mass", "kg", 0.0, -1.0, 2.0, 0.2),)

    def properties(self, nominal: MassProperties) -> MassProperties:
        """With the other mass."""
        return dc.replace(nominal, mass=nominal.mass + self.delta_mass)
