"""Effect `center_of_mass_offset`: a centre of mass beside the point where the vehicle file has
it.
"""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import MassEffect, MassProperties, Parameter, arm, direction, log_uniform
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class CenterOfMassOffset(MassEffect):
    """Shift of the centre of mass, p_BoBcm_B = nominal + [x, y, z]; J stays about the new centre of
    mass.

    With c = p_BoBcm_B and F the force on the body, all at Bo, which stays the logged point:
        m (a_Bo + R (al x c + w x (w x c)) + g z) = F,    J al + w x J w = tau_Bo - c x R^T F.
    Source: Newton and Euler about the centre of mass. In measured motion the torque has a term of
        second order in c.
    """

    x: float = 0.01  # [m], body axes
    y: float = 0.0  # [m]
    z: float = 0.0  # [m]

    named = "an offset of the centre of mass"
    bench_check = "balance the vehicle on an edge along each axis"
    excited_by = "thrust steps: climb and descend hard with level attitude"
    requires = ("torque",)
    linear = False
    parameters = tuple(
        Parameter(
            axis,
            "m",
            0.0,
            -0.15,
            0.15,
            0.01,
            departure=f"centre of mass {{size}} {p}|centre of mass {{size}} {m}",
        )
        for axis, p, m in (
            ("x", "ahead", "behind"),
            ("y", "to the left", "to the right"),
            ("z", "higher", "lower"),
        )
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case, about level."""
        size = log_uniform(rng, 0.005 * arm(vehicle), 0.2 * arm(vehicle))
        return dict(zip("xyz", size * direction(rng, 0.5), strict=True))

    def properties(self, nominal: MassProperties) -> MassProperties:
        """Return `nominal` with the centre of mass moved."""
        return dc.replace(nominal, p_BoBcm_B=nominal.p_BoBcm_B + np.array([self.x, self.y, self.z]))
