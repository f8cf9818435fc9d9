"""Out-of-library faults between command and rotor thrust, for the simulator `rotorpy`."""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.library_effects import Gain, Instant, Law, Values, cross
from diagrams.challenge.simulators.rotorpy.out_of_library.base import StatefulEffect, of_rotors
from np_drake.vehicle import Vehicle


def rotor_saturation(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """The thrust that every rotor lacks above its limit."""
    over = now.thrust - np.minimum(now.thrust, c["limit"])
    return of_rotors(vehicle, -over)


def stuttering_rotor(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """One rotor gives less at the beginning of every period."""
    lost = np.zeros(4)
    if now.t % c["period"] < c["share"] * c["period"]:
        lost[c["rotor"]] = c["loss"] * now.thrust[c["rotor"]]
    return of_rotors(vehicle, -lost)


def twisting_mount(vehicle: Vehicle, c: Values, now: Instant) -> np.ndarray:
    """A level force at one rotor, across its arm, with the square of its thrust."""
    x, y, z = vehicle.rotor_positions[c["rotor"]]
    thrust = float(now.thrust[c["rotor"]])
    aside = c["twist"] * thrust * thrust * 4.0 / (vehicle.mass * vehicle.gravity) / math.hypot(x, y)
    force = np.array([-y * aside, x * aside, 0.0])
    return np.append(force, cross(np.array([x, y, z]), force))


def bent_thrust_curve(vehicle: Vehicle, c: Values, thrust: np.ndarray, t: float) -> np.ndarray:
    """Thrust f = c - bend (c - h)³ / h² about the thrust h of a hovering rotor."""
    hover = vehicle.mass * vehicle.gravity / 4
    over = thrust / hover - 1.0
    return np.maximum(thrust - c["bend"] * hover * over * over * over, 0.0)


class CreepingBlades(StatefulEffect):
    """Every rotor gives less by its filtered load above that in hover. State: the four filtered loads [N]."""

    size = 4

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """Return the filtered loads (4,) [N]."""
        return self.vehicle.unmixer @ drive

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what the rotors lose; the blades give way slowly."""
        load, hover = self.vehicle.unmixer @ drive, self.vehicle.mass * self.vehicle.gravity / 4
        lost = self.c["creep"] * load * (own - hover) / hover
        return -(self.vehicle.mixer @ lost), (load - own) / self.c["time"]


class ShakingRotors(StatefulEffect):
    """Every rotor loses a share while it shakes, most about one load. State: the four shares that are lost [1]."""

    size = 4

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """Return the shares lost (4,) [1]."""
        return self._worst(self.vehicle.unmixer @ drive)

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what the rotors lose; shaking takes its time to come and go."""
        load = self.vehicle.unmixer @ drive
        return -(self.vehicle.mixer @ (own * load)), (self._worst(load) - own) / self.c["time"]

    def _worst(self, load: np.ndarray) -> np.ndarray:
        """Return the shares (4,) lost where the loads last [1]."""
        hover = self.vehicle.mass * self.vehicle.gravity / 4
        off = (load - self.c["load"] * hover) / (self.c["width"] * hover)
        return self.c["loss"] / np.exp(off * off)


class LosingSync(StatefulEffect):
    """One rotor drops out on a fast rise. State: low-pass of its thrust [N], share that it loses [1]."""

    size = 2

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """Return the state in step (2,)."""
        return np.array([self._load(drive), 0.0])

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what one rotor lacks."""
        followed, share = own.tolist()
        load = self._load(drive)
        least = self.c["jump"] * self.vehicle.mass * self.vehicle.gravity / 4
        out_of_step = min(max(load - followed - least, 0.0), least) / least
        rate = np.array([load - followed, self.c["loss"] * out_of_step - share]) / self.c["time"]
        return -share * load * self.vehicle.mixer[:, self.c["rotor"]], rate

    def _load(self, drive: np.ndarray) -> float:
        """Thrust that it should give [N]."""
        return float(self.vehicle.unmixer[self.c["rotor"]] @ drive)


class ThrustRateTorque(StatefulEffect):
    """Roll and pitch torque with collective thrust less its own low-pass. State: the low-pass [N]."""

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """Return the low-pass (1,) [N]."""
        return drive[:1].copy()

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return high-passed thrust times the arms."""
        change = float(drive[0] - own[0])
        added = np.array([0.0, self.c["arm_x"] * change, self.c["arm_y"] * change, 0.0])
        return added, np.array([change / self.c["time"]])


class YawBacklash(StatefulEffect):
    """Yaw torque with play. State: the torque that comes through [N·m]."""

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """Return the torque that comes through (1,) [N·m]."""
        return drive[3:].copy()

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what comes through less what was sent; it moves when pushed from an edge of the band."""
        ahead = float(drive[3] - own[0])
        push = ahead - min(max(ahead, -self.c["play"]), self.c["play"])
        return np.array([0.0, 0.0, 0.0, -ahead]), np.array([push / self.c["time"]])


class SoftArms(StatefulEffect):
    """Roll torque comes through as pitch torque too, pitch torque as roll the other way. State: what does [N·m]."""

    size = 2

    def rest(self, drive: np.ndarray) -> np.ndarray:
        """Return the torque carried over (2,) [N·m]."""
        return self.c["gain"] * np.array([-drive[2], drive[1]])

    def act(self, drive: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the torque carried over; it follows with a lag of first order."""
        return np.array([0.0, own[0], own[1], 0.0]), (self.rest(drive) - own) / self.c["time"]


LAWS: dict[str, Law] = {
    "rotor_saturation": rotor_saturation,
    "stuttering_rotor": stuttering_rotor,
    "twisting_mount": twisting_mount,
}
GAINS: dict[str, Gain] = {"bent_thrust_curve": bent_thrust_curve}
STATEFUL: dict[str, type[StatefulEffect]] = {
    "creeping_blades": CreepingBlades,
    "shaking_rotors": ShakingRotors,
    "losing_sync": LosingSync,
    "thrust_rate_torque": ThrustRateTorque,
    "yaw_backlash": YawBacklash,
    "soft_arms": SoftArms,
}
