"""Out-of-library ground, walls and ceiling, for the simulator `rotorpy`."""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.library_effects import Instant, Law, Values, at_center
from diagrams.challenge.simulators.rotorpy.out_of_library.base import from_world, of_rotors
from np_drake.vehicle import Vehicle


def wall_suction(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A share of the thrust pulls towards a wall, less and less with the distance from it."""
    normal = np.array(c["normal"])
    away = max(c["from_origin"] - float(normal @ now.p), 0.0)
    return from_world(now, c["strength"] * float(now.thrust.sum()) * math.exp(-away / c["reach"]) * normal)


def ceiling_effect(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """More thrust the nearer the ceiling is."""
    gap = max(c["height"] - float(now.p[2]), 0.0)
    return at_center(0.0, 0.0, float(now.thrust.sum()) * c["strength"] / math.exp(gap / c["reach"]))


def tilted_cushion(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """About the level axis in which body z leans away from the vertical, against that lean."""
    lean_x, lean_y, _ = now.R[:, 2].tolist()
    size = c["lever"] * float(now.thrust.sum()) / math.exp(max(float(now.p[2]), 0.0) / c["reach"])
    tau_W = np.array([size * lean_y, -size * lean_x, 0.0])
    return np.append([0.0, 0.0, 0.0], tau_W @ now.R)


def platform_edge(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """More thrust for each rotor by its own height and place; the edge is a logistic curve."""
    gained = np.zeros(4)
    for i, place in enumerate(vehicle.rotor_positions):
        x, y, z = (now.p + now.R @ place).tolist()
        inside = c["normal"][0] * x + c["normal"][1] * y + c["normal"][2] * z - c["from_origin"]
        exponent = min(-2.0 * inside / c["edge"], 700.0)  # beyond which the exponential overflows
        cushion = c["strength"] / math.exp(max(z - c["height"], 0.0) / c["reach"])
        gained[i] = cushion * now.thrust[i] / (1.0 + math.exp(exponent))
    return of_rotors(vehicle, gained)


LAWS: dict[str, Law] = {
    "wall_suction": wall_suction,
    "ceiling_effect": ceiling_effect,
    "tilted_cushion": tilted_cushion,
    "platform_edge": platform_edge,
}
