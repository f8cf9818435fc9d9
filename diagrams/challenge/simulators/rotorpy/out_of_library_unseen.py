"""The foreign kinds of sets of their own, written anew for the simulator `rotorpy`."""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.base import Hidden
from diagrams.challenge.simulators.rotorpy.library_effects import Instant, Law, Values, cross
from diagrams.challenge.simulators.rotorpy.out_of_library_further import of_rotors
from np_drake.vehicle import Vehicle


def lifted_cable(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Weight that grows with height."""
    weight = vehicle.gravity * c["density"] * max(float(now.p[2]), 0.0)
    return np.append(-weight * now.R[2], [0.0, 0.0, 0.0])


def doorway_draft(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A force in W on the far side of a plane; the edge is a logistic curve."""
    ahead = sum(n * p for n, p in zip(c["normal"], now.p.tolist(), strict=True)) - c["from_origin"]
    exponent = min(-2.0 * ahead / c["edge"], 700.0)  # beyond which the exponential overflows
    return np.append(np.array(c["force"]) @ now.R / (1.0 + math.exp(exponent)), [0.0, 0.0, 0.0])


def passing_vehicle(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A bell of downward force about the nearest passage, and a torque that changes sign there."""
    cycles = (now.t - c["passage"]) / c["period"]
    s = (cycles - math.floor(cycles + 0.5)) * c["period"] / c["duration"]
    push = c["force"] / math.exp(0.5 * s * s)
    turn = c["lever"] * s * push
    f_W = np.array([0.0, 0.0, -push])
    tau_W = np.array([turn * math.cos(c["course"]), turn * math.sin(c["course"]), 0.0])
    return np.concatenate([f_W @ now.R, tau_W @ now.R])


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


def spinning_lidar(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Roll rate twists in pitch, pitch rate in roll."""
    x, y, _ = now.w.tolist()
    return np.array([0.0, 0.0, 0.0, -c["h"] * y, c["h"] * x, 0.0])


def twisting_mount(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A level force at one rotor, across its arm, with the square of its thrust."""
    x, y, z = vehicle.rotor_positions[c["rotor"]]
    thrust = float(now.thrust[c["rotor"]])
    aside = c["twist"] * thrust * thrust * 4.0 / (vehicle.mass * vehicle.gravity) / math.hypot(x, y)
    force = np.array([-y * aside, x * aside, 0.0])
    return np.append(force, cross(np.array([x, y, z]), force))


UNSEEN_LAWS: dict[str, Law] = {
    "lifted_cable": lifted_cable,
    "doorway_draft": doorway_draft,
    "passing_vehicle": passing_vehicle,
    "wake_interference": wake_interference,
    "spinning_lidar": spinning_lidar,
    "twisting_mount": twisting_mount,
}


class CreepingBlades(Hidden):
    """Every rotor gives less by its filtered load above that in hover. State: the four filtered loads [N]."""

    size = 4

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """(4,) [N]."""
        return self.vehicle.unmixer @ drive

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the four lose; the blades give way slowly."""
        load, hover = self.vehicle.unmixer @ drive, self.vehicle.mass * self.vehicle.gravity / 4
        lost = self.c["creep"] * load * (own - hover) / hover
        return -(self.vehicle.mixer @ lost), (load - own) / self.c["time"]


class DynamicInflow(Hidden):
    """Every rotor's thrust with a share of its own high-pass. State: the four low-passes [N]."""

    size = 4

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """(4,) [N]."""
        return self.vehicle.unmixer @ drive

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The overshoot; no rotor pulls downwards."""
        load = self.vehicle.unmixer @ drive
        change = load - own
        over = np.maximum(self.c["gain"] * change, -load)
        return self.vehicle.mixer @ over, change / self.c["time"]


UNSEEN_HIDDEN: dict[str, type[Hidden]] = {
    "creeping_blades": CreepingBlades,
    "dynamic_inflow": DynamicInflow,
}
