"""The further foreign kinds, written anew for the simulator `rotorpy`."""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.library_effects import Instant, Law, Values, at_center
from np_drake.vehicle import Vehicle


def vortex_ring(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A dip of the thrust about one speed of descent."""
    off = (c["speed"] - -float(now.v[2])) / c["width"]
    return at_center(0.0, 0.0, -c["loss"] * float(now.thrust.sum()) * math.exp(-off * off))


def weathervane(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Yaw torque from flow that comes from the side."""
    return np.array([0, 0, 0, 0, 0, c["c"] * math.hypot(*now.air) * float(now.air[1])])


def ceiling_effect(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """More thrust the nearer the ceiling is."""
    gap = max(c["height"] - float(now.p[2]), 0.0)
    return at_center(0.0, 0.0, float(now.thrust.sum()) * c["strength"] / math.exp(gap / c["reach"]))


def rotor_saturation(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """What every rotor lacks above its limit."""
    over = now.thrust - np.minimum(now.thrust, c["limit"])
    return of_rotors(vehicle, -over)


def twisted_cable(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A torque about the vertical, back to the heading of the world's x axis."""
    x, y = float(now.R[0, 0]), float(now.R[1, 0])
    turn_W = np.array([0.0, 0.0, -c["k"] * y / max(math.hypot(x, y), 1e-12)])
    return np.concatenate([np.zeros(3), turn_W @ now.R])


def sliding_load(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """The torque of a weight that lies where the floor is lowest, a little at little tilt."""
    x, y = now.R[2, :2].tolist()
    lean = math.hypot(x, y)
    if lean < 1e-9:
        return np.zeros(6)
    way = c["moment"] * math.tanh(lean / c["tilt"]) / lean
    return np.array([0.0, 0.0, 0.0, way * y, -way * x, 0.0])


def stuttering_rotor(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """One rotor gives less at the beginning of every period."""
    lost = np.zeros(4)
    if now.t % c["period"] < c["share"] * c["period"]:
        lost[c["rotor"]] = c["loss"] * now.thrust[c["rotor"]]
    return of_rotors(vehicle, -lost)


def wind_shear(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A level force that grows with height and turns round at one."""
    push = c["c"] * (float(now.p[2]) - c["height"])
    f_W = np.array([push * math.cos(c["course"]), push * math.sin(c["course"]), 0.0])
    return np.concatenate([f_W @ now.R, np.zeros(3)])


def of_rotors(vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
    """(6,) of additional thrusts (4,) [N]."""
    force, *torque = vehicle.mixer @ thrust
    return np.array([0.0, 0.0, force, *torque])


FURTHER_LAWS: dict[str, Law] = {
    "vortex_ring": vortex_ring,
    "weathervane": weathervane,
    "ceiling_effect": ceiling_effect,
    "rotor_saturation": rotor_saturation,
    "twisted_cable": twisted_cable,
    "sliding_load": sliding_load,
    "stuttering_rotor": stuttering_rotor,
    "wind_shear": wind_shear,
}
