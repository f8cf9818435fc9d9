"""The foreign effects, written anew for the simulator `rotorpy`: laws without memory, and those with a hidden state."""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.library_effects import Instant, Law, Values, at_center, cross
from np_drake.vehicle import Vehicle


def _from_world(now: Instant, f_W: np.ndarray) -> np.ndarray:
    """(6,) of a force at Bo (3,) in W [N]."""
    return np.concatenate([f_W @ now.R, np.zeros(3)])


def fan_jet(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A force in W that fades like a bell curve with the distance from one place."""
    away = np.subtract(now.p, c["center"]) / c["size"]
    return _from_world(now, math.exp(-0.5 * float(away @ away)) * np.array(c["force"]))


def periodic_force(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A force in W that swings with the flight's time."""
    return _from_world(now, math.sin(math.tau * c["frequency"] * now.t + c["phase"]) * np.array(c["force"]))


def rotational_damping(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Torque against the body rates, with their square, every axis for itself."""
    return np.concatenate([np.zeros(3), -c["c"] * now.w * np.abs(now.w)])


def magnus_force(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """c w x v in body axes."""
    return at_center(*(c["c"] * cross(now.w, now.air)))


def ground_tether(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A rubber band to a place on the ground; slack until it is stretched."""
    way = np.subtract(c["anchor"], now.p)
    span = math.sqrt(float(way @ way))
    stretch = max(span - c["slack"], 0.0)
    return _from_world(now, c["stiffness"] * stretch / max(span, 1e-6) * way)


def sticking_axis(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """At the beginning of every period one axis is braked and twisted."""
    out = np.zeros(6)
    if now.t % c["period"] < c["share"] * c["period"]:
        out[3 + c["axis"]] = c["torque"] - c["drag"] * now.w[c["axis"]]
    return out


def wall_suction(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A share of the thrust pulls towards a wall, less and less with the distance from it."""
    normal = np.array(c["normal"])
    away = max(c["from_origin"] - float(normal @ now.p), 0.0)
    return _from_world(now, c["strength"] * float(now.thrust.sum()) * math.exp(-away / c["reach"]) * normal)


def side_lift(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Body y force with the forward air speed and the climb rate."""
    return at_center(0.0, c["c"] * abs(float(now.air[0])) * float(now.v[2]), 0.0)


FOREIGN_LAWS: dict[str, Law] = {
    "fan_jet": fan_jet,
    "periodic_force": periodic_force,
    "rotational_damping": rotational_damping,
    "magnus_force": magnus_force,
    "ground_tether": ground_tether,
    "sticking_axis": sticking_axis,
    "wall_suction": wall_suction,
    "side_lift": side_lift,
}


class Hidden:
    """An effect with a state of its own, driven by what the rotors give, drive (4,) = [f, tau] in B [N, N·m]."""

    size = 1

    def __init__(self, vehicle: Vehicle, values: Values):
        self.vehicle, self.c = vehicle, values

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """(size,) at which nothing happens under a constant drive."""
        raise NotImplementedError

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(4,) what it adds to the drive [N, N·m], and the rate (size,) of its state."""
        raise NotImplementedError


class ThrustRateTorque(Hidden):
    """Roll and pitch torque with collective thrust less its own low-pass. State: the low-pass [N]."""

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """(1,) [N]."""
        return drive[:1].copy()

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """High-passed thrust times the arms."""
        change = float(drive[0] - own[0])
        added = np.array([0.0, self.c["arm_x"] * change, self.c["arm_y"] * change, 0.0])
        return added, np.array([change / self.c["time"]])


class YawBacklash(Hidden):
    """Yaw torque with play. State: the torque that comes through [N·m]."""

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """(1,) [N·m]."""
        return drive[3:].copy()

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What comes through instead of what was sent; it moves when pushed from an edge of the band."""
        ahead = float(drive[3] - own[0])
        push = ahead - min(max(ahead, -self.c["play"]), self.c["play"])
        return np.array([0.0, 0.0, 0.0, -ahead]), np.array([push / self.c["time"]])


class LiquidSlosh(Hidden):
    """Two damped oscillators behind roll and pitch torque. State: deflections [N·m] and their rates [N·m/s]."""

    size = 4

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """(4,)."""
        return np.array([drive[1], drive[2], 0.0, 0.0])

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The liquid twists back by `gain` times its deflection."""
        w = math.tau * self.c["frequency"]
        pull = w * (w * (drive[1:3] - own[:2]) - 2.0 * self.c["damping"] * own[2:])
        back = self.c["gain"] * own[:2]
        return np.array([0.0, -back[0], -back[1], 0.0]), np.append(own[2:], pull)


HIDDEN: dict[str, type[Hidden]] = {
    "thrust_rate_torque": ThrustRateTorque,
    "yaw_backlash": YawBacklash,
    "liquid_slosh": LiquidSlosh,
}
