"""Out-of-library tethers, friction and loose or turning masses, for the simulator `rotorpy`."""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.library_effects import Instant, Law, Values
from diagrams.challenge.simulators.rotorpy.out_of_library.base import StatefulEffect, from_world
from np_drake.vehicle import Vehicle


def periodic_force(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A force in W that swings with the flight's time."""
    return from_world(now, math.sin(math.tau * c["frequency"] * now.t + c["phase"]) * np.array(c["force"]))


def ground_tether(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A rubber band to a place on the ground; slack until it is stretched."""
    way = np.subtract(c["anchor"], now.p)
    span = math.sqrt(float(way @ way))
    stretch = max(span - c["slack"], 0.0)
    return from_world(now, c["stiffness"] * stretch / max(span, 1e-6) * way)


def winch_tether(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A pull towards the winch that is as strong far away as near, and weaker while the tether comes in."""
    way = np.subtract(c["anchor"], now.p)
    span = max(math.sqrt(float(way @ way)), 1e-6)
    comes_in = float(now.v @ way) / span
    pull = c["tension"] * (1.0 - c["friction"] * math.tanh(comes_in / c["creep"]))
    return np.append(pull / span * (way @ now.R), [0.0, 0.0, 0.0])


def rubbing_line(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Against the way over ground, and soon no stronger the faster it goes."""
    speed = math.sqrt(float(now.v @ now.v))
    if speed < 1e-12:
        return np.zeros(6)
    fade = math.exp(-2.0 * speed / c["creep"])
    friction = c["force"] * (1.0 - fade) / (1.0 + fade)
    return np.append(-friction / speed * (now.v @ now.R), [0.0, 0.0, 0.0])


def lifted_cable(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Weight that grows with height."""
    weight = vehicle.gravity * c["density"] * max(float(now.p[2]), 0.0)
    return np.append(-weight * now.R[2], [0.0, 0.0, 0.0])


def twisted_cable(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A torque about the vertical, back to the heading of the world's x axis."""
    x, y = float(now.R[0, 0]), float(now.R[1, 0])
    turn_W = np.array([0.0, 0.0, -c["k"] * y / max(math.hypot(x, y), 1e-12)])
    return np.concatenate([np.zeros(3), turn_W @ now.R])


def sticking_axis(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """At the beginning of every period one axis is braked and twisted."""
    out = np.zeros(6)
    if now.t % c["period"] < c["share"] * c["period"]:
        out[3 + c["axis"]] = c["torque"] - c["drag"] * now.w[c["axis"]]
    return out


def spinning_lidar(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Roll rate twists in pitch, pitch rate in roll."""
    x, y, _ = now.w.tolist()
    return np.array([0.0, 0.0, 0.0, -c["h"] * y, c["h"] * x, 0.0])


def sliding_load(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """The torque of a weight that lies where the floor is lowest, a little at little tilt."""
    x, y = now.R[2, :2].tolist()
    lean = math.hypot(x, y)
    if lean < 1e-9:
        return np.zeros(6)
    way = c["moment"] * math.tanh(lean / c["tilt"]) / lean
    return np.array([0.0, 0.0, 0.0, way * y, -way * x, 0.0])


class SprungLoad(StatefulEffect):
    """A mass on a damped spring along body z. State: its way up from the frame [m] and the rate [m/s]."""

    size = 2

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """Return the state (2,) in which the spring carries the load."""
        stiffness = (math.tau * self.c["frequency"]) ** 2
        return np.array([-float(drive[0]) / (stiffness * self.vehicle.mass), 0.0])

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what the frame is pushed less, or more, as the load accelerates away from it."""
        way, rate = own.tolist()
        w, mass = math.tau * self.c["frequency"], self.vehicle.mass
        acceleration = -w * w * way - 2.0 * self.c["damping"] * w * rate - float(drive[0]) / mass
        added = -self.c["share"] * mass * acceleration
        return np.array([added, 0.0, 0.0, 0.0]), np.array([rate, acceleration])


class LiquidSlosh(StatefulEffect):
    """Two damped oscillators behind roll and pitch torque. State: deflections [N·m] and their rates [N·m/s]."""

    size = 4

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """Return deflections and rates (4,) at rest."""
        return np.array([drive[1], drive[2], 0.0, 0.0])

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the torque of the liquid, -gain times its deflection."""
        w = math.tau * self.c["frequency"]
        pull = w * (w * (drive[1:3] - own[:2]) - 2.0 * self.c["damping"] * own[2:])
        back = self.c["gain"] * own[:2]
        return np.array([0.0, -back[0], -back[1], 0.0]), np.append(own[2:], pull)


LAWS: dict[str, Law] = {
    "periodic_force": periodic_force,
    "ground_tether": ground_tether,
    "winch_tether": winch_tether,
    "rubbing_line": rubbing_line,
    "lifted_cable": lifted_cable,
    "twisted_cable": twisted_cable,
    "sticking_axis": sticking_axis,
    "spinning_lidar": spinning_lidar,
    "sliding_load": sliding_load,
}
STATEFUL: dict[str, type[StatefulEffect]] = {
    "sprung_load": SprungLoad,
    "liquid_slosh": LiquidSlosh,
}
