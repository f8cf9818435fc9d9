"""Tethers, cables, friction and loose or turning masses: mechanical effects that the library does
not have.

Source of each law: own choice, of what vehicles are known to meet.
"""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from diagrams.challenge.out_of_library.base import (
    UP,
    Draw,
    OutOfLibraryActuator,
    OutOfLibraryWrench,
    chi_of_force,
    chi_of_torque,
    ground_place,
    weight,
)
from np_drake.effects.base import Motion
from np_drake.effects.parameter import arm, direction, log_uniform, signed
from np_drake.rigid_body import P, V, W
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class PeriodicForce(OutOfLibraryWrench):
    """A periodic disturbance: f = force sin(2 pi frequency t + phase) in W."""

    force: tuple[float, float, float]  # [N]
    frequency: float  # [Hz]
    phase: float  # [rad]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        wave = np.sin(2 * np.pi * self.frequency * np.asarray(motion.t) + self.phase)
        return chi_of_force(
            np.broadcast_to(wave[..., None] * self.force, (*motion.x.shape[:-1], 3))
        )


@dc.dataclass(frozen=True)
class GroundTether(OutOfLibraryWrench):
    """A rubber band from `anchor` to Bo: stiffness times what is beyond `slack`, and it only
    pulls.
    """

    stiffness: float  # [N/m]
    slack: float  # [m]
    anchor: tuple[float, float, float]  # [m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        r = motion.x[..., P] - self.anchor
        span = np.maximum(np.linalg.norm(r, axis=-1, keepdims=True), 1e-6)
        return chi_of_force(-self.stiffness * np.maximum(span - self.slack, 0.0) * r / span)


@dc.dataclass(frozen=True)
class WinchTether(OutOfLibraryWrench):
    """A winch keeps a tether taut: f = -tension (1 + friction tanh(v · n / creep)) n in W.

    n is the direction from `anchor` to Bo. The drum rubs, so it pulls harder while the tether runs
    out than while it is wound in.
    """

    tension: float  # at constant length [N]
    friction: float  # of the drum, over the tension [1]
    creep: float  # speed at which the drum begins to slip [m/s]
    anchor: tuple[float, float, float]  # [m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        r = motion.x[..., P] - self.anchor
        n = r / np.maximum(np.linalg.norm(r, axis=-1, keepdims=True), 1e-6)
        runs_out = np.sum(motion.x[..., V] * n, axis=-1, keepdims=True)
        return chi_of_force(
            -self.tension * (1.0 + self.friction * np.tanh(runs_out / self.creep)) * n
        )


@dc.dataclass(frozen=True)
class RubbingLine(OutOfLibraryWrench):
    """Dry friction of a safety line where it is led round: f = -force tanh(|v| / creep) v / |v|
    in W.
    """

    force: float  # of dry friction [N]
    creep: float  # speed at which it begins to slip [m/s]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        v = motion.x[..., V]
        speed = np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)
        return chi_of_force(-self.force * np.tanh(speed / self.creep) * v / speed)


@dc.dataclass(frozen=True)
class LiftedCable(OutOfLibraryWrench):
    """The weight of what a vehicle has lifted of a cable on the ground: f_z = -density g z in W."""

    density: float  # of the cable [kg/m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        lifted = np.maximum(motion.x[..., P][..., 2], 0.0)
        return chi_of_force(-self.density * vehicle.gravity * lifted[..., None] * UP)


@dc.dataclass(frozen=True)
class TwistedCable(OutOfLibraryWrench):
    """A power cable that was laid out straight twists back: tau = -k sin(heading) about the
    vertical.
    """

    k: float  # [N·m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        R = motion.R_WB
        heading = np.arctan2(R[..., 1, 0], R[..., 0, 0])
        return chi_of_torque(-self.k * np.sin(heading)[..., None] * R[..., 2, :])


@dc.dataclass(frozen=True)
class StickingAxis(OutOfLibraryWrench):
    """An axis that sticks for `share` of every `period`: -drag w brakes it and `torque` twists
    it.
    """

    axis: int  # 0, 1, 2
    drag: float  # [N·m·s/rad]
    torque: float  # [N·m]
    period: float  # [s]
    share: float  # [1]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        stuck = np.mod(motion.t, self.period) < self.share * self.period
        chi = np.zeros((*motion.x.shape[:-1], 6))
        chi[..., 3 + self.axis] = stuck * (
            self.torque - self.drag * motion.x[..., W][..., self.axis]
        )
        return chi


@dc.dataclass(frozen=True)
class SpinningLidar(OutOfLibraryWrench):
    """A part that turns steadily, whatever the rotors do: tau = -w x h with h along body z."""

    h: float  # angular momentum [N·m·s]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        return chi_of_torque(-np.cross(motion.x[..., W], [0.0, 0.0, self.h]))


@dc.dataclass(frozen=True)
class SlidingLoad(OutOfLibraryWrench):
    """A load slides to the low side: tau = moment (n_y, -n_x) tanh(|n| / tilt) / |n| with n the
    lean of W's z in B.
    """

    moment: float  # weight times way [N·m]
    tilt: float  # [rad]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        n = motion.R_WB[..., 2, :]
        lean = np.maximum(np.hypot(n[..., 0], n[..., 1]), 1e-9)
        size = self.moment * np.tanh(lean / self.tilt) / lean
        return chi_of_torque(
            size[..., None] * np.stack([n[..., 1], -n[..., 0], np.zeros_like(lean)], axis=-1)
        )


