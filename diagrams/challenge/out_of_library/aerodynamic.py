"""Aerodynamics of airframe and rotors that the library does not have.

Source of each law: own choice, of what vehicles are known to meet.
"""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from diagrams.challenge.out_of_library.base import (
    UP,
    Draw,
    LaggingActuator,
    OutOfLibraryWrench,
    any_rotor,
    chi_along_z,
    chi_of_rotors,
    chi_of_torque,
    hover_thrust,
    level_offset,
    weight,
)
from np_drake.effects.air_speed import air_velocity_B, chi_from_body
from np_drake.effects.base import Motion
from np_drake.effects.parameter import arm, log_uniform, signed
from np_drake.rigid_body import V, W
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class RotationalDamping(OutOfLibraryWrench):
    """Quadratic damping of the body rates: tau = -c |w| w, axis by axis."""

    c: float  # [N·m·s²/rad²]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        w = motion.x[..., W]
        return chi_of_torque(-self.c * np.abs(w) * w)


@dc.dataclass(frozen=True)
class MagnusForce(OutOfLibraryWrench):
    """A Magnus force on a body that turns: f_B = c w x v, v the air velocity in body axes."""

    c: float  # [N·s²/(m·rad)]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        return chi_from_body(motion, self.c * np.cross(motion.x[..., W], air_velocity_B(motion)))


@dc.dataclass(frozen=True)
class SideLift(OutOfLibraryWrench):
    """Side force of a slanted plate that deflects the flow: f_B,y = c |v_x| v_z."""

    c: float  # [N·s²/m²]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        v_B = air_velocity_B(motion)
        f_B = np.zeros_like(v_B)
        f_B[..., 1] = self.c * np.abs(v_B[..., 0]) * motion.x[..., V][..., 2]
        return chi_from_body(motion, f_B)


@dc.dataclass(frozen=True)
class Weathervane(OutOfLibraryWrench):
    """A tail that turns into the wind: tau_z = c |v| v_y in body axes."""

    c: float  # [N·s²/m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        v_B = air_velocity_B(motion)
        turn = self.c * np.linalg.norm(v_B, axis=-1) * v_B[..., 1]
        return chi_of_torque(turn[..., None] * UP)


@dc.dataclass(frozen=True)
class PanelFlutter(OutOfLibraryWrench):
    """A loose panel at (x, y) flutters in air faster than `onset`: f_z = force a sin(2 pi frequency
    t + phase) in B.

    a = max(1 - onset² / |v|², 0); tau = place x f.
    """

    force: float  # in very fast air [N]
    x: float  # place [m]
    y: float
    onset: float  # [m/s]
    frequency: float  # [Hz]
    phase: float  # [rad]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        speed = np.linalg.norm(air_velocity_B(motion), axis=-1)
        share = 1.0 - (self.onset / np.maximum(speed, self.onset)) ** 2
        wave = np.sin(2 * np.pi * self.frequency * np.asarray(motion.t) + self.phase)
        f_B = (self.force * share * wave)[..., None] * UP
        return chi_from_body(motion, f_B, np.cross([self.x, self.y, 0.0], f_B))


@dc.dataclass(frozen=True)
class BentVane(OutOfLibraryWrench):
    """A bent plate in the rotors' wake twists: tau_z = lever F / (1 + (u / speed)²), F of all
    rotors.

    u is the lateral air speed: flow from the side blows the wake off the plate.
    """

    lever: float  # in hover [m]
    speed: float  # at which half of it is left [m/s]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        lateral = np.sum(air_velocity_B(motion)[..., :2] ** 2, axis=-1)
        turn = self.lever * motion.rotor_thrust.sum(axis=-1) / (1.0 + lateral / self.speed**2)
        return chi_of_torque(turn[..., None] * UP)


@dc.dataclass(frozen=True)
class VortexRing(OutOfLibraryWrench):
    """Vortex ring state: the rotors lose `loss` of their thrust in a descent at about `speed`."""

    loss: float  # [1]
    speed: float  # of descent [m/s]
    width: float  # [m/s]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        off = (motion.x[..., V][..., 2] + self.speed) / self.width
        return chi_along_z(
            motion, -self.loss * motion.rotor_thrust.sum(axis=-1) * np.exp(-(off**2))
        )


