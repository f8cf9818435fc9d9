"""Forces, torques and thrusts of the effects, written for the simulator `rotorpy` from their equations alone.

Nothing here comes from the effects that a diagnosis fits: a slip in those would otherwise hide in both. The laws are
those of the table in docs/reference/effects.md; where rotorpy has another one (its drag and flapping grow with each
rotor's own speed, its body drag with the norm of the velocity), it is switched off.
"""

import dataclasses as dc
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from np_drake.vehicle import Vehicle

Values = Mapping[str, Any]


@dc.dataclass(frozen=True)
class ActiveEffect:
    """An effect as it is read from outside: its name, its parameters, and the seed of what is random in it."""

    name: str
    values: Values
    seed: int = 0


@dc.dataclass
class Instant:
    """The vehicle at one instant.

    t [s]; p (3,) of Bo in W [m]; R (3, 3) R_WB; v (3,) of Bo in W, air (3,) of Bo through the air
    in B [m/s]; w (3,) in B [rad/s]; thrust (4,) that the propellers give [N]; speed (4,) of the rotors [rad/s] and
    its rate, spin_up (4,) [rad/s²].
    """

    t: float
    p: np.ndarray
    R: np.ndarray
    v: np.ndarray
    air: np.ndarray
    w: np.ndarray
    thrust: np.ndarray
    speed: np.ndarray
    spin_up: np.ndarray


Law = Callable[[Vehicle, Values, Instant], np.ndarray]  # -> (6,) force at Bo and torque, both in B [N, N·m]
Gain = Callable[[Vehicle, Values, np.ndarray, float], np.ndarray]  # thrust (4,) [N], t [s] -> thrust (4,) [N]


def read_effect(effect: Any) -> ActiveEffect:
    """Return an effect's name, parameters and seed; an out-of-library effect has fields for parameters."""
    return ActiveEffect(effect.identifier, effect.values or dc.asdict(effect), getattr(effect, "seed", 0))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a x b of two vectors (3,), in a tenth of the time of NumPy's."""
    (a0, a1, a2), (b0, b1, b2) = a, b
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def at_center(f_x: float, f_y: float, f_z: float) -> np.ndarray:
    """Return the wrench (6,) of a force at Bo in B alone [N]."""
    return np.array([f_x, f_y, f_z, 0.0, 0.0, 0.0])


def linear_drag(vehicle: Vehicle, d: Values, now: Instant) -> np.ndarray:
    """Return drag -d_i v_i, proportional to the mean rotor speed that the thrusts show, over that in hover."""
    hover = vehicle.mass * vehicle.gravity / 4
    turning = sum(math.sqrt(max(f, 0.0) / hover) for f in now.thrust.tolist()) / 4
    x, y, z = now.air.tolist()
    return at_center(-turning * d["d_x"] * x, -turning * d["d_y"] * y, -turning * d["d_z"] * z)


def quadratic_drag(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Return drag -c_i |v_i| v_i, every axis for itself."""
    x, y, z = now.air.tolist()
    return at_center(-c["c_x"] * x * abs(x), -c["c_y"] * y * abs(y), -c["c_z"] * z * abs(z))


def blade_flapping(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Return the torque moment * v x z: flying ahead (+x) raises the nose (torque about -y)."""
    x, y, _ = now.air.tolist()
    return np.array([0.0, 0.0, 0.0, c["moment"] * y, -c["moment"] * x, 0.0])


def translational_lift(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Return the force lift * (lateral air speed)² along body z."""
    x, y, _ = now.air.tolist()
    return at_center(0.0, 0.0, c["lift"] * (x * x + y * y))


def rotor_inflow(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Return the thrust of discs in a flow: blade elements see less incidence by what goes through the disc.

    The induced velocity w solves Glauert's w |V + w e_z| = T / (2 rho A), here by bisection of the upper branch.
    """
    density, disc = 1.2, math.pi * vehicle.rotor_radius**2
    gain = c["slope"] * density * disc * vehicle.rotor_radius / 4
    x, y, z = now.air.tolist()
    side, more = math.hypot(x, y), 0.0
    for thrust in (max(f, 0.0) for f in now.thrust.tolist()):
        rest = math.sqrt(thrust / (2 * density * disc))
        low, high = max(0.0, -z) if -z * side < rest**2 else 0.0, rest + abs(z)
        for _ in range(50):
            middle = 0.5 * (low + high)
            short = middle * math.hypot(side, z + middle) < rest**2
            low, high = (middle, high) if short else (low, middle)
        more += gain * math.sqrt(thrust / vehicle.thrust_coefficient) * (rest - high - z)
    return at_center(0.0, 0.0, more)


def rotor_gyroscopic(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Return the torque -w x h - h' of the rotors' angular momentum h along body z, against their torque."""
    signs = np.array(vehicle.rotor_directions)
    h = -c["rotor_inertia"] * float(signs @ now.speed)
    h_rate = -c["rotor_inertia"] * float(signs @ now.spin_up)
    x, y, _ = now.w.tolist()
    return np.array([0.0, 0.0, 0.0, -y * h, x * h, -h_rate])


def thrust_drift(vehicle: Vehicle, c: Values, thrust: np.ndarray, t: float) -> np.ndarray:
    """Return the thrust of propellers that all drift with the flight's time."""
    return (c["start"] + c["rate"] * t) * thrust


def weak_rotor(vehicle: Vehicle, c: Values, thrust: np.ndarray, t: float) -> np.ndarray:
    """Return the thrust with one weak propeller of four, counted from 1."""
    share = [c["efficiency"] if i == round(c["rotor"]) else 1.0 for i in (1, 2, 3, 4)]
    return np.array(share) * thrust


def cushion(c: Values, height: float) -> float:
    """Return the thrust over that far from the ground, by the method of images; at most 1.5."""
    ratio = c["effective_radius"] / (4.0 * max(height, 1e-6))
    return 1.0 / (1.0 - min(ratio * ratio, 1.0 / 3.0))


LAWS: dict[str, Law] = {
    "linear_drag": linear_drag,
    "quadratic_drag": quadratic_drag,
    "blade_flapping": blade_flapping,
    "translational_lift": translational_lift,
    "rotor_inflow": rotor_inflow,
    "rotor_gyroscopic": rotor_gyroscopic,
}
GAINS: dict[str, Gain] = {
    "thrust_drift": thrust_drift,
    "weak_rotor": weak_rotor,
}