@dc.dataclass(frozen=True)
class SprungLoad(OutOfLibraryActuator):
    """A load on springs bounces along body z: extra collective thrust = share (F - s - 2 damping s'
    / w).

    s'' = w² (F - s) - 2 damping w s', w = 2 pi frequency; -s / (m w²) is the load's way from the
    frame [m], and its acceleration from it is what the frame feels.
    """

    frequency: float  # [Hz]
    damping: float  # [1]
    share: float  # of the mass [1]
    state_size: ClassVar[int] = 2

    def _rest(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state at rest: (..., 2) displacement in collective thrust [N] and its rate
        [N/s].
        """
        total = np.sum(thrust, axis=-1)
        return np.stack([total, np.zeros_like(total)], axis=-1)

    def _rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the rate of the state (..., 2) [N/s, N/s²]."""
        w = 2 * np.pi * self.frequency
        return np.stack([state[..., 1], w**2 * self._unmoved(state, command)], axis=-1)

    def _given(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        return (
            command + self.share * self._unmoved(state, command)[..., None] * vehicle.unmixer[:, 0]
        )

    def _unmoved(self, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return (...,) F - s - 2 damping s' / w [N]."""
        w = 2 * np.pi * self.frequency
        return np.sum(command, axis=-1) - state[..., 0] - 2 * self.damping * state[..., 1] / w


@dc.dataclass(frozen=True)
class LiquidSlosh(OutOfLibraryActuator):
    """Liquid in a tank as two oscillators (roll, pitch) that the commanded torques drive; it twists
    back.

    s'' = -2 damping w s' - w² s + w² tau, w = 2 pi frequency; extra torque = -gain s.
    """

    frequency: float  # [Hz]
    damping: float  # [1]
    gain: float  # [1]
    state_size: ClassVar[int] = 4

    def _rest(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state at rest: (4,) displacement in torque [N·m] and its rate [N·m/s]."""
        return np.concatenate([vehicle.mixer[1:3] @ thrust, np.zeros(2)])

    def _rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the rate of the state (..., 4)."""
        w, s, rate = 2 * np.pi * self.frequency, state[..., :2], state[..., 2:]
        drive = w**2 * (command @ vehicle.mixer[1:3].T - s) - 2 * self.damping * w * rate
        return np.concatenate([rate, drive], axis=-1)

    def _given(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        return command - self.gain * (state[..., :2] @ vehicle.unmixer[:, 1:3].T)


def _sticking_axis(rng: np.random.Generator, vehicle: Vehicle) -> StickingAxis:
    axis = int(rng.integers(3))
    inertia = vehicle.J[axis, axis]
    torque = float(rng.choice([-1, 1]) * log_uniform(rng, 0.6, 4.0) * inertia)
    drag = log_uniform(rng, 0.5, 4.0) * inertia
    return StickingAxis(axis, drag, torque, rng.uniform(1.5, 5.0), rng.uniform(0.15, 0.5))


DRAWS: dict[str, Draw] = {
    "periodic_force": lambda rng, v: PeriodicForce(
        tuple(log_uniform(rng, 0.03, 0.2) * weight(v) * direction(rng)),
        log_uniform(rng, 0.4, 4.0),
        rng.uniform(0, 2 * np.pi),
    ),
    "ground_tether": lambda rng, v: GroundTether(
        anchor=ground_place(rng),
        stiffness=log_uniform(rng, 0.3, 2.0) * v.mass,
        slack=rng.uniform(0.3, 1.2),
    ),
    "winch_tether": lambda rng, v: WinchTether(
        tension=log_uniform(rng, 0.03, 0.25) * weight(v),
        anchor=ground_place(rng),
        friction=rng.uniform(0.1, 0.5),
        creep=rng.uniform(0.05, 0.2),
    ),
    "rubbing_line": lambda rng, v: RubbingLine(
        log_uniform(rng, 0.01, 0.12) * weight(v), rng.uniform(0.1, 0.4)
    ),
    "lifted_cable": lambda rng, v: LiftedCable(log_uniform(rng, 0.005, 0.06) * v.mass),
    "twisted_cable": lambda rng, v: TwistedCable(log_uniform(rng, 0.5, 5.0) * v.J[2, 2]),
    "sticking_axis": _sticking_axis,
    "spinning_lidar": lambda rng, v: SpinningLidar(signed(rng, 0.5, 10.0) * v.J[0, 0]),
    "sliding_load": lambda rng, v: SlidingLoad(
        log_uniform(rng, 0.005, 0.05) * arm(v) * weight(v), rng.uniform(0.03, 0.15)
    ),
    "sprung_load": lambda rng, v: SprungLoad(
        log_uniform(rng, 0.8, 2.5), rng.uniform(0.02, 0.15), log_uniform(rng, 0.12, 0.5)
    ),
    "liquid_slosh": lambda rng, v: LiquidSlosh(
        rng.uniform(1.0, 4.0), rng.uniform(0.05, 0.2), log_uniform(rng, 0.1, 0.35)
    ),
}
