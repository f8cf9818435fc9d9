"""Aerodynamics of airframe and rotors that the library does not have.

Source of each law: own choice, of what vehicles are known to meet.
"""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from diagrams.challenge.out_of_library.base import (
    LaggingActuator,
    OutOfLibraryWrench,
    chi_along_z,
    chi_of_rotors,
    chi_of_torque,
)
from np_drake.effects.air_speed import air_velocity_B, chi_from_body
from np_drake.effects.base import Motion
from np_drake.rigid_body import V, W
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class RotationalDamping(OutOfLibraryWrench):
    """Quadratic damping of the body rates: tau = -c |w| w, axis by axis."""

    c: float  # [N·m·s²/rad²]
    identifier: ClassVar[str] = "rotational_damping"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi (..., 6) [N, N·m]."""
        w = motion.x[..., W]
        return chi_of_torque(-self.c * np.abs(w) * w)


@dc.dataclass(frozen=True)
class MagnusForce(OutOfLibraryWrench):
    """A Magnus force on a body that turns: f_B = c w x v, v the air velocity in body axes."""

    c: float  # [N·s²/(m·rad)]
    identifier: ClassVar[str] = "magnus_force"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi (..., 6) [N, N·m]."""
        return chi_from_body(motion, self.c * np.cross(motion.x[..., W], air_velocity_B(motion)))


@dc.dataclass(frozen=True)
class SideLift(OutOfLibraryWrench):
    """Side force of a slanted plate that deflects the flow: f_B,y = c |v_x| v_z."""

    c: float  # [N·s²/m²]
    identifier: ClassVar[str] = "side_lift"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi (..., 6) [N, N·m]."""
        v_B = air_velocity_B(motion)
        f_B = np.zeros_like(v_B)
        f_B[..., 1] = self.c * np.abs(v_B[..., 0]) * motion.x[..., V][..., 2]
        return chi_from_body(motion, f_B)


@dc.dataclass(frozen=True)
class Weathervane(OutOfLibraryWrench):
    """A tail that turns into the wind: tau_z = c |v| v_y in body axes."""

    c: float  # [N·s²/m]
    identifier: ClassVar[str] = "weathervane"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi (..., 6) [N, N·m]."""
        v_B = air_velocity_B(motion)
        turn = self.c * np.linalg.norm(v_B, axis=-1) * v_B[..., 1]
        return chi_of_torque(turn[..., None] * np.array([0.0, 0.0, 1.0]))


@dc.dataclass(frozen=True)
class PanelFlutter(OutOfLibraryWrench):
    """A loose panel at (x, y) flutters in air faster than `onset`: f_z = force a sin(2 pi frequency t + phase) in B.

    a = max(1 - onset² / |v|², 0); tau = place x f.
    """

    force: float  # in very fast air [N]
    x: float  # place [m]
    y: float
    onset: float  # [m/s]
    frequency: float  # [Hz]
    phase: float  # [rad]
    identifier: ClassVar[str] = "panel_flutter"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi (..., 6) [N, N·m]."""
        speed = np.linalg.norm(air_velocity_B(motion), axis=-1)
        share = 1.0 - (self.onset / np.maximum(speed, self.onset)) ** 2
        wave = np.sin(2 * np.pi * self.frequency * np.asarray(motion.t) + self.phase)
        f_B = (self.force * share * wave)[..., None] * np.array([0.0, 0.0, 1.0])
        return chi_from_body(motion, f_B, np.cross([self.x, self.y, 0.0], f_B))


@dc.dataclass(frozen=True)
class BentVane(OutOfLibraryWrench):
    """A bent plate in the rotors' wake twists: tau_z = lever F / (1 + (u / speed)²), F of all rotors.

    u is the lateral air speed: flow from the side blows the wake off the plate.
    """

    lever: float  # in hover [m]
    speed: float  # at which half of it is left [m/s]
    identifier: ClassVar[str] = "bent_vane"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi (..., 6) [N, N·m]."""
        lateral = np.sum(air_velocity_B(motion)[..., :2] ** 2, axis=-1)
        turn = self.lever * motion.rotor_thrust.sum(axis=-1) / (1.0 + lateral / self.speed**2)
        return chi_of_torque(turn[..., None] * np.array([0.0, 0.0, 1.0]))


@dc.dataclass(frozen=True)
class VortexRing(OutOfLibraryWrench):
    """Vortex ring state: the rotors lose `loss` of their thrust in a descent at about `speed`."""

    loss: float  # [1]
    speed: float  # of descent [m/s]
    width: float  # [m/s]
    identifier: ClassVar[str] = "vortex_ring"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi (..., 6) [N, N·m]."""
        off = (motion.x[..., V][..., 2] + self.speed) / self.width
        return chi_along_z(motion, -self.loss * motion.rotor_thrust.sum(axis=-1) * np.exp(-(off**2)))


@dc.dataclass(frozen=True)
class WakeInterference(OutOfLibraryWrench):
    """Rotors behind others fly in their wake: each loses loss b g of its thrust, most at one air `speed`.

    g = u exp((1 - u²) / 2), u = level speed / speed; b = cosine of the angle between rotor and dead astern, 0
    for those ahead.
    """

    loss: float  # [1]
    speed: float  # [m/s]
    identifier: ClassVar[str] = "wake_interference"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi (..., 6) [N, N·m]."""
        v = air_velocity_B(motion)[..., :2]
        u = np.linalg.norm(v, axis=-1, keepdims=True) / self.speed
        place = np.array(vehicle.rotor_positions)[:, :2]
        outwards = place / np.linalg.norm(place, axis=1, keepdims=True)
        astern = np.maximum(-v @ outwards.T, 0.0) / self.speed  # b u
        lost = self.loss * np.exp(0.5 * (1.0 - u**2)) * astern * motion.rotor_thrust
        given = -lost @ vehicle.mixer.T
        return chi_of_rotors(motion, given)


@dc.dataclass(frozen=True)
class OddPropeller(OutOfLibraryWrench):
    """One propeller of another make: its side force is not balanced by those that turn the other way.

    f = c sqrt(f_i / h) (z x v) in B at the rotor, v of Bo through the air, h the thrust in hover;
    tau = place x f.
    """

    rotor: int  # 0, 1, 2, 3
    c: float  # in hover [N·s/m]
    identifier: ClassVar[str] = "odd_propeller"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi (..., 6) [N, N·m]."""
        over_hover = 4 * motion.rotor_thrust[..., self.rotor] / (vehicle.mass * vehicle.gravity)
        turning = np.sqrt(np.maximum(over_hover, 0.0))  # speed of the rotor over that in hover
        f_B = self.c * turning[..., None] * np.cross([0.0, 0.0, 1.0], air_velocity_B(motion))
        return chi_from_body(motion, f_B, np.cross(vehicle.rotor_positions[self.rotor], f_B))


@dc.dataclass(frozen=True)
class DynamicInflow(LaggingActuator):
    """The air through a rotor follows late, so thrust overshoots: f = c + gain (c - s), time s' = c - s."""

    gain: float  # [1]
    time: float  # [s]
    identifier: ClassVar[str] = "dynamic_inflow"
    state_size: ClassVar[int] = 4

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the state at rest: (..., 4) filtered thrust [N]."""
        return np.array(thrust, float)

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return what the rotors give (..., 4) [N]."""
        return np.maximum(command + self.gain * (command - state), 0.0)
