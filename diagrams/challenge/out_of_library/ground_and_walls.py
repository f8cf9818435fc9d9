"""Ground, wall and ceiling effects that the library does not have.

Source of each law: own choice, of what vehicles are known to meet.
"""

import dataclasses as dc

import numpy as np

from diagrams.challenge.out_of_library.base import (
    Draw,
    OutOfLibraryWrench,
    chi_along_z,
    chi_of_force,
    chi_of_rotors,
    chi_of_torque,
    level_direction,
)
from np_drake.effects.base import Motion
from np_drake.effects.parameter import arm, log_uniform
from np_drake.rigid_body import P
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class WallSuction(OutOfLibraryWrench):
    """Suction towards a wall at distance d: f = strength thrust exp(-d / reach) normal.

    Points p of the wall have normal · p = from_origin.
    """

    strength: float  # [1]
    reach: float  # [m]
    normal: tuple[float, float, float]  # towards the wall
    from_origin: float  # distance of the wall [m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        d = np.maximum(self.from_origin - motion.x[..., P] @ np.array(self.normal), 0.0)
        pull = self.strength * motion.rotor_thrust.sum(axis=-1) * np.exp(-d / self.reach)
        return chi_of_force(pull[..., None] * np.array(self.normal))


@dc.dataclass(frozen=True)
class CeilingEffect(OutOfLibraryWrench):
    """Ceiling effect: the rotors give `strength` more just below `height`, fading over `reach`."""

    strength: float  # [1]
    reach: float  # [m]
    height: float  # [m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        below = np.maximum(self.height - motion.x[..., P][..., 2], 0.0)
        return chi_along_z(
            motion, self.strength * motion.rotor_thrust.sum(axis=-1) * np.exp(-below / self.reach)
        )


@dc.dataclass(frozen=True)
class TiltedCushion(OutOfLibraryWrench):
    """A ground cushion that rights the vehicle: tau = lever F exp(-z / reach) (z_B x n).

    F of all rotors, n the world's z in B. The low side has more of a cushion under it than the high
    one; nothing of it shows in the force.
    """

    lever: float  # over a lean of one, on the ground [m]
    reach: float  # [m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        near = np.exp(-np.maximum(motion.x[..., P][..., 2], 0.0) / self.reach)
        size = self.lever * motion.rotor_thrust.sum(axis=-1) * near
        return chi_of_torque(size[..., None] * np.cross([0.0, 0.0, 1.0], motion.R_WB[..., 2, :]))


@dc.dataclass(frozen=True)
class PlatformEdge(OutOfLibraryWrench):
    """Ground effect of a platform that ends: each rotor over it gives more, those beyond its edge
    do not.

    Extra thrust of a rotor at p in W: strength f exp(-(z - height) / reach) (1 + tanh(inside /
    edge)) / 2, inside = normal · p - from_origin, f its thrust.
    """

    strength: float  # on the platform [1]
    reach: float  # [m]
    height: float  # of the platform [m]
    normal: tuple[float, float, float]  # level, inwards from the edge
    from_origin: float  # distance of the edge [m]
    edge: float  # half width over which it fades [m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        rotors = motion.x[..., None, P] + np.array(vehicle.rotor_positions) @ np.swapaxes(
            motion.R_WB, -1, -2
        )
        above = np.maximum(rotors[..., 2] - self.height, 0.0)
        over = 0.5 * (
            1.0 + np.tanh((rotors @ np.array(self.normal) - self.from_origin) / self.edge)
        )
        gained = self.strength * motion.rotor_thrust * np.exp(-above / self.reach) * over
        return chi_of_rotors(motion, gained @ vehicle.mixer.T)


DRAWS: dict[str, Draw] = {
    "wall_suction": lambda rng, v: WallSuction(
        normal=level_direction(rng),
        strength=log_uniform(rng, 0.04, 0.25),
        reach=rng.uniform(0.3, 1.0),
        from_origin=rng.uniform(0.8, 2.5),
    ),
    "ceiling_effect": lambda rng, v: CeilingEffect(
        log_uniform(rng, 0.04, 0.25), rng.uniform(0.3, 1.0), rng.uniform(1.8, 3.0)
    ),
    "tilted_cushion": lambda rng, v: TiltedCushion(
        log_uniform(rng, 0.03, 0.3) * arm(v), rng.uniform(0.5, 2.0)
    ),
    "platform_edge": lambda rng, v: PlatformEdge(
        normal=level_direction(rng),
        strength=log_uniform(rng, 0.06, 0.4),
        reach=rng.uniform(0.8, 2.0),
        height=rng.uniform(0.0, 0.3),
        from_origin=rng.uniform(-0.7, 0.7),
        edge=rng.uniform(0.05, 0.3),
    ),
}
