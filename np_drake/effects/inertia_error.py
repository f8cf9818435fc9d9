"""Effect `inertia_error`: moments of inertia that differ from the vehicle file."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.effects.base import MassEffect, MassProperties, Parameter


@dc.dataclass(frozen=True)
class InertiaError(MassEffect):
    """Scaled moments of inertia, J_ii = scale_ii J_nominal,ii about the centre of mass.

    The products of inertia stay.   Source: own choice.
    """

    scale_xx: float = 1.2  # [1]
    scale_yy: float = 1.2  # [1]
    scale_zz: float = 1.2  # [1]

    identifier: ClassVar[str] = "inertia_error"
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(name, "1", 1.0, 0.3, 3.0, 0.15) for name in ("scale_xx", "scale_yy", "scale_zz")
    )

    def properties(self, nominal: MassProperties) -> MassProperties:
        """Return `nominal` with the diagonal of J scaled."""
        extra = np.array([self.scale_xx, self.scale_yy, self.scale_zz]) - 1.0
        return dc.replace(nominal, J=nominal.J + np.diag(extra * np.diag(nominal.J)))
