"""Moving air in the room that the library does not have.

Source of each law: own choice, of what vehicles are known to meet.
"""

import dataclasses as dc

import numpy as np

from diagrams.challenge.out_of_library.base import (
    UP,
    Draw,
    OutOfLibraryWrench,
    any_course,
    chi_of_force,
    level_direction,
    weight,
)
from np_drake.effects.base import Motion
from np_drake.effects.parameter import arm, direction, log_uniform, signed
from np_drake.rigid_body import P
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class FanJet(OutOfLibraryWrench):
    """A fan's jet at one place of the room: f = force exp(-|p - center|² / 2 size²) in W."""

    force: tuple[float, float, float]  # [N]
    center: tuple[float, float, float]  # [m]
    size: float  # [m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        away = np.sum((motion.x[..., P] - self.center) ** 2, axis=-1)
        return chi_of_force(np.exp(-0.5 * away / self.size**2)[..., None] * self.force)


@dc.dataclass(frozen=True)
class WindShear(OutOfLibraryWrench):
    """Wind shear, as far as a drag feels it: f = c (z - height) towards `course` in W."""

    c: float  # [N/m]
    height: float  # [m]
    course: float  # [rad]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        push = self.c * (motion.x[..., P][..., 2] - self.height)
        f_W = push[..., None] * np.array([np.cos(self.course), np.sin(self.course), 0.0])
        return chi_of_force(f_W)


@dc.dataclass(frozen=True)
class DoorwayDraft(OutOfLibraryWrench):
    """A draft on one side of a plane: f = force (1 + tanh((normal · p - from_origin) / edge)) / 2
    in W.
    """

    force: tuple[float, float, float]  # well inside [N]
    normal: tuple[float, float, float]  # into the draft
    from_origin: float  # distance of the plane [m]
    edge: float  # [m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        inside = motion.x[..., P] @ np.array(self.normal) - self.from_origin
        share = 0.5 * (1.0 + np.tanh(inside / self.edge))
        return chi_of_force(share[..., None] * self.force)


@dc.dataclass(frozen=True)
class StandingEddy(OutOfLibraryWrench):
    """A standing eddy in the room: f = force (z x r) / core exp((1 - |r|² / core²) / 2) in W.

    r is level from the `center`; strongest at the distance `core` from the upright axis.
    """

    force: float  # at `core`; counter-clockwise from above [N]
    center: tuple[float, float]  # [m]
    core: float  # [m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        r = (motion.x[..., P][..., :2] - self.center) / self.core
        size = self.force * np.exp(0.5 * (1.0 - np.sum(r**2, axis=-1)))
        return chi_of_force(
            size[..., None] * np.stack([-r[..., 1], r[..., 0], np.zeros_like(size)], axis=-1)
        )


@dc.dataclass(frozen=True)
class PassingVehicle(OutOfLibraryWrench):
    """Downwash of a vehicle that passes above once in every `period`; s = time from the passage /
    duration.

    f_z = -force exp(-s²/2) in W, tau = force lever s exp(-s²/2) about the level `course` in W: it
    hits one side first, then the other.
    """

    force: float  # right below it [N]
    lever: float  # [m]
    course: float  # [rad]
    period: float  # [s]
    passage: float  # of the first one [s]
    duration: float  # [s]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        since = (
            np.mod(np.asarray(motion.t) - self.passage + self.period / 2, self.period)
            - self.period / 2
        )
        s = since / self.duration
        push = self.force * np.exp(-0.5 * s**2)
        axis_B = np.array([np.cos(self.course), np.sin(self.course), 0.0]) @ motion.R_WB
        f_W = -push[..., None] * UP
        return np.concatenate(
            np.broadcast_arrays(f_W, (self.lever * s * push)[..., None] * axis_B), axis=-1
        )


DRAWS: dict[str, Draw] = {
    "fan_jet": lambda rng, v: FanJet(
        tuple(log_uniform(rng, 0.04, 0.3) * weight(v) * direction(rng, 0.2)),
        tuple(rng.uniform([-1.0, -1.0, 1.0], [1.0, 1.0, 2.5])),
        rng.uniform(0.5, 1.2),
    ),
    "wind_shear": lambda rng, v: WindShear(
        log_uniform(rng, 0.1, 1.0) * v.mass, rng.uniform(1.0, 2.0), any_course(rng)
    ),
    "doorway_draft": lambda rng, v: DoorwayDraft(
        tuple(log_uniform(rng, 0.03, 0.2) * weight(v) * direction(rng, 0.2)),
        level_direction(rng),
        rng.uniform(-0.7, 0.7),
        rng.uniform(0.05, 0.3),
    ),
    "standing_eddy": lambda rng, v: StandingEddy(
        signed(rng, 0.03, 0.2) * weight(v),
        tuple(rng.uniform(-1.0, 1.0, 2).tolist()),
        rng.uniform(0.4, 1.5),
    ),
    "passing_vehicle": lambda rng, v: PassingVehicle(
        force=log_uniform(rng, 0.04, 0.3) * weight(v),
        lever=rng.uniform(0.05, 0.3) * arm(v),
        period=(period := rng.uniform(3.0, 8.0)),
        passage=rng.uniform(0.0, period),
        duration=rng.uniform(0.1, 0.4),
        course=any_course(rng),
    ),
}
