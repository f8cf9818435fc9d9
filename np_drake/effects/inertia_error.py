"""Effect `inertia_error`: moments of inertia that differ from the vehicle file."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import MassEffect, MassProperties, Parameter, log_uniform
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class InertiaError(MassEffect):
    """Scaled moments of inertia, J_ii = scale_ii J_nominal,ii about the centre of mass.

    The products of inertia stay.   Source: own choice.
    """

    scale_xx: float = 1.2  # [1]
    scale_yy: float = 1.2  # [1]
    scale_zz: float = 1.2  # [1]

    named = "an inertia error"
    shares = True
    excited_by = "fast doublets about all three axes"
    requires = ("torque",)
    parameters = tuple(
        Parameter(
            f"scale_{axis}{axis}",
            "1",
            1.0,
            0.3,
            3.0,
            0.15,
            departure=f"moment of inertia about {axis} {{signed}}",
        )
        for axis in "xyz"
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case, those of a rigid body."""
        size = log_uniform(rng, 0.02, 0.6)
        while True:
            scale = 1 + size * rng.uniform(-0.8, 1.0, 3)
            moments = np.sort(scale * vehicle.J.diagonal())
            if moments[2] < 0.98 * (moments[0] + moments[1]):
                return dict(zip(("scale_xx", "scale_yy", "scale_zz"), scale, strict=True))

    def properties(self, nominal: MassProperties) -> MassProperties:
        """Return `nominal` with the diagonal of J scaled."""
        extra = np.array([self.scale_xx, self.scale_yy, self.scale_zz]) - 1.0
        return dc.replace(nominal, J=nominal.J + np.diag(extra * np.diag(nominal.J)))
