"""The further foreign kinds of sets of their own, written anew for the simulator `rotorpy`."""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.base import Hidden
from diagrams.challenge.simulators.rotorpy.library_effects import Instant, Law, Values
from np_drake.vehicle import Vehicle


def standing_eddy(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A level force round an upright axis; its size by the distance, its course a quarter ahead of the way out."""
    east, north = (float(now.p[i]) - c["center"][i] for i in (0, 1))
    away, course = math.hypot(east, north) / c["core"], math.atan2(north, east) + math.pi / 2
    size = c["force"] * away * math.exp(0.5) / math.exp(0.5 * away * away)
    f_W = np.array([size * math.cos(course), size * math.sin(course), 0.0])
    return np.append(f_W @ now.R, [0.0, 0.0, 0.0])


def rubbing_line(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Against the way over ground, and soon no stronger the faster it goes."""
    speed = math.sqrt(float(now.v @ now.v))
    if speed < 1e-12:
        return np.zeros(6)
    fade = math.exp(-2.0 * speed / c["creep"])
    friction = c["force"] * (1.0 - fade) / (1.0 + fade)
    return np.append(-friction / speed * (now.v @ now.R), [0.0, 0.0, 0.0])


def tilted_cushion(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """About the level axis in which body z leans away from the vertical, against that lean."""
    lean_x, lean_y, _ = now.R[:, 2].tolist()
    size = c["lever"] * float(now.thrust.sum()) / math.exp(max(float(now.p[2]), 0.0) / c["reach"])
    tau_W = np.array([size * lean_y, -size * lean_x, 0.0])
    return np.append([0.0, 0.0, 0.0], tau_W @ now.R)


def panel_flutter(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Up and down at one place, once the air is fast."""
    square = float(now.air @ now.air)
    excess = square - c["onset"] * c["onset"]
    if excess <= 0.0:
        return np.zeros(6)
    lift = c["force"] * excess / square * math.sin(math.tau * c["frequency"] * now.t + c["phase"])
    return np.array([0.0, 0.0, lift, c["y"] * lift, -c["x"] * lift, 0.0])


FRESH_LAWS: dict[str, Law] = {
    "standing_eddy": standing_eddy,
    "rubbing_line": rubbing_line,
    "tilted_cushion": tilted_cushion,
    "panel_flutter": panel_flutter,
}


class ShakingRotors(Hidden):
    """Every rotor loses a share while it shakes, most about one load. State: the four shares that are lost [1]."""

    size = 4

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """(4,) [1]."""
        return self._worst(self.vehicle.unmixer @ drive)

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the four lose; shaking takes its time to come and go."""
        load = self.vehicle.unmixer @ drive
        return -(self.vehicle.mixer @ (own * load)), (self._worst(load) - own) / self.c["time"]

    def _worst(self, load: np.ndarray) -> np.ndarray:
        """(4,) shares lost where the loads last [1]."""
        hover = self.vehicle.mass * self.vehicle.gravity / 4
        off = (load - self.c["load"] * hover) / (self.c["width"] * hover)
        return self.c["loss"] / np.exp(off * off)


class SoftArms(Hidden):
    """Roll torque comes through as pitch torque too, pitch torque as roll the other way. State: what does [N·m]."""

    size = 2

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """(2,) [N·m]."""
        return self.c["gain"] * np.array([-drive[2], drive[1]])

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The torque carried over; it follows with a lag of first order."""
        return np.array([0.0, own[0], own[1], 0.0]), (self.rest(drive) - own) / self.c["time"]


FRESH_HIDDEN: dict[str, type[Hidden]] = {
    "shaking_rotors": ShakingRotors,
    "soft_arms": SoftArms,
}
