"""Out-of-library moving air, for the simulator `rotorpy`."""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.library_effects import Instant, Law, Values
from diagrams.challenge.simulators.rotorpy.out_of_library.base import from_world
from np_drake.vehicle import Vehicle


def fan_jet(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A force in W that fades like a bell curve with the distance from one place."""
    away = np.subtract(now.p, c["center"]) / c["size"]
    return from_world(now, math.exp(-0.5 * float(away @ away)) * np.array(c["force"]))


def wind_shear(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A level force that grows with height and turns round at one."""
    push = c["c"] * (float(now.p[2]) - c["height"])
    f_W = np.array([push * math.cos(c["course"]), push * math.sin(c["course"]), 0.0])
    return from_world(now, f_W)


def doorway_draft(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A force in W on the far side of a plane; the edge is a logistic curve."""
    ahead = sum(n * p for n, p in zip(c["normal"], now.p.tolist(), strict=True)) - c["from_origin"]
    exponent = min(-2.0 * ahead / c["edge"], 700.0)  # beyond which the exponential overflows
    return np.append(np.array(c["force"]) @ now.R / (1.0 + math.exp(exponent)), [0.0, 0.0, 0.0])


def standing_eddy(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A level force round an upright axis; its size by the distance, its course a quarter ahead of the way out."""
    east, north = (float(now.p[i]) - c["center"][i] for i in (0, 1))
    away, course = math.hypot(east, north) / c["core"], math.atan2(north, east) + math.pi / 2
    size = c["force"] * away * math.exp(0.5) / math.exp(0.5 * away * away)
    f_W = np.array([size * math.cos(course), size * math.sin(course), 0.0])
    return from_world(now, f_W)


def passing_vehicle(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A bell of downward force about the nearest passage, and a torque that changes sign there."""
    cycles = (now.t - c["passage"]) / c["period"]
    s = (cycles - math.floor(cycles + 0.5)) * c["period"] / c["duration"]
    push = c["force"] / math.exp(0.5 * s * s)
    turn = c["lever"] * s * push
    f_W = np.array([0.0, 0.0, -push])
    tau_W = np.array([turn * math.cos(c["course"]), turn * math.sin(c["course"]), 0.0])
    return np.concatenate([f_W @ now.R, tau_W @ now.R])


LAWS: dict[str, Law] = {
    "fan_jet": fan_jet,
    "wind_shear": wind_shear,
    "doorway_draft": doorway_draft,
    "standing_eddy": standing_eddy,
    "passing_vehicle": passing_vehicle,
}
