"""Out-of-library aerodynamics of airframe and rotors, for the simulator `rotorpy`."""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.library_effects import Instant, Law, Values, at_center, cross
from diagrams.challenge.simulators.rotorpy.out_of_library.base import StatefulEffect, of_rotors
from np_drake.vehicle import Vehicle


def rotational_damping(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Torque against the body rates, with their square, every axis for itself."""
    return np.concatenate([np.zeros(3), -c["c"] * now.w * np.abs(now.w)])


def magnus_force(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """The force c w x v in body axes."""
    return at_center(*(c["c"] * cross(now.w, now.air)))


def side_lift(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Body y force with the forward air speed and the climb rate."""
    return at_center(0.0, c["c"] * abs(float(now.air[0])) * float(now.v[2]), 0.0)


def weathervane(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Yaw torque from flow that comes from the side."""
    return np.array([0, 0, 0, 0, 0, c["c"] * math.hypot(*now.air) * float(now.air[1])])


def panel_flutter(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Up and down at one place, once the air is fast."""
    square = float(now.air @ now.air)
    excess = square - c["onset"] * c["onset"]
    if excess <= 0.0:
        return np.zeros(6)
    lift = c["force"] * excess / square * math.sin(math.tau * c["frequency"] * now.t + c["phase"])
    return np.array([0.0, 0.0, lift, c["y"] * lift, -c["x"] * lift, 0.0])


def bent_vane(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Yaw torque with thrust, less in flow from the side."""
    x, y, _ = now.air.tolist()
    half = c["speed"] * c["speed"]
    left = half / (half + x * x + y * y)
    return np.array([0.0, 0.0, 0.0, 0.0, 0.0, c["lever"] * left * float(now.thrust.sum())])


def vortex_ring(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A dip of the thrust about one speed of descent."""
    off = (c["speed"] - -float(now.v[2])) / c["width"]
    return at_center(0.0, 0.0, -c["loss"] * float(now.thrust.sum()) * math.exp(-off * off))


def wake_interference(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """The rear rotors give less, most of all at one speed."""
    x, y, _ = now.air.tolist()
    level = math.hypot(x, y)
    if level < 1e-12:
        return np.zeros(6)
    u = level / c["speed"]
    worst = c["loss"] * u * math.exp(0.5 - 0.5 * u * u)
    lost = np.zeros(4)
    for i, (along_x, along_y, _) in enumerate(vehicle.rotor_positions):
        ahead = (along_x * x + along_y * y) / (math.hypot(along_x, along_y) * level)
        lost[i] = worst * max(-ahead, 0.0) * now.thrust[i]
    return of_rotors(vehicle, -lost)


def odd_propeller(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A force in the plane of the rotors at one of them, across the flow, with that rotor's speed."""
    load = max(float(now.thrust[c["rotor"]]), 0.0)
    size = 2.0 * c["c"] * math.sqrt(load / (vehicle.mass * vehicle.gravity))
    force = np.array([-size * now.air[1], size * now.air[0], 0.0])
    return np.append(force, cross(np.array(vehicle.rotor_positions[c["rotor"]]), force))


class DynamicInflow(StatefulEffect):
    """Every rotor's thrust with a share of its own high-pass. State: the four low-passes [N]."""

    size = 4

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """Return the low-passes (4,) [N]."""
        return self.vehicle.unmixer @ drive

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the overshoot; no rotor pulls downwards."""
        load = self.vehicle.unmixer @ drive
        change = load - own
        over = np.maximum(self.c["gain"] * change, -load)
        return self.vehicle.mixer @ over, change / self.c["time"]


LAWS: dict[str, Law] = {
    "rotational_damping": rotational_damping,
    "magnus_force": magnus_force,
    "side_lift": side_lift,
    "weathervane": weathervane,
    "panel_flutter": panel_flutter,
    "bent_vane": bent_vane,
    "vortex_ring": vortex_ring,
    "wake_interference": wake_interference,
    "odd_propeller": odd_propeller,
}
STATEFUL: dict[str, type[StatefulEffect]] = {
    "dynamic_inflow": DynamicInflow,
}