@dc.dataclass(frozen=True)
class WakeInterference(OutOfLibraryWrench):
    """Rotors behind others fly in their wake: each loses loss b g of its thrust, most at one air
    `speed`.

    g = u exp((1 - u²) / 2), u = level speed / speed; b = cosine of the angle between rotor and dead
    astern, 0 for those ahead.
    """

    loss: float  # [1]
    speed: float  # [m/s]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        v = air_velocity_B(motion)[..., :2]
        u = np.linalg.norm(v, axis=-1, keepdims=True) / self.speed
        place = np.array(vehicle.rotor_positions)[:, :2]
        outwards = place / np.linalg.norm(place, axis=1, keepdims=True)
        astern = np.maximum(-v @ outwards.T, 0.0) / self.speed  # b u
        lost = self.loss * np.exp(0.5 * (1.0 - u**2)) * astern * motion.rotor_thrust
        return chi_of_rotors(motion, -lost @ vehicle.mixer.T)


@dc.dataclass(frozen=True)
class OddPropeller(OutOfLibraryWrench):
    """One propeller of another make: its side force is not balanced by those that turn the other
    way.

    f = c sqrt(f_i / h) (z x v) in B at the rotor, v of Bo through the air, h the thrust in hover;
    tau = place x f.
    """

    rotor: int  # 0, 1, 2, 3
    c: float  # in hover [N·s/m]

    def _chi(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        over_hover = motion.rotor_thrust[..., self.rotor] / hover_thrust(vehicle)
        turning = np.sqrt(np.maximum(over_hover, 0.0))  # speed of the rotor over that in hover
        f_B = self.c * turning[..., None] * np.cross([0.0, 0.0, 1.0], air_velocity_B(motion))
        return chi_from_body(motion, f_B, np.cross(vehicle.rotor_positions[self.rotor], f_B))


@dc.dataclass(frozen=True)
class DynamicInflow(LaggingActuator):
    """The air through a rotor follows late, so thrust overshoots: f = c + gain (c - s), time s' = c
    - s.
    """

    gain: float  # [1]
    time: float  # [s]
    state_size: ClassVar[int] = 4

    def _rest(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state at rest: (..., 4) filtered thrust [N]."""
        return np.array(thrust)

    def _given(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        return np.maximum(command + self.gain * (command - state), 0.0)


DRAWS: dict[str, Draw] = {
    "rotational_damping": lambda rng, v: RotationalDamping(log_uniform(rng, 0.5, 5.0) * v.J[0, 0]),
    "magnus_force": lambda rng, v: MagnusForce(log_uniform(rng, 0.03, 0.4) * v.mass),
    "side_lift": lambda rng, v: SideLift(log_uniform(rng, 0.05, 0.6) * v.mass),
    "weathervane": lambda rng, v: Weathervane(log_uniform(rng, 0.3, 3.0) * v.J[2, 2]),
    "panel_flutter": lambda rng, v: PanelFlutter(
        log_uniform(rng, 0.02, 0.2) * weight(v),
        *level_offset(rng, rng.uniform(0.1, 0.4) * arm(v)),
        rng.uniform(0.3, 1.0),
        log_uniform(rng, 1.0, 6.0),
        rng.uniform(0, 2 * np.pi),
    ),
    "bent_vane": lambda rng, v: BentVane(
        signed(rng, 0.3, 3.0) * v.J[2, 2] / weight(v), rng.uniform(0.8, 2.5)
    ),
    "vortex_ring": lambda rng, v: VortexRing(
        speed=(speed := rng.uniform(0.6, 1.8)),
        loss=log_uniform(rng, 0.04, 0.3),
        width=rng.uniform(0.3, 0.5) * speed,
    ),
    "wake_interference": lambda rng, v: WakeInterference(
        log_uniform(rng, 0.01, 0.15), rng.uniform(0.8, 2.5)
    ),
    "odd_propeller": lambda rng, v: OddPropeller(any_rotor(rng), signed(rng, 0.03, 0.3) * v.mass),
    "dynamic_inflow": lambda rng, v: DynamicInflow(
        log_uniform(rng, 0.1, 1.0), rng.uniform(0.06, 0.3)
    ),
}
