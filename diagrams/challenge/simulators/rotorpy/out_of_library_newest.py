"""The newest foreign kinds of sets of their own, written anew for the simulator `rotorpy`."""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.base import Hidden
from diagrams.challenge.simulators.rotorpy.library_effects import Instant, Law, Values, cross
from diagrams.challenge.simulators.rotorpy.out_of_library_further import of_rotors
from np_drake.vehicle import Vehicle


def winch_tether(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A pull towards the winch that is as strong far away as near, and weaker while the tether comes in."""
    way = np.subtract(c["anchor"], now.p)
    span = max(math.sqrt(float(way @ way)), 1e-6)
    comes_in = float(now.v @ way) / span
    pull = c["tension"] * (1.0 - c["friction"] * math.tanh(comes_in / c["creep"]))
    return np.append(pull / span * (way @ now.R), [0.0, 0.0, 0.0])


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


def odd_propeller(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A force in the plane of the rotors at one of them, across the flow, with that rotor's speed."""
    load = max(float(now.thrust[c["rotor"]]), 0.0)
    size = 2.0 * c["c"] * math.sqrt(load / (vehicle.mass * vehicle.gravity))
    force = np.array([-size * now.air[1], size * now.air[0], 0.0])
    return np.append(force, cross(np.array(vehicle.rotor_positions[c["rotor"]]), force))


def bent_vane(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """Yaw torque with thrust, less in flow from the side."""
    x, y, _ = now.air.tolist()
    half = c["speed"] * c["speed"]
    left = half / (half + x * x + y * y)
    return np.array([0.0, 0.0, 0.0, 0.0, 0.0, c["lever"] * left * float(now.thrust.sum())])


NEWEST_LAWS: dict[str, Law] = {
    "winch_tether": winch_tether,
    "platform_edge": platform_edge,
    "odd_propeller": odd_propeller,
    "bent_vane": bent_vane,
}


class SprungLoad(Hidden):
    """A mass on a damped spring along body z. State: its way up from the frame [m] and the rate [m/s]."""

    size = 2

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """(2,): the spring gives until it carries it."""
        stiffness = (math.tau * self.c["frequency"]) ** 2
        return np.array([-float(drive[0]) / (stiffness * self.vehicle.mass), 0.0])

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the frame is pushed less, or more, as the load accelerates away from it."""
        way, rate = own.tolist()
        w, mass = math.tau * self.c["frequency"], self.vehicle.mass
        acceleration = -w * w * way - 2.0 * self.c["damping"] * w * rate - float(drive[0]) / mass
        added = -self.c["share"] * mass * acceleration
        return np.array([added, 0.0, 0.0, 0.0]), np.array([rate, acceleration])


class LosingSync(Hidden):
    """One rotor drops out on a fast rise. State: low-pass of its thrust [N], share that it loses [1]."""

    size = 2

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """(2,): in step."""
        return np.array([self._load(drive), 0.0])

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What one rotor lacks."""
        followed, share = own.tolist()
        load = self._load(drive)
        least = self.c["jump"] * self.vehicle.mass * self.vehicle.gravity / 4
        out_of_step = min(max(load - followed - least, 0.0), least) / least
        rate = np.array([load - followed, self.c["loss"] * out_of_step - share]) / self.c["time"]
        return -share * load * self.vehicle.mixer[:, self.c["rotor"]], rate

    def _load(self, drive: np.ndarray) -> float:
        """Thrust that it should give [N]."""
        return float(self.vehicle.unmixer[self.c["rotor"]] @ drive)


NEWEST_HIDDEN: dict[str, type[Hidden]] = {
    "sprung_load": SprungLoad,
    "losing_sync": LosingSync,
}
